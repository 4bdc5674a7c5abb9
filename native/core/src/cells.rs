//! Balls in the cells of grids, one for each octave of reach, so that those which may touch are found in neighbouring cells
//! whatever their sizes are. Cells are sorted by their places: neighbours along z follow one another.

use std::ops::Range;

use rayon::prelude::*;

use crate::error::Result;
use crate::job::Job;
use crate::memory;
use crate::simd::{LANES, Mask, Path, Simd, Task, Vector};

/// The exponents of floats.
const OCTAVES: usize = 256;

/// Cells along an axis at most: three such numbers are one of 63 bits. Balls farther off the most of the others than that lie
/// in the outermost cells, of which there are then more pairs than there need be.
const MOST_ALONG: f64 = (1 << 21) as f64;

/// Cells are so much wider than the balls of their grid, as a share: rounding then cannot bring two that touch farther apart.
const MARGIN: f64 = 1e-6;

/// Balls that are looked at to find where most of them are.
const SAMPLES: usize = 4096;

/// Entries, and balls, that a thread takes at a time.
const STRETCH: usize = 1 << 13;

/// Cells that a thread takes at a time.
const PART: usize = 256;

/// Entries are parted by this many leading bits of their keys before they are sorted.
const SORT_BITS: u32 = 11;

/// As many entries are sorted at once.
const FEW: usize = 1 << 10;

/// Entries of one cell or of several that follow one another.
pub(crate) type Entries = Range<usize>;

/// Where an entry lies: the number of its cell in the grid, and its ball.
type Entry = (u64, u32);

/// Steps to neighbouring cells: along x and y, and the first and the last along z.
type Rod = [i64; 4];

/// Where the neighbours of a cell lie that come after it, so that every two neighbours meet once.
const RODS_AFTER: [Rod; 5] = [[0, 0, 1, 1], [0, 1, -1, 1], [1, -1, -1, 1], [1, 0, -1, 1], [1, 1, -1, 1]];

/// How many rods are around a cell.
pub(crate) const AROUND: usize = 9;

/// Where the cell and its neighbours lie.
const RODS: [Rod; AROUND] = [
    [-1, -1, -1, 1],
    [-1, 0, -1, 1],
    [-1, 1, -1, 1],
    [0, -1, -1, 1],
    [0, 0, -1, 1],
    [0, 1, -1, 1],
    [1, -1, -1, 1],
    [1, 0, -1, 1],
    [1, 1, -1, 1],
];

/// What is known of the balls whose reaches have the same exponent.
#[derive(Clone, Copy, Debug)]
struct Octave {
    count: usize,
    greatest_reach: f32,
    low: [f32; 3],
    high: [f32; 3],
}

impl Octave {
    const EMPTY: Self = Self { count: 0, greatest_reach: 0.0, low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    fn joined(&self, other: &Self) -> Self {
        Self {
            count: self.count + other.count,
            greatest_reach: self.greatest_reach.max(other.greatest_reach),
            low: std::array::from_fn(|axis| self.low[axis].min(other.low[axis])),
            high: std::array::from_fn(|axis| self.high[axis].max(other.high[axis])),
        }
    }
}

/// A grid; any two of its balls that touch are in the same cell or in neighbours.
#[derive(Clone, Debug)]
struct Level {
    side: f64,
    greatest_reach: f64,
    /// Where the first cells lie, in cells.
    corner: [f64; 3],
    /// Cells along the axes; the outermost are empty, so that all others have neighbours.
    along: [u64; 3],
    entries: Entries,
    cells: Range<usize>,
}

impl Level {
    /// The cell of a point, or the nearest one: where two are no neighbours, nor are the points.
    #[inline(always)]
    fn place(&self, point: [f64; 3]) -> [u64; 3] {
        std::array::from_fn(|axis| {
            let place = (point[axis] / self.side).floor() - self.corner[axis];
            place.clamp(1.0, (self.along[axis] - 2) as f64) as u64
        })
    }

    /// The number of a cell.
    #[inline(always)]
    fn key(&self, [x, y, z]: [u64; 3]) -> u64 {
        (x * self.along[1] + y) * self.along[2] + z
    }

    /// The cell of a number.
    fn place_of_key(&self, key: u64) -> [u64; 3] {
        let rod = key / self.along[2];
        [rod / self.along[1], rod % self.along[1], key % self.along[2]]
    }

