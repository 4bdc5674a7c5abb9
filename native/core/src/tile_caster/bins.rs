//! Which balls each tile of pixels may see: counted, then filled, so that no list can overflow.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::occlusion::{CHUNK, Occlusion, set_bits, whole_numbers};
use super::project::{DISTANCE_ERROR, Projected, Projector, Rectangles};
use super::view::View;
use crate::balls::Balls;
use crate::error::{Error, Result};
use crate::job::Job;
use crate::memory;
use crate::simd::{LANES, Lanes, Mask, Path, Simd, Task, Vector};

/// Pixels of a tile's side.
pub const TILE: usize = 16;

/// Parts that the balls are divided into; each counts for itself.
const PARTS: usize = 32;

/// A ball that may be seen, in camera space.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct SeenBall {
    /// x, y, planar depth.
    pub center: [f32; 3],
    /// Influence radius R.
    pub radius: f32,
    /// q.
    pub weight: f32,
    /// Which of the given balls it is.
    pub index: u32,
    /// First and last column of tiles.
    columns: [u16; 2],
    /// First and last row of tiles.
    rows: [u16; 2],
}

/// The balls of each tile, in no order.
pub struct Bins {
    /// By chunk of the given balls.
    balls: Vec<Vec<SeenBall>>,
    /// Where each tile's entries begin, and where the last one's end.
    starts: Vec<usize>,
    /// Front, chunk and place in it, in this order of significance.
    entries: Vec<AtomicU64>,
    /// Of tiles.
    pub columns: usize,
    /// Of tiles.
    pub rows: usize,
}

impl Bins {
    /// Finds the balls of each tile.
    ///
    /// # Errors
    /// `Cancelled`, `OutOfMemory`.
    pub fn new(path: Path, balls: &Balls<'_>, view: &View, occlusion: &Occlusion, job: &Job) -> Result<Self> {
        let (columns, rows) = (view.width.div_ceil(TILE), view.height.div_ceil(TILE));
        let ends: Vec<f32> =
            (0..columns * rows).map(|tile| occlusion.end([tile % columns * TILE, tile / columns * TILE], [TILE; 2])).collect();
        let ends_around = greatest_around(&ends, columns, rows);
        let pass = Pass {
            balls,
            projector: Projector::new(view),
            is_perspective: view.is_perspective,
            ends: &ends,
            ends_around: &ends_around,
            columns,
            rows,
        };
        let chunks = balls.len().div_ceil(CHUNK);
        let parts: Vec<Range<usize>> = split(chunks, PARTS);
        let mut counted = parts
            .par_iter()
            .map(|part| {
                job.advance(part.len())?;
                path.dispatch(PartTask { pass: &pass, chunks: part.clone() })
            })
            .collect::<Result<Vec<_>>>()?;
        let starts = cursors(&mut counted, columns * rows)?;
        let mut entries = memory::with_capacity(starts[columns * rows])?;
        entries.resize_with(starts[columns * rows], || AtomicU64::new(0));
        counted.par_iter_mut().zip(&parts).for_each(|(part, chunks)| pass.fill(part, chunks.start, &entries));
        let balls = counted.into_iter().flat_map(|part| part.chunks).collect();
        Ok(Self { balls, starts, entries, columns, rows })
    }

    /// The entries of a tile, in no order; they sort by where the balls begin, then by index.
    #[inline(always)]
    pub fn tile(&self, tile: usize) -> impl ExactSizeIterator<Item = u64> {
        self.entries[self.starts[tile]..self.starts[tile + 1]].iter().map(|entry| entry.load(Ordering::Relaxed))
    }

    /// The lower left pixel of a tile.
    pub fn corner(&self, tile: usize) -> [usize; 2] {
        [tile % self.columns * TILE, tile / self.columns * TILE]
    }

    /// The ball of an entry.
    #[inline(always)]
    pub fn ball(&self, entry: u64) -> &SeenBall {
        let place = entry as u32 as usize;
        &self.balls[place / CHUNK][place % CHUNK]
    }

