//! Balls in the cells of grids, one for each octave of reach, so that those which may touch are found in neighbouring cells
//! whatever their sizes are. Cells are sorted by their places: neighbours along z follow one another.

use std::ops::Range;

use rayon::prelude::*;

use crate::error::Result;
use crate::job::Job;
use crate::memory;
use crate::simd::{LANES, Mask, Path, Simd, Task, Vector};

/// Where the neighbours of a cell lie that come after it: steps along x and y, and the first and the last along z. So every two
/// neighbours meet once.
const RODS: [[f64; 4]; 5] =
    [[0.0, 0.0, 1.0, 1.0], [0.0, 1.0, -1.0, 1.0], [1.0, -1.0, -1.0, 1.0], [1.0, 0.0, -1.0, 1.0], [1.0, 1.0, -1.0, 1.0]];

/// Cells that a thread takes at a time.
const PART: usize = 256;

/// A grid; any two of its balls that touch are in the same cell or in neighbours.
#[derive(Clone, Debug)]
struct Level {
    side: f64,
    greatest_reach: f64,
    cells: Range<usize>,
}

impl Level {
    /// The cell of a point. Where coordinates are beyond what whole numbers a float has, neighbours are the cell itself.
    fn place(&self, point: [f64; 3]) -> [f64; 3] {
        point.map(|coordinate| (coordinate / self.side).floor())
    }
}

/// The order of cells: grid and place.
type Key = (u32, [u64; 3]);

/// All balls that reach anywhere.
#[derive(Debug)]
pub struct Cells {
    levels: Vec<Level>,
    /// Of the cells.
    keys: Vec<Key>,
    places: Vec<[f64; 3]>,
    /// The first entry of each cell, and the end.
    starts: Vec<usize>,
    balls: Vec<u32>,
    /// x, y, z and reach of the entries, and room for a vector behind them.
    columns: [Vec<f32>; 4],
    path: Path,
}

impl Cells {
    /// Puts the balls with a reach above 0 into cells.
    ///
    /// # Errors
    /// `OutOfMemory`; `InvalidInput` where the environment asks for a SIMD path that is not there.
    pub fn new(centers: &[[f32; 3]], reaches: &[f32]) -> Result<Self> {
        let levels = levels_of(reaches);
        let entries = sorted(&levels, centers, reaches)?;
        let mut cells = Self {
            levels,
            keys: Vec::new(),
            places: Vec::new(),
            starts: Vec::new(),
            balls: memory::with_capacity(entries.len())?,
            columns: [(); 4].map(|()| Vec::new()),
            path: Path::chosen()?,
        };
        for column in &mut cells.columns {
            memory::reserve(column, entries.len() + LANES)?;
        }
        for (index, (key, ball)) in entries.iter().enumerate() {
            let center = centers[*ball as usize];
            if cells.keys.last() != Some(key) {
                memory::reserve(&mut cells.keys, 1)?;
                memory::reserve(&mut cells.places, 1)?;
                memory::reserve(&mut cells.starts, 2)?;
                cells.keys.push(*key);
                cells.places.push(cells.levels[key.0 as usize].place(center.map(f64::from)));
                cells.starts.push(index);
            }
            cells.balls.push(*ball);
            let [x, y, z] = center;
            for (column, number) in cells.columns.iter_mut().zip([x, y, z, reaches[*ball as usize]]) {
                column.push(number);
            }
        }
        memory::reserve(&mut cells.starts, 1)?;
        cells.starts.push(entries.len());
        for column in &mut cells.columns {
            column.resize(entries.len() + LANES, 0.0);
        }
        for (number, level) in cells.levels.iter_mut().enumerate() {
            let number = number as u32;
            level.cells = cells.keys.partition_point(|key| key.0 < number)..cells.keys.partition_point(|key| key.0 <= number);
        }
        Ok(cells)
    }

    /// Visits each pair of balls that touch at least once, in any order, on all threads. Whole cells are left out where `skips`
    /// says so of their numbers.
    ///
    /// # Errors
    /// `Cancelled`.
    pub fn for_pairs(
        &self,
        job: &Job,
        skips: impl Fn(usize, usize) -> bool + Sync,
        visit: impl Fn(usize, usize) + Sync,
    ) -> Result<()> {
        let parts = self.keys.len().div_ceil(PART);
        job.expect(parts);
        (0..parts).into_par_iter().try_for_each(|part| {
            let cells = part * PART..((part + 1) * PART).min(self.keys.len());
            self.path.dispatch(PairsTask { all: self, cells, skips: &skips, visit: &visit });
            job.advance(1)
        })
    }