    /// The numbers of the first and the last cell of a rod.
    #[inline(always)]
    fn rod(&self, key: u64, [x, y, first, last]: Rod) -> [u64; 2] {
        let step = (x * self.along[1] as i64 + y) * self.along[2] as i64;
        [first, last].map(|z| key.wrapping_add_signed(step + z))
    }
}

/// Cells of one grid, for one thread.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    level: usize,
    cells: Range<usize>,
}

/// All balls that reach anywhere, in the order of the cells: the grids from small balls to large ones.
#[derive(Debug)]
pub(crate) struct Cells {
    levels: Vec<Level>,
    /// Of the cells.
    keys: Vec<u64>,
    /// The first entry of each cell, and the end.
    starts: Vec<u32>,
    /// Of the entries.
    balls: Vec<u32>,
    /// x, y, z and reach of the entries, and room for a vector behind them.
    columns: [Vec<f32>; 4],
    pub(crate) path: Path,
}

impl Cells {
    /// Puts the balls with a reach above 0 into cells.
    ///
    /// # Errors
    /// `OutOfMemory`; `InvalidInput` where the environment asks for a SIMD path that is not there.
    pub(crate) fn new(centers: &[[f32; 3]], reaches: &[f32]) -> Result<Self> {
        let mut levels = levels_of(centers, reaches);
        let entries = sorted(&levels, centers, reaches)?;
        let (mut keys, mut starts) = (Vec::new(), Vec::new());
        for level in &mut levels {
            let begin = keys.len();
            for (index, (key, _)) in entries[level.entries.clone()].iter().enumerate() {
                if keys.len() == begin || keys.last() != Some(key) {
                    memory::reserve(&mut keys, 1)?;
                    memory::reserve(&mut starts, 2)?;
                    keys.push(*key);
                    starts.push((level.entries.start + index) as u32);
                }
            }
            level.cells = begin..keys.len();
        }
        memory::reserve(&mut starts, 1)?;
        starts.push(entries.len() as u32);
        let mut balls = memory::filled(0, entries.len())?;
        balls.par_iter_mut().zip(&entries).with_min_len(STRETCH).for_each(|(ball, entry)| *ball = entry.1);
        let mut columns = [(); 4].map(|()| Vec::new());
        for (axis, column) in columns.iter_mut().enumerate() {
            *column = memory::filled(0.0, entries.len() + LANES)?;
            column.par_iter_mut().zip(&balls).with_min_len(STRETCH).for_each(|(number, ball)| {
                let ball = *ball as usize;
                *number = if axis < 3 { centers[ball][axis] } else { reaches[ball] };
            });
        }
        Ok(Self { levels, keys, starts, balls, columns, path: Path::chosen()? })
    }

    /// Of the entries.
    pub(crate) fn balls(&self) -> &[u32] {
        &self.balls
    }

    /// Whether balls of a grid may touch those of another one.
    pub(crate) fn has_levels(&self) -> bool {
        self.levels.len() > 1
    }

    /// All cells, in parts.
    pub(crate) fn parts(&self) -> Vec<Part> {
        let of_level = |(level, grid): (usize, &Level)| {
            let cells = grid.cells.clone();
            cells.clone().step_by(PART).map(move |begin| Part { level, cells: begin..(begin + PART).min(cells.end) })
        };
        self.levels.iter().enumerate().flat_map(of_level).collect()
    }

    /// Visits each pair of balls of a cell that touch, in any order, on all threads. Whole cells are left out where `skips` says
    /// so of their numbers.
    ///
    /// # Errors
    /// `Cancelled`.
    pub(crate) fn for_pairs_within(
        &self,
        job: &Job,
        skips: impl Fn(usize, usize) -> bool + Sync,
        visit: impl Fn(usize, usize) + Sync,
    ) -> Result<()> {
        self.for_parts(job, |part| self.path.dispatch(WithinTask(PairsTask { all: self, part, skips: &skips, visit: &visit })))
    }

    /// Visits each pair of balls of different cells that touch at least once, in any order, on all threads. Pairs of cells are
    /// left out where `skips` says so, and left where it says so after pairs of them were visited.
    ///
    /// # Errors
    /// `Cancelled`.
    pub(crate) fn for_pairs_between(
        &self,
        job: &Job,
        skips: impl Fn(usize, usize) -> bool + Sync,
        visit: impl Fn(usize, usize) + Sync,
    ) -> Result<()> {
        self.for_parts(job, |part| self.path.dispatch(BetweenTask(PairsTask { all: self, part, skips: &skips, visit: &visit })))
    }