    /// How many balls may be seen.
    pub fn seen(&self) -> usize {
        self.balls.iter().map(Vec::len).sum()
    }

    /// How many pairs of balls and tiles there are.
    pub fn entry_count(&self) -> usize {
        self.entries.len()
    }
}

/// `count` things in at most `parts` ranges of about the same length.
fn split(count: usize, parts: usize) -> Vec<Range<usize>> {
    let parts = parts.min(count);
    (0..parts).map(|part| part * count / parts..(part + 1) * count / parts).collect()
}

/// What a part has found.
struct Part {
    /// The balls that may be seen, by chunk.
    chunks: Vec<Vec<SeenBall>>,
    /// For each tile: how many entries there are, later where the next one goes.
    tiles: Vec<u32>,
}

/// Turns the parts' counts into the places of their first entries; where each tile's entries begin, and the end.
fn cursors(parts: &mut [Part], tiles: usize) -> Result<Vec<usize>> {
    let mut starts = memory::with_capacity(tiles + 1)?;
    let mut next = 0;
    for tile in 0..tiles {
        starts.push(next);
        for part in parts.iter_mut() {
            let count = part.tiles[tile];
            part.tiles[tile] = next as u32;
            next += count as usize;
        }
    }
    starts.push(next);
    if next > u32::MAX as usize {
        return Err(Error::InvalidInput(format!("the balls cover {next} tiles in all, more than can be numbered; show fewer")));
    }
    Ok(starts)
}

/// What all parts share.
struct Pass<'a> {
    balls: &'a Balls<'a>,
    projector: Projector,
    is_perspective: bool,
    /// For each tile, the distance behind which nothing can be seen.
    ends: &'a [f32],
    /// The greatest of a tile and its eight neighbours.
    ends_around: &'a [f32],
    columns: usize,
    rows: usize,
}

/// The greatest number of each tile and its eight neighbours.
fn greatest_around(numbers: &[f32], columns: usize, rows: usize) -> Vec<f32> {
    let around = |tile: usize| {
        let (x, y) = (tile % columns, tile / columns);
        let neighbours = (y.saturating_sub(1)..(y + 2).min(rows))
            .flat_map(move |row| (x.saturating_sub(1)..(x + 2).min(columns)).map(move |column| row * columns + column));
        neighbours.fold(0.0, |greatest: f32, tile| greatest.max(numbers[tile]))
    };
    (0..columns * rows).map(around).collect()
}

/// Finds the balls of a range of chunks that may be seen, and counts them in their tiles.
struct PartTask<'a> {
    pass: &'a Pass<'a>,
    chunks: Range<usize>,
}

impl Task for PartTask<'_> {
    type Output = Result<Part>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Result<Part> {
        let pass = self.pass;
        let mut part = Part { chunks: memory::with_capacity(self.chunks.len())?, tiles: memory::filled(0, pass.ends.len())? };
        for chunk in self.chunks {
            let mut seen = Vec::new();
            let end = pass.balls.len().min((chunk + 1) * CHUNK);
            for first in (chunk * CHUNK..end).step_by(LANES) {
                pass.find_seen(simd, first, (end - first).min(LANES), &mut seen, &mut part.tiles)?;
            }
            part.chunks.push(seen);
        }
        Ok(part)
    }
}