    /// The number that all balls of a cell have, none where they have several; for all cells.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn common(&self, number: impl Fn(usize) -> u32 + Sync) -> Result<Vec<Option<u32>>> {
        let mut common = memory::filled(None, self.keys.len())?;
        common.par_iter_mut().enumerate().for_each(|(cell, common)| {
            let balls = &self.balls[self.entries(cell..cell + 1)];
            let first = number(balls[0] as usize);
            *common = balls.iter().all(|ball| number(*ball as usize) == first).then_some(first);
        });
        Ok(common)
    }

    /// Visits the balls that may touch a box.
    pub fn for_near(&self, low: [f64; 3], high: [f64; 3], mut visit: impl FnMut(usize)) {
        for (number, level) in self.levels.iter().enumerate() {
            let low = level.place(low.map(|coordinate| coordinate - level.greatest_reach));
            let high = level.place(high.map(|coordinate| coordinate + level.greatest_reach));
            let [columns, rows] = [0, 1].map(|axis| high[axis] - low[axis] + 1.0);
            if columns * rows > level.cells.len() as f64 {
                let is_within = |place: &[f64; 3]| (0..3).all(|axis| low[axis] <= place[axis] && place[axis] <= high[axis]);
                for cell in level.cells.clone().filter(|cell| is_within(&self.places[*cell])) {
                    self.balls[self.entries(cell..cell + 1)].iter().for_each(|ball| visit(*ball as usize));
                }
                continue;
            }
            for row in 0..(columns * rows) as u64 {
                let (x, y) = (low[0] + (row as f64 / rows).floor(), low[1] + row as f64 % rows);
                let cells = self.rod(number as u32, [x, y, low[2]], high[2]);
                self.balls[self.entries(cells)].iter().for_each(|ball| visit(*ball as usize));
            }
        }
    }

    /// The cells of a grid from a place along z.
    fn rod(&self, level: u32, first: [f64; 3], last_z: f64) -> Range<usize> {
        let [x, y, _] = first;
        let (low, high) = (key(level, first), key(level, [x, y, last_z]));
        let begin = self.keys.partition_point(|key| *key < low);
        begin..begin + self.keys[begin..].partition_point(|key| *key <= high)
    }

    fn entries(&self, cells: Range<usize>) -> Range<usize> {
        self.starts[cells.start]..self.starts[cells.end]
    }
}

/// Visits the pairs of some cells' balls.
struct PairsTask<'a, K, V> {
    all: &'a Cells,
    cells: Range<usize>,
    skips: &'a K,
    visit: &'a V,
}

impl<K: Fn(usize, usize) -> bool, V: Fn(usize, usize)> Task for PairsTask<'_, K, V> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        // Where the neighbours of the cell before began: those of the next do not begin earlier.
        let mut begins = [0; RODS.len()];
        for cell in self.cells.clone() {
            self.pairs_within(simd, cell);
            self.pairs_with_neighbors(simd, cell, &mut begins);
            self.pairs_with_larger(simd, cell);
        }
    }
}

