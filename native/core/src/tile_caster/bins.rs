//! Which balls each tile of pixels may see: counted, then filled, so that no list can overflow.

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::culling::{CHUNK, Chunk, Culled, SeenBall};
use super::occlusion::Occlusion;
use super::view::View;
use crate::error::{Error, Result};
use crate::job::Job;
use crate::memory::{self, Spares};

/// Pixels of a tile's side, as powers of two: usually, and where balls are small. Small tiles spare packets the balls of
/// others, but hold large balls more often.
const USUAL_TILE: u32 = 4;
const SMALL_TILE: u32 = 3;
/// Pixels of the greatest tile's side.
pub const GREATEST_TILE: usize = 1 << USUAL_TILE;

/// Balls count as small where they are not wider than so many pixels on average.
const SMALL: usize = 3;

/// Of so many balls one is asked for its width.
const ASKED: usize = 64;

/// Parts that the balls are divided into for each thread, and in all; each counts for itself. The entries are in the same
/// order for any number.
const PARTS_A_THREAD: usize = 4;
const MOST_PARTS: usize = 32;

/// How often all chunks are gone through.
pub const PASSES: usize = 2;

/// Memory for the entries.
static ENTRIES: Spares<AtomicU64> = Spares::new();

/// The balls of each tile, in no order.
pub struct Bins {
    chunks: Vec<Chunk>,
    /// Whether most balls are only a few pixels wide.
    pub are_small: bool,
    /// Where each tile's entries begin, and where the last one's end.
    starts: Vec<usize>,
    /// Front, chunk and place in it, in this order of significance.
    entries: Vec<AtomicU64>,
    /// Pixels of a tile's side.
    pub side: usize,
    /// Of tiles.
    pub columns: usize,
    /// Of tiles.
    pub rows: usize,
    /// What kernel spheres hide.
    pub occlusion: Occlusion,
}

impl Bins {
    /// Sorts the balls into tiles.
    ///
    /// # Errors
    /// `Cancelled`, `OutOfMemory`.
    pub fn new(culled: Culled, view: &View, job: &Job) -> Result<Self> {
        let Culled { mut chunks, occlusion } = culled;
        let are_small = are_small(&chunks);
        let power = if are_small { SMALL_TILE } else { USUAL_TILE };
        let side = 1 << power;
        let (columns, rows) = (view.width.div_ceil(side), view.height.div_ceil(side));
        let ends = occlusion.ends(side, [columns, rows]);
        let grid = Grid { ends: &ends, power, columns };
        let parts = (PARTS_A_THREAD * rayon::current_num_threads()).min(MOST_PARTS);
        let part_length = chunks.len().div_ceil(parts).max(1);
        let mut cursors = chunks
            .par_chunks_mut(part_length)
            .map(|part| {
                job.advance(part.len())?;
                grid.count(part)
            })
            .collect::<Result<Vec<_>>>()?;
        let starts = starts(&mut cursors, columns * rows)?;
        let mut entries = ENTRIES.take();
        memory::reserve(&mut entries, starts[columns * rows])?;
        entries.resize_with(starts[columns * rows], || AtomicU64::new(0));
        let parts = chunks.par_chunks(part_length).zip(&mut cursors).enumerate();
        parts.try_for_each(|(part, (chunks, cursors))| {
            job.advance(chunks.len())?;
            grid.fill(chunks, part * part_length, cursors, &entries);
            Ok(())
        })?;
        Ok(Self { chunks, are_small, starts, entries, side, columns, rows, occlusion })
    }

    /// The entries of a tile, in no order; they sort by where the balls begin, then by index.
    #[inline(always)]
    pub fn tile(&self, tile: usize) -> impl ExactSizeIterator<Item = u64> {
        self.entries[self.starts[tile]..self.starts[tile + 1]].iter().map(|entry| entry.load(Ordering::Relaxed))
    }

