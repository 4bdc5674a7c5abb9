//! An inverted spatial hash of balls (van Kooten, van den Bergen and Telea 2007, sections 7.2.4 and 7.2.5): a ball is in every
//! cell that its influence sphere reaches, so that one cell holds all balls of a point. Each octave of radii has cells of its
//! own size; an entry knows its cell, so that no ball is met twice where two of its cells share a bucket.

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::memory;

/// The paper's, of equation 4.
const PRIMES: [i32; 3] = [11113, 12979, 13513];

/// Entries for each bucket, about.
const ENTRIES_A_BUCKET: usize = 8;

/// Cells from the origin to where coordinates of single precision are farther apart than any cell is wide, by far: there all of
/// a ball is in one.
const FARTHEST: f64 = (1u32 << 30) as f64;

/// A cell by its place along the axes; 32 bits each, as graphics processors have them.
pub type Cell = [i32; 3];

/// A ball in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Entry {
    /// Which.
    pub ball: u32,
    /// Of the cell, see [`tag`].
    pub tag: u32,
}

/// The cells of an octave of radii.
#[derive(Debug)]
pub struct Level {
    /// Of a cell.
    pub side: f64,
    /// The first entry of each bucket, and the end. There are a power of two of them.
    pub starts: Vec<u32>,
    /// By bucket, and there by ball.
    pub entries: Vec<Entry>,
}

/// Which balls reach a point.
#[derive(Debug)]
pub struct BallHash {
    levels: Vec<Level>,
}

impl BallHash {
    /// Puts balls into cells; `cell_share` is the side of a cell as a share of the diameter of the greatest ball of its octave.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn new(centers: &[[f32; 3]], radii: &[f32], cell_share: f64) -> Result<Self> {
        let mut octaves: Vec<(u32, Vec<u32>)> = Vec::new();
        for (ball, radius) in radii.iter().enumerate() {
            let octave = radius.to_bits() >> 23;
            let at = octaves.partition_point(|(other, _)| *other < octave);
            if octaves.get(at).is_none_or(|(other, _)| *other != octave) {
                octaves.insert(at, (octave, Vec::new()));
            }
            let balls = &mut octaves[at].1;
            memory::reserve(balls, 1)?;
            balls.push(ball as u32);
        }
        let levels = octaves.iter().map(|(_, balls)| Level::new(centers, radii, balls, cell_share));
        Ok(Self { levels: levels.collect::<Result<_>>()? })
    }

    /// One for each octave of radii.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// Visits all balls that may reach a point, each once and in the same order every time.
    #[inline]
    pub fn for_near(&self, point: [f64; 3], mut visit: impl FnMut(usize)) {
        for level in &self.levels {
            let cell = level.cell(point);
            let tag = tag(cell);
            let bucket = level.bucket(cell);
            let (begin, end) = (level.starts[bucket] as usize, level.starts[bucket + 1] as usize);
            level.entries[begin..end].iter().filter(|entry| entry.tag == tag).for_each(|entry| visit(entry.ball as usize));
        }
    }
}

impl Level {
    fn new(centers: &[[f32; 3]], radii: &[f32], balls: &[u32], cell_share: f64) -> Result<Self> {
        let greatest = balls.iter().map(|ball| radii[*ball as usize]).fold(0.0, f32::max);
        let mut level = Self { side: 2.0 * cell_share * f64::from(greatest), starts: Vec::new(), entries: Vec::new() };
        let for_cells = |level: &Self, ball: u32, visit: &mut dyn FnMut(Cell)| {
            level.for_cells(centers[ball as usize].map(f64::from), f64::from(radii[ball as usize]), visit);
        };
        let cells_of = |ball: &u32| {
            let mut count = 0;
            for_cells(&level, *ball, &mut |_| count += 1);
            count
        };
        let total: usize = balls.par_iter().map(cells_of).sum();
        if u32::try_from(total).is_err() {
            return Err(Error::OutOfMemory(total.saturating_mul(size_of::<Entry>())));
        }
        let buckets = (total / ENTRIES_A_BUCKET).next_power_of_two();
        level.starts = memory::filled(0, buckets + 1)?;
        let mut ends = memory::with_capacity(buckets)?;
        ends.extend((0..buckets).map(|_| AtomicU32::new(0)));
        balls.par_iter().for_each(|ball| {
            for_cells(&level, *ball, &mut |cell| {
                ends[level.bucket(cell)].fetch_add(1, Ordering::Relaxed);
            });
        });
        let mut sum = 0;
        for (bucket, end) in ends.iter_mut().enumerate() {
            level.starts[bucket] = sum;
            sum += std::mem::replace(end.get_mut(), sum);
        }
        level.starts[buckets] = sum;
        level.fill(total, balls, &ends, &for_cells)?;
        Ok(level)
    }