    fn for_parts(&self, job: &Job, work: impl Fn(Part) + Sync) -> Result<()> {
        let parts = self.parts();
        job.expect(parts.len());
        parts.into_par_iter().try_for_each(|part| {
            work(part);
            job.advance(1)
        })
    }

    /// Those of a part.
    pub(crate) fn cells_of(part: &Part) -> Range<usize> {
        part.cells.clone()
    }

    /// The entries of a cell.
    #[inline(always)]
    pub(crate) fn entries_of(&self, cell: usize) -> Entries {
        self.entries(cell..cell + 1)
    }

    /// The entries of the same grid that may touch those of a part's cell, themselves among them. `begins`: zeros at first, for all
    /// cells of a part in their order.
    #[inline(always)]
    pub(crate) fn around(&self, part: &Part, cell: usize, begins: &mut [usize; AROUND]) -> [Entries; AROUND] {
        self.rods(part.level, cell, &RODS, begins).map(|cells| self.entries(cells))
    }

    /// How many coarser grids there are than that of a part.
    #[inline(always)]
    pub(crate) fn coarser(&self, part: &Part) -> Range<usize> {
        part.level + 1..self.levels.len()
    }

    /// The entries of a coarser grid that may touch an entry.
    #[inline(always)]
    pub(crate) fn around_in(&self, level: usize, entry: usize) -> [Entries; AROUND] {
        let level = &self.levels[level];
        let center = [0, 1, 2].map(|axis| f64::from(self.columns[axis][entry]));
        let key = level.key(level.place(center));
        RODS.map(|rod| self.entries(self.cells_between(level, level.rod(key, rod))))
    }

    /// The centre of an entry and its reach, in all lanes.
    #[inline(always)]
    pub(crate) fn sphere<S: Simd>(&self, simd: S, entry: usize) -> [S::Vector; 4] {
        let [x, y, z, reach] = &self.columns;
        [simd.splat(x[entry]), simd.splat(y[entry]), simd.splat(z[entry]), simd.splat(reach[entry])]
    }

    /// The squares of the distances of sixteen entries from a sphere's centre, and of both reaches; numbers behind the last entry
    /// say nothing.
    #[inline(always)]
    pub(crate) fn distances<S: Simd>(&self, simd: S, [x, y, z, reach]: [S::Vector; 4], begin: usize) -> [S::Vector; 2] {
        let [xs, ys, zs, reaches] = &self.columns;
        let (x, y, z) = (x - chunk(simd, xs, begin), y - chunk(simd, ys, begin), z - chunk(simd, zs, begin));
        let reach = reach + chunk(simd, reaches, begin);
        [x.mul_add(x, y.mul_add(y, z * z)), reach * reach]
    }

    /// The number that all balls of a cell have, none where they have several; for all cells.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub(crate) fn common(&self, number: impl Fn(usize) -> u32 + Sync) -> Result<Vec<Option<u32>>> {
        let mut common = memory::filled(None, self.keys.len())?;
        common.par_iter_mut().enumerate().with_min_len(PART).for_each(|(cell, common)| {
            let balls = &self.balls[self.entries_of(cell)];
            let first = number(balls[0] as usize);
            *common = balls.iter().all(|ball| number(*ball as usize) == first).then_some(first);
        });
        Ok(common)
    }

    /// Visits the balls that may touch a box.
    pub(crate) fn for_near(&self, low: [f64; 3], high: [f64; 3], mut visit: impl FnMut(usize)) {
        for level in &self.levels {
            let low = level.place(low.map(|coordinate| coordinate - level.greatest_reach));
            let high = level.place(high.map(|coordinate| coordinate + level.greatest_reach));
            let [columns, rows] = [0, 1].map(|axis| high[axis] - low[axis] + 1);
            if columns * rows > level.cells.len() as u64 {
                let is_within = |place: [u64; 3]| (0..3).all(|axis| (low[axis]..=high[axis]).contains(&place[axis]));
                for cell in level.cells.clone().filter(|cell| is_within(level.place_of_key(self.keys[*cell]))) {
                    self.balls[self.entries_of(cell)].iter().for_each(|ball| visit(*ball as usize));
                }
                continue;
            }
            for (x, y) in (low[0]..=high[0]).flat_map(|x| (low[1]..=high[1]).map(move |y| (x, y))) {
                let cells = self.cells_between(level, [low[2], high[2]].map(|z| level.key([x, y, z])));
                self.balls[self.entries(cells)].iter().for_each(|ball| visit(*ball as usize));
            }
        }
    }

    /// The cells of a grid from one number to another.
    fn cells_between(&self, level: &Level, [low, high]: [u64; 2]) -> Range<usize> {
        let keys = &self.keys[level.cells.clone()];
        let begin = keys.partition_point(|key| *key < low);
        let end = begin + keys[begin..].iter().take_while(|key| **key <= high).count();
        level.cells.start + begin..level.cells.start + end
    }

    /// The cells in some rods beside a cell. `begins`: where those of a cell before began, 0 at first.
    #[inline(always)]
    fn rods<const COUNT: usize>(
        &self,
        level: usize,
        cell: usize,
        rods: &[Rod; COUNT],
        begins: &mut [usize; COUNT],
    ) -> [Range<usize>; COUNT] {
        let level = &self.levels[level];
        let keys = &self.keys[..level.cells.end];
        std::array::from_fn(|index| {
            let begin = &mut begins[index];
            let [low, high] = level.rod(keys[cell], rods[index]);
            if *begin < level.cells.start || *begin == 0 {
                *begin = level.cells.start + keys[level.cells.start..].partition_point(|key| *key < low);
            }
            while *begin < keys.len() && keys[*begin] < low {
                *begin += 1;
            }
            let mut end = *begin;
            while end < keys.len() && keys[end] <= high {
                end += 1;
            }
            *begin..end
        })
    }

    #[inline(always)]
    fn entries(&self, cells: Range<usize>) -> Entries {
        self.starts[cells.start] as usize..self.starts[cells.end] as usize
    }
}