    /// The lower left pixel of a tile.
    pub fn corner(&self, tile: usize) -> [usize; 2] {
        [tile % self.columns * self.side, tile / self.columns * self.side]
    }

    /// The ball of an entry.
    #[inline(always)]
    pub fn ball(&self, entry: u64) -> &SeenBall {
        let place = entry as u32 as usize;
        &self.chunks[place / CHUNK].balls[place % CHUNK]
    }

    /// How many balls may be seen.
    pub fn seen(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.balls.len()).sum()
    }

    /// How many pairs of balls and tiles there are.
    pub fn entry_count(&self) -> usize {
        self.entries.len()
    }
}

impl Drop for Bins {
    fn drop(&mut self) {
        ENTRIES.give(std::mem::take(&mut self.entries));
    }
}

/// Whether balls are narrow on average, by a sample.
fn are_small(chunks: &[Chunk]) -> bool {
    let widths =
        chunks.iter().flat_map(|chunk| &chunk.balls).step_by(ASKED).map(|ball| usize::from(ball.columns[1] - ball.columns[0]));
    let (count, sum) = widths.fold((0, 0), |(count, sum), width| (count + 1, sum + width + 1));
    sum <= SMALL * count
}

/// Turns what the parts have counted into the places of their first entries; where each tile's entries begin, and the end.
fn starts(parts: &mut [Vec<u32>], tiles: usize) -> Result<Vec<usize>> {
    let mut starts = memory::with_capacity(tiles + 1)?;
    let mut next = 0;
    for tile in 0..tiles {
        starts.push(next);
        for part in parts.iter_mut() {
            let count = part[tile];
            part[tile] = next as u32;
            next += count as usize;
        }
    }
    starts.push(next);
    if next > u32::MAX as usize {
        return Err(Error::InvalidInput(format!("the balls cover {next} tiles in all, more than can be numbered; show fewer")));
    }
    Ok(starts)
}

/// The tiles.
struct Grid<'a> {
    /// For each tile, the distance behind which nothing can be seen.
    ends: &'a [f32],
    /// Of two: pixels of a tile's side.
    power: u32,
    columns: usize,
}

impl Grid<'_> {
    /// For each tile, how many of the balls may be seen in it; forgets those that can be seen in none.
    fn count(&self, chunks: &mut [Chunk]) -> Result<Vec<u32>> {
        let mut counts = memory::filled(0, self.ends.len())?;
        for chunk in chunks {
            chunk.retain(|ball, front| {
                let mut is_seen = false;
                self.for_tiles(ball, front, |tile| {
                    counts[tile] += 1;
                    is_seen = true;
                });
                is_seen
            });
        }
        Ok(counts)
    }

    /// Writes the entries of the balls to where the `cursors` of their tiles point.
    fn fill(&self, chunks: &[Chunk], first_chunk: usize, cursors: &mut [u32], entries: &[AtomicU64]) {
        for (offset, chunk) in chunks.iter().enumerate() {
            for (place, (ball, front)) in chunk.balls.iter().zip(&chunk.fronts).enumerate() {
                let number = (first_chunk + offset) * CHUNK + place;
                let entry = u64::from(ordered_bits(*front)) << 32 | number as u64;
                self.for_tiles(ball, *front, |tile| {
                    entries[cursors[tile] as usize].store(entry, Ordering::Relaxed);
                    cursors[tile] += 1;
                });
            }
        }
    }

    /// Visits the tiles in which a ball may be seen that begins at `front`.
    #[inline(always)]
    fn for_tiles(&self, ball: &SeenBall, front: f32, mut visit: impl FnMut(usize)) {
        let tile_of = |pixel: u16| usize::from(pixel) >> self.power;
        let ([left, right], [bottom, top]) = (ball.columns.map(tile_of), ball.rows.map(tile_of));
        for row in bottom..=top {
            for tile in row * self.columns + left..=row * self.columns + right {
                if front < self.ends[tile] {
                    visit(tile);
                }
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