    /// Writes the entries; `next` says for each bucket where its next one goes.
    fn fill(
        &mut self,
        total: usize,
        balls: &[u32],
        next: &[AtomicU32],
        for_cells: &(impl Fn(&Self, u32, &mut dyn FnMut(Cell)) + Sync),
    ) -> Result<()> {
        let mut slots = memory::with_capacity(total)?;
        slots.extend((0..total).map(|_| [AtomicU32::new(0), AtomicU32::new(0)]));
        balls.par_iter().for_each(|ball| {
            for_cells(self, *ball, &mut |cell| {
                let slot: &[AtomicU32; 2] = &slots[next[self.bucket(cell)].fetch_add(1, Ordering::Relaxed) as usize];
                slot[0].store(*ball, Ordering::Relaxed);
                slot[1].store(tag(cell), Ordering::Relaxed);
            });
        });
        self.entries = memory::with_capacity(total)?;
        self.entries.extend(slots.into_iter().map(|[ball, tag]| Entry { ball: ball.into_inner(), tag: tag.into_inner() }));
        let mut rest = &mut self.entries[..];
        let mut buckets = memory::with_capacity(self.starts.len())?;
        for bounds in self.starts.windows(2) {
            let (bucket, others) = rest.split_at_mut((bounds[1] - bounds[0]) as usize);
            buckets.push(bucket);
            rest = others;
        }
        // Threads come as they like; sums must not.
        buckets.par_iter_mut().for_each(|bucket| bucket.sort_unstable());
        Ok(())
    }

    #[inline]
    fn cell(&self, point: [f64; 3]) -> Cell {
        point.map(|coordinate| (coordinate / self.side).floor().clamp(-FARTHEST, FARTHEST) as i32)
    }

    #[inline]
    fn bucket(&self, cell: Cell) -> usize {
        let sum = (0..3).fold(0i32, |sum, axis| sum.wrapping_add(PRIMES[axis].wrapping_mul(cell[axis])));
        sum.unsigned_abs() as usize & (self.starts.len() - 2)
    }

    /// Visits the cells that a sphere reaches.
    fn for_cells(&self, center: [f64; 3], radius: f64, visit: &mut dyn FnMut(Cell)) {
        if center.iter().any(|coordinate| (coordinate / self.side).abs() > FARTHEST) {
            return visit(self.cell(center));
        }
        let (low, high) = (self.cell(center.map(|c| c - radius)), self.cell(center.map(|c| c + radius)));
        // How far a cell is from the centre along an axis.
        let apart = |axis: usize, cell: i32| {
            let begin = f64::from(cell) * self.side;
            (begin - center[axis]).max(center[axis] - begin - self.side).max(0.0)
        };
        let reach = radius * radius * (1.0 + 1e-9);
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                let across = apart(0, x).powi(2) + apart(1, y).powi(2);
                if across > reach {
                    continue;
                }
                for z in low[2]..=high[2] {
                    if across + apart(2, z).powi(2) <= reach {
                        visit([x, y, z]);
                    }
                }
            }
        }
    }
}

/// A number that differs among cells which are less than 1024 apart.
#[inline]
pub fn tag([x, y, z]: Cell) -> u32 {
    let low = |coordinate: i32| coordinate as u32 & 1023;
    low(x) | low(y) << 10 | low(z) << 20
}