impl<K: Fn(usize, usize) -> bool, V: Fn(usize, usize)> PairsTask<'_, K, V> {
    #[inline(always)]
    fn pairs_within<S: Simd>(&self, simd: S, cell: usize) {
        if (self.skips)(cell, cell) {
            return;
        }
        let entries = self.all.entries(cell..cell + 1);
        for entry in entries.clone() {
            self.touching(simd, entry, entry + 1..entries.end);
        }
    }

    #[inline(always)]
    fn pairs_with_neighbors<S: Simd>(&self, simd: S, cell: usize, begins: &mut [usize; RODS.len()]) {
        let (keys, (level, _), [x, y, z]) = (&self.all.keys, self.all.keys[cell], self.all.places[cell]);
        for ([right, back, first, last], begin) in RODS.into_iter().zip(begins) {
            let (low, high) = (key(level, [x + right, y + back, z + first]), key(level, [x + right, y + back, z + last]));
            if *begin == 0 {
                *begin = keys.partition_point(|key| *key < low);
            }
            while *begin < keys.len() && keys[*begin] < low {
                *begin += 1;
            }
            let mut end = *begin;
            while end < keys.len() && keys[end] <= high {
                end += 1;
            }
            self.pairs_between(simd, cell, *begin..end);
        }
    }

    /// Pairs with balls of coarser grids.
    #[inline(always)]
    fn pairs_with_larger<S: Simd>(&self, simd: S, cell: usize) {
        let (level, _) = self.all.keys[cell];
        for other in level as usize + 1..self.all.levels.len() {
            for entry in self.all.entries(cell..cell + 1) {
                let center = [0, 1, 2].map(|axis| f64::from(self.all.columns[axis][entry]));
                let [x, y, z] = self.all.levels[other].place(center);
                for rod in 0..9 {
                    let place = [x + f64::from(rod / 3) - 1.0, y + f64::from(rod % 3) - 1.0, z - 1.0];
                    let others = self.all.rod(other as u32, place, z + 1.0);
                    for other in others.filter(|other| !(self.skips)(cell, *other)) {
                        self.touching(simd, entry, self.all.entries(other..other + 1));
                    }
                }
            }
        }
    }

    /// Pairs of a cell's balls with those of others that follow one another.
    #[inline(always)]
    fn pairs_between<S: Simd>(&self, simd: S, cell: usize, others: Range<usize>) {
        let mut begin = others.start;
        while begin < others.end {
            let mut end = begin;
            while end < others.end && !(self.skips)(cell, end) {
                end += 1;
            }
            if begin < end {
                for entry in self.all.entries(cell..cell + 1) {
                    self.touching(simd, entry, self.all.entries(begin..end));
                }
            }
            begin = end + 1;
        }
    }

    #[inline(always)]
    fn touching<S: Simd>(&self, simd: S, entry: usize, others: Range<usize>) {
        let [xs, ys, zs, reaches] = &self.all.columns;
        let [x, y, z, reach] = [xs, ys, zs, reaches].map(|column| simd.splat(column[entry]));
        for begin in others.clone().step_by(LANES) {
            let (x, y, z) = (x - chunk(simd, xs, begin), y - chunk(simd, ys, begin), z - chunk(simd, zs, begin));
            let reach = reach + chunk(simd, reaches, begin);
            let mut bits = x.mul_add(x, y.mul_add(y, z * z)).lt(reach * reach).bits();
            let count = others.end - begin;
            if count < LANES {
                bits &= (1 << count) - 1;
            }
            while bits != 0 {
                let other = begin + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                (self.visit)(self.all.balls[entry] as usize, self.all.balls[other] as usize);
            }
        }
    }
}

#[inline(always)]
fn chunk<S: Simd>(simd: S, column: &[f32], at: usize) -> S::Vector {
    simd.load_unaligned(column[at..].first_chunk().expect("there is room for a vector behind every entry"))
}

/// Balls with a reach in the order of their cells.
fn sorted(levels: &[Level], centers: &[[f32; 3]], reaches: &[f32]) -> Result<Vec<(Key, u32)>> {
    let mut entries = memory::with_capacity(centers.len())?;
    entries.extend((0..centers.len()).filter(|ball| reaches[*ball] > 0.0).map(|ball| {
        let level = level_of(levels, reaches[ball]);
        (key(level as u32, levels[level].place(centers[ball].map(f64::from))), ball as u32)
    }));
    entries.par_sort_unstable();
    Ok(entries)
}

/// The octaves of reach that there are, each with its greatest, from small to large.
fn levels_of(reaches: &[f32]) -> Vec<Level> {
    let mut greatest: Vec<(i32, f32)> = Vec::new();
    for reach in reaches.iter().copied().filter(|reach| *reach > 0.0) {
        match greatest.iter_mut().find(|(octave, _)| *octave == octave_of(reach)) {
            Some((_, most)) => *most = most.max(reach),
            None => greatest.push((octave_of(reach), reach)),
        }
    }
    greatest.sort_unstable_by_key(|(octave, _)| *octave);
    let level = |(_, reach): (i32, f32)| Level { side: 2.0 * f64::from(reach), greatest_reach: f64::from(reach), cells: 0..0 };
    greatest.into_iter().map(level).collect()
}

/// The exponent of a positive float; those too small to have one of their own share the least.
fn octave_of(reach: f32) -> i32 {
    (reach.to_bits() >> 23) as i32
}

fn level_of(levels: &[Level], reach: f32) -> usize {
    levels.partition_point(|level| octave_of(level.greatest_reach as f32) < octave_of(reach))
}

fn key(level: u32, place: [f64; 3]) -> Key {
    (level, place.map(ordered))
}

/// A float as bits with the same order.
fn ordered(number: f64) -> u64 {
    // Zero has two signs.
    let bits = (number + 0.0).to_bits();
    if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
}