/// Visits the pairs of some cells' balls.
struct PairsTask<'a, K, V> {
    all: &'a Cells,
    part: Part,
    skips: &'a K,
    visit: &'a V,
}

/// Those within cells.
struct WithinTask<'a, K, V>(PairsTask<'a, K, V>);

impl<K: Fn(usize, usize) -> bool, V: Fn(usize, usize)> Task for WithinTask<'_, K, V> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for cell in self.0.part.cells.clone() {
            self.0.pairs_within(simd, cell);
        }
    }
}

/// Those between cells.
struct BetweenTask<'a, K, V>(PairsTask<'a, K, V>);

impl<K: Fn(usize, usize) -> bool, V: Fn(usize, usize)> Task for BetweenTask<'_, K, V> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let (task, mut begins) = (self.0, [0; RODS_AFTER.len()]);
        for cell in task.part.cells.clone() {
            let is_full = task.all.entries_of(cell).len() >= LANES / 2;
            for others in task.all.rods(task.part.level, cell, &RODS_AFTER, &mut begins) {
                if is_full {
                    task.pairs_by_cells(simd, cell, others);
                } else {
                    task.pairs_by_rods(simd, cell, others);
                }
            }
            task.pairs_with_larger(simd, cell);
        }
    }
}

impl<K: Fn(usize, usize) -> bool, V: Fn(usize, usize)> PairsTask<'_, K, V> {
    #[inline(always)]
    fn pairs_within<S: Simd>(&self, simd: S, cell: usize) {
        if (self.skips)(cell, cell) {
            return;
        }
        let entries = self.all.entries_of(cell);
        for entry in entries.clone() {
            self.touching(simd, entry, entry + 1..entries.end);
        }
    }

    /// Pairs with balls of coarser grids.
    #[inline(always)]
    fn pairs_with_larger<S: Simd>(&self, simd: S, cell: usize) {
        for level in &self.all.levels[self.part.level + 1..] {
            for entry in self.all.entries_of(cell) {
                let center = [0, 1, 2].map(|axis| f64::from(self.all.columns[axis][entry]));
                let key = level.key(level.place(center));
                for rod in RODS {
                    for other in self.all.cells_between(level, level.rod(key, rod)) {
                        if !(self.skips)(cell, other) {
                            self.touching(simd, entry, self.all.entries_of(other));
                        }
                    }
                }
            }
        }
    }

    /// Pairs of a cell's balls with those of others, cell by cell: no more than are needed until the others are left.
    #[inline(always)]
    fn pairs_by_cells<S: Simd>(&self, simd: S, cell: usize, others: Range<usize>) {
        for other in others {
            for entry in self.all.entries_of(cell) {
                if (self.skips)(cell, other) {
                    break;
                }
                self.touching(simd, entry, self.all.entries_of(other));
            }
        }
    }

    /// Pairs of a cell's balls with those of others that follow one another, as vectors are fuller then.
    #[inline(always)]
    fn pairs_by_rods<S: Simd>(&self, simd: S, cell: usize, others: Range<usize>) {
        let mut begin = others.start;
        while begin < others.end {
            let mut end = begin;
            while end < others.end && !(self.skips)(cell, end) {
                end += 1;
            }
            if begin < end {
                for entry in self.all.entries_of(cell) {
                    self.touching(simd, entry, self.all.entries(begin..end));
                }
            }
            begin = end + 1;
        }
    }

    #[inline(always)]
    fn touching<S: Simd>(&self, simd: S, entry: usize, others: Entries) {
        let sphere = self.all.sphere(simd, entry);
        let mut begin = others.start;
        while begin < others.end {
            let [distance_2, reach_2] = self.all.distances(simd, sphere, begin);
            let mut bits = first_bits(distance_2.lt(reach_2).bits(), others.end - begin);
            while bits != 0 {
                let other = begin + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                (self.visit)(self.all.balls[entry] as usize, self.all.balls[other] as usize);
            }
            begin += LANES;
        }
    }
}