impl Pass<'_> {
    #[inline(always)]
    fn find_seen<S: Simd>(
        &self,
        simd: S,
        first: usize,
        count: usize,
        seen: &mut Vec<SeenBall>,
        tiles: &mut [u32],
    ) -> Result<()> {
        let projected = self.projector.project(simd, self.balls, first);
        let (rectangles, lanes) = self.projector.rectangles(simd, &projected, count);
        memory::reserve(seen, LANES)?;
        for lane in set_bits(lanes & !self.hidden(simd, &projected, &rectangles)) {
            let tiles_of = |pixels: [&Lanes; 2]| pixels.map(|pixel| (pixel.0[lane] as u32 / TILE as u32) as u16);
            let ball = SeenBall {
                center: projected.center.each_ref().map(|axis| axis.0[lane]),
                radius: projected.radius.0[lane],
                weight: self.balls.weights()[first + lane],
                index: (first + lane) as u32,
                columns: tiles_of([&rectangles.x_min, &rectangles.x_max]),
                rows: tiles_of([&rectangles.y_min, &rectangles.y_max]),
            };
            let mut is_seen = false;
            self.for_tiles(&ball, |tile| {
                tiles[tile] += 1;
                is_seen = true;
            });
            if is_seen {
                seen.push(ball);
            }
        }
        Ok(())
    }

    /// A bit for each ball that is small and surely hidden.
    #[inline(always)]
    fn hidden<S: Simd>(&self, simd: S, balls: &Projected, rectangles: &Rectangles) -> u16 {
        let (column, is_narrow) = middle_tile(simd, &rectangles.x_min, &rectangles.x_max, self.columns);
        let (row, is_low) = middle_tile(simd, &rectangles.y_min, &rectangles.y_max, self.rows);
        let tiles = whole_numbers(simd, row.mul_add(simd.splat(self.columns as f32), column));
        let ends = Lanes(tiles.map(|tile| self.ends_around[tile]));
        let distance = simd.load(&balls.distance);
        // Nothing that may be seen is nearer to the eye than this says.
        let front = distance.max(simd.splat(0.0)).neg_mul_add(simd.splat(DISTANCE_ERROR), distance) - simd.load(&balls.radius);
        (simd.load(&ends).le(front) & is_narrow & is_low).bits()
    }

    /// Visits the tiles in which the ball may be seen.
    #[inline(always)]
    fn for_tiles(&self, ball: &SeenBall, mut visit: impl FnMut(usize)) {
        let front = front_of(ball, self.is_perspective);
        let [left, right] = ball.columns.map(usize::from);
        let [bottom, top] = ball.rows.map(usize::from);
        for row in bottom..=top {
            for tile in row * self.columns + left..=row * self.columns + right {
                if front < self.ends[tile] {
                    visit(tile);
                }
            }
        }
    }

    fn fill(&self, part: &mut Part, first_chunk: usize, entries: &[AtomicU64]) {
        for (offset, chunk) in part.chunks.iter().enumerate() {
            for (place, ball) in chunk.iter().enumerate() {
                let number = (first_chunk + offset) * CHUNK + place;
                let entry = u64::from(ordered_bits(front_of(ball, self.is_perspective))) << 32 | number as u64;
                self.for_tiles(ball, |tile| {
                    entries[part.tiles[tile] as usize].store(entry, Ordering::Relaxed);
                    part.tiles[tile] += 1;
                });
            }
        }
    }
}

/// Bits that are ordered as the floats are, negative ones too.
#[inline(always)]
fn ordered_bits(number: f32) -> u32 {
    let bits = number.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

/// The front that an entry holds.
#[inline(always)]
pub fn front_of_entry(entry: u64) -> f32 {
    let bits = (entry >> 32) as u32;
    f32::from_bits(if bits >> 31 == 1 { bits & !(1 << 31) } else { !bits })
}

/// The middle tile along an axis, and whether no pixel lies beyond its neighbours.
#[inline(always)]
fn middle_tile<S: Simd>(simd: S, first: &Lanes, last: &Lanes, count: usize) -> (S::Vector, S::Mask) {
    let (zero, one) = (simd.splat(0.0), simd.splat(1.0));
    let per_tile = simd.splat(1.0 / TILE as f32);
    let (first, last) = (simd.load(first) * per_tile, simd.load(last) * per_tile);
    let middle = ((first + last) * simd.splat(0.5)).floor().max(zero).min(simd.splat((count - 1) as f32));
    (middle, (middle - one).le(first.floor()) & last.floor().le(middle + one))
}

/// A distance before the ball's influence sphere begins for any ray.
#[inline(always)]
fn front_of(ball: &SeenBall, is_perspective: bool) -> f32 {
    let [x, y, depth] = ball.center;
    let distance = if is_perspective { (x * x + y * y + depth * depth).sqrt() } else { depth };
    distance - distance.abs() * DISTANCE_ERROR - ball.radius
}
