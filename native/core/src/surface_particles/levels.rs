//! Cells of several sizes for things that reach differently far: each is in the cells of its level, which are as wide as the reach of
//! the farthest, or the half of that, or a quarter.

use crate::error::Result;
use crate::memory;
use crate::tracing::random::mixed;

use super::hash::Cell;

/// A little wider than the reach, which may be rounded.
const SLACK: f64 = 1.0001;

/// Levels at most: beyond these all is in the finest cells.
const MOST: u32 = 60;

/// The steps to a cell's neighbours along an axis.
const NEAREST_FIRST: [i32; 3] = [0, -1, 1];

/// The sizes of the cells.
#[derive(Clone, Copy, Debug)]
pub struct Levels {
    widest: f64,
}

/// A cell of a level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LevelCell {
    /// 0 for the widest.
    pub level: u32,
    /// By its place along the axes.
    pub cell: Cell,
}

impl Levels {
    /// For things of which the farthest reaches so far, more than 0.
    pub fn new(farthest: f64) -> Self {
        Self { widest: SLACK * farthest }
    }

    /// The level of what reaches so far.
    pub fn level(self, reach: f64) -> u32 {
        (self.widest / (SLACK * reach)).log2().clamp(0.0, f64::from(MOST)) as u32
    }

    /// The cell of a point on a level.
    pub fn cell(self, level: u32, point: [f64; 3]) -> LevelCell {
        let side = self.widest * 0.5f64.powi(level as i32);
        LevelCell { level, cell: point.map(|coordinate| (coordinate / side).floor() as i32) }
    }

    /// Visits the cells of some levels that hold what may reach a point, on each level that of the point first, until one is found.
    /// Whether it was.
    #[inline]
    pub fn any_around(self, levels: &[u32], point: [f64; 3], mut is_found: impl FnMut(LevelCell) -> bool) -> bool {
        levels.iter().any(|level| {
            let [x, y, z] = self.cell(*level, point).cell;
            NEAREST_FIRST.iter().any(|dx| {
                NEAREST_FIRST.iter().any(|dy| {
                    NEAREST_FIRST.iter().any(|dz| {
                        let cell = [x.wrapping_add(*dx), y.wrapping_add(*dy), z.wrapping_add(*dz)];
                        is_found(LevelCell { level: *level, cell })
                    })
                })
            })
        })
    }

    /// Visits all of these cells.
    #[inline]
    pub fn for_around(self, levels: &[u32], point: [f64; 3], mut visit: impl FnMut(LevelCell)) {
        self.any_around(levels, point, |cell| {
            visit(cell);
            false
        });
    }
}

impl LevelCell {
    /// Its bucket, of a power of two of them.
    #[inline]
    pub fn bucket(self, buckets: usize) -> usize {
        let [x, y, z] = self.cell.map(|coordinate| coordinate as u32);
        mixed(mixed(mixed(x) ^ y) ^ z).wrapping_add(self.level.wrapping_mul(0x9e37_79b9)) as usize & (buckets - 1)
    }
}

/// The levels that there are of all these, in order.
///
/// # Errors
/// `OutOfMemory`.
pub fn present(levels: impl Iterator<Item = u32>) -> Result<Vec<u32>> {
    let mut is_present = [false; MOST as usize + 1];
    levels.for_each(|level| is_present[level as usize] = true);
    let mut found = memory::with_capacity(is_present.len())?;
    found.extend((0..=MOST).filter(|level| is_present[*level as usize]));
    Ok(found)
}