/// The first so many bits.
#[inline(always)]
pub(crate) fn first_bits(bits: u16, count: usize) -> u16 {
    if count < LANES { bits & ((1 << count) - 1) } else { bits }
}

#[inline(always)]
fn chunk<S: Simd>(simd: S, column: &[f32], at: usize) -> S::Vector {
    simd.load_unaligned(column[at..].first_chunk().expect("there is room for a vector behind every entry"))
}

/// A grid for each octave of reach that there is, from small to large.
fn levels_of(centers: &[[f32; 3]], reaches: &[f32]) -> Vec<Level> {
    let parts = reaches.par_chunks(STRETCH).zip(centers.par_chunks(STRETCH)).map(|(reaches, centers)| {
        let mut octaves = [Octave::EMPTY; OCTAVES];
        for (reach, center) in reaches.iter().zip(centers).filter(|(reach, _)| **reach > 0.0) {
            let octave = &mut octaves[octave_of(*reach)];
            *octave = octave.joined(&Octave { count: 1, greatest_reach: *reach, low: *center, high: *center });
        }
        octaves
    });
    let join = |one: [Octave; OCTAVES], other: [Octave; OCTAVES]| std::array::from_fn(|index| one[index].joined(&other[index]));
    let octaves = parts.reduce(|| [Octave::EMPTY; OCTAVES], join);
    let mut levels: Vec<Level> = Vec::new();
    for (exponent, octave) in octaves.iter().enumerate().filter(|(_, octave)| octave.count > 0) {
        let side = 2.0 * (1.0 + MARGIN) * f64::from(octave.greatest_reach);
        let place = |coordinate: f32| (f64::from(coordinate) / side).floor();
        let (low, high) = (octave.low.map(place), octave.high.map(place));
        let mut corner = low.map(|place| place - 1.0);
        let mut along: [f64; 3] = std::array::from_fn(|axis| high[axis] - low[axis] + 3.0);
        for axis in 0..3 {
            if along[axis] <= MOST_ALONG {
                continue;
            }
            corner[axis] = place(median(centers, reaches, exponent, axis)) - 0.5 * MOST_ALONG;
            along[axis] = MOST_ALONG;
        }
        let begin = levels.last().map_or(0, |level| level.entries.end);
        levels.push(Level {
            side,
            greatest_reach: f64::from(octave.greatest_reach),
            corner,
            along: along.map(|count| count as u64),
            entries: begin..begin + octave.count,
            cells: 0..0,
        });
    }
    levels
}

/// About the median of a coordinate among the balls of an octave.
fn median(centers: &[[f32; 3]], reaches: &[f32], octave: usize, axis: usize) -> f32 {
    let of_octave = (0..reaches.len()).filter(|ball| reaches[*ball] > 0.0 && octave_of(reaches[*ball]) == octave);
    let step = 1 + reaches.len() / SAMPLES;
    let mut sample: Vec<f32> = of_octave.clone().step_by(step).take(SAMPLES).map(|ball| centers[ball][axis]).collect();
    sample.sort_unstable_by(f32::total_cmp);
    sample[sample.len() / 2]
}

/// The exponent of a positive float; those too small to have one of their own share the least.
#[inline(always)]
fn octave_of(reach: f32) -> usize {
    (reach.to_bits() >> 23) as usize
}

/// The balls with a reach, in the order of their cells, grid by grid.
fn sorted(levels: &[Level], centers: &[[f32; 3]], reaches: &[f32]) -> Result<Vec<Entry>> {
    let count = levels.last().map_or(0, |level| level.entries.end);
    let mut entries: Vec<Entry> = memory::filled((0, 0), count)?;
    let entry_of = |level: &Level, ball: usize| (level.key(level.place(centers[ball].map(f64::from))), ball as u32);
    if let ([level], true) = (levels, count == reaches.len()) {
        entries.par_iter_mut().enumerate().with_min_len(STRETCH).for_each(|(ball, entry)| *entry = entry_of(level, ball));
    } else {
        let mut level_of = [0; OCTAVES];
        levels.iter().enumerate().for_each(|(index, level)| level_of[octave_of(level.greatest_reach as f32)] = index);
        let mut ends: Vec<usize> = levels.iter().map(|level| level.entries.start).collect();
        for ball in (0..reaches.len()).filter(|ball| reaches[*ball] > 0.0) {
            let level = level_of[octave_of(reaches[ball])];
            entries[ends[level]] = entry_of(&levels[level], ball);
            ends[level] += 1;
        }
    }
    if entries.len() <= FEW {
        levels.iter().for_each(|level| entries[level.entries.clone()].sort_unstable());
        return Ok(entries);
    }
    let mut sorted = memory::filled((0, 0), count)?;
    for level in levels {
        let most = level.key(level.along.map(|count| count - 1));
        sort(&entries[level.entries.clone()], &mut sorted[level.entries.clone()], most);
    }
    Ok(sorted)
}

/// Sorts entries whose keys are not above `most`: parts them by the leading bits, then sorts each part.
fn sort(entries: &[Entry], sorted: &mut [Entry], most: u64) {
    let shift = (u64::BITS - most.leading_zeros()).saturating_sub(SORT_BITS);
    let mut ends = [0usize; 1 << SORT_BITS];
    entries.iter().for_each(|(key, _)| ends[(key >> shift) as usize] += 1);
    let counts = ends;
    let mut begin = 0;
    for end in &mut ends {
        begin += std::mem::replace(end, begin);
    }
    for entry in entries {
        let end = &mut ends[(entry.0 >> shift) as usize];
        sorted[*end] = *entry;
        *end += 1;
    }
    let mut rest = sorted;
    let mut parts: Vec<&mut [Entry]> = Vec::with_capacity(counts.len());
    for count in counts {
        let (part, behind) = rest.split_at_mut(count);
        parts.push(part);
        rest = behind;
    }
    parts
        .into_par_iter()
        .with_min_len(16)
        .for_each(|part| if part.len() > STRETCH { part.par_sort_unstable() } else { part.sort_unstable() });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Balls that are far from most others, and from one another, beyond the grid's numbers.
    #[test]
    #[cfg_attr(miri, ignore = "too slow")]
    fn no_pair_is_lost_beyond_the_grid() {
        let mut state = 5u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        let places = [0.0, 0.0, 0.0, 1e7, -3e8, 2e19];
        let mut centers = Vec::new();
        for _ in 0..500 {
            let place = places[(random() * 6.0) as usize];
            centers.push([0, 1, 2].map(|axis| if axis == 1 { place } else { 0.0 } + 40.0 * (random() - 0.5)));
        }
        let reaches: Vec<f32> = centers.iter().map(|_| if random() < 0.5 { 1.0 } else { 7.0 }).collect();
        let cells = Cells::new(&centers, &reaches).expect("cells");
        let found = std::sync::Mutex::new(std::collections::BTreeSet::new());
        let note = |one: usize, other: usize| {
            found.lock().expect("no panic").insert((one.min(other), one.max(other)));
        };
        cells.for_pairs_within(&Job::default(), |_, _| false, note).expect("pairs");
        cells.for_pairs_between(&Job::default(), |_, _| false, note).expect("pairs");
        let touch = |one: usize, other: usize| {
            let square = |axis: usize| (f64::from(centers[one][axis]) - f64::from(centers[other][axis])).powi(2);
            (square(0) + square(1) + square(2)).sqrt() < f64::from(reaches[one] + reaches[other])
        };
        let expected: Vec<_> =
            (0..500).flat_map(|one| (one + 1..500).map(move |other| (one, other))).filter(|(a, b)| touch(*a, *b)).collect();
        assert!(expected.len() > 1000);
        let found = found.into_inner().expect("no panic");
        // Within the rounding of a float both are right.
        let lost: Vec<_> = expected.iter().filter(|pair| !found.contains(pair)).collect();
        assert!(lost.len() <= expected.len() / 1000, "{lost:?}");
        assert!(found.len() <= expected.len() + expected.len() / 1000);
    }
}
