//! Balls in the cells of grids, one for each octave of reach, so that those which may touch are found in neighbouring cells
//! whatever their sizes are.

use rayon::prelude::*;

use crate::error::Result;
use crate::job::Job;
use crate::memory;

/// Cells that follow a cell in each of its lines, so that every two neighbours meet once.
const FORWARD: [[f64; 3]; 13] = [
    [1.0, 0.0, 0.0],
    [-1.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, -1.0, 1.0],
    [0.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [-1.0, 0.0, 1.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [-1.0, 1.0, 1.0],
    [0.0, 1.0, 1.0],
    [1.0, 1.0, 1.0],
];

/// No cell.
const EMPTY: u32 = u32::MAX;

/// Cells that a thread takes at a time.
const PART: usize = 64;

/// A ball, and how far it reaches.
#[derive(Clone, Copy, Debug)]
struct Entry {
    center: [f32; 3],
    reach: f32,
    ball: u32,
}

/// A grid; any two of its balls that touch are in the same cell or in neighbours.
#[derive(Clone, Copy, Debug)]
struct Level {
    side: f64,
    greatest_reach: f64,
    /// Its cells.
    first: usize,
    end: usize,
}

impl Level {
    /// The cell of a point. Where coordinates are beyond what whole numbers a float has, neighbours are the cell itself.
    fn place(&self, point: [f64; 3]) -> [f64; 3] {
        point.map(|coordinate| (coordinate / self.side).floor())
    }
}

/// A cell: its grid and place, and its entries.
#[derive(Clone, Copy, Debug)]
struct Cell {
    level: u32,
    place: [f64; 3],
    first: usize,
    end: usize,
}

/// All balls that reach anywhere.
#[derive(Debug)]
pub struct Cells {
    levels: Vec<Level>,
    cells: Vec<Cell>,
    entries: Vec<Entry>,
    /// Numbers of cells by their hashes, as many as a power of two.
    table: Vec<u32>,
}

impl Cells {
    /// Puts the balls with a reach above 0 into cells.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn new(centers: &[[f32; 3]], reaches: &[f32]) -> Result<Self> {
        let mut levels = levels_of(reaches);
        let mut keyed = memory::with_capacity(centers.len())?;
        keyed.par_extend((0..centers.len()).into_par_iter().filter(|ball| reaches[*ball] > 0.0).map(|ball| {
            let level = level_of(&levels, reaches[ball]);
            let place = levels[level].place(centers[ball].map(f64::from));
            (level as u32, place.map(ordered), ball as u32)
        }));
        keyed.par_sort_unstable();
        let mut entries = memory::with_capacity(keyed.len())?;
        entries.extend(keyed.iter().map(|(_, _, ball)| Entry {
            center: centers[*ball as usize],
            reach: reaches[*ball as usize],
            ball: *ball,
        }));
        let mut cells: Vec<Cell> = Vec::new();
        for (index, (level, order, ball)) in keyed.iter().enumerate() {
            let is_next = index == 0 || (keyed[index - 1].0, keyed[index - 1].1) != (*level, *order);
            if is_next {
                memory::reserve(&mut cells, 1)?;
                let place = levels[*level as usize].place(centers[*ball as usize].map(f64::from));
                cells.push(Cell { level: *level, place, first: index, end: index });
            }
            if let Some(cell) = cells.last_mut() {
                cell.end = index + 1;
            }
        }
        for (number, level) in levels.iter_mut().enumerate() {
            level.first = cells.partition_point(|cell| (cell.level as usize) < number);
            level.end = cells.partition_point(|cell| (cell.level as usize) <= number);
        }
        let table = table_of(&cells)?;
        Ok(Self { levels, cells, entries, table })
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
        let parts = self.cells.len().div_ceil(PART);
        job.expect(parts);
        (0..parts).into_par_iter().try_for_each(|part| {
            for number in part * PART..((part + 1) * PART).min(self.cells.len()) {
                self.pairs_within(number, &skips, &visit);
                self.pairs_with_neighbors(number, &skips, &visit);
                self.pairs_with_larger(number, &skips, &visit);
            }
            job.advance(1)
        })
    }

    /// The number that all balls of a cell have, none where they have several; for all cells.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn common(&self, number: impl Fn(usize) -> u32 + Sync) -> Result<Vec<Option<u32>>> {
        let mut common = memory::filled(None, self.cells.len())?;
        common.par_iter_mut().zip(&self.cells).for_each(|(common, cell)| {
            let entries = &self.entries[cell.first..cell.end];
            let first = number(entries[0].ball as usize);
            *common = entries.iter().all(|entry| number(entry.ball as usize) == first).then_some(first);
        });
        Ok(common)
    }

    /// Visits the balls that may touch a box.
    pub fn for_near(&self, low: [f64; 3], high: [f64; 3], mut visit: impl FnMut(usize)) {
        for (number, level) in self.levels.iter().enumerate() {
            let low = level.place(low.map(|coordinate| coordinate - level.greatest_reach));
            let high = level.place(high.map(|coordinate| coordinate + level.greatest_reach));
            let spans: [f64; 3] = std::array::from_fn(|axis| high[axis] - low[axis] + 1.0);
            let is_within = |cell: &Cell| (0..3).all(|axis| low[axis] <= cell.place[axis] && cell.place[axis] <= high[axis]);
            if spans[0] * spans[1] * spans[2] > (level.end - level.first) as f64 {
                for cell in self.cells[level.first..level.end].iter().filter(|cell| is_within(cell)) {
                    self.visit_all(cell, &mut visit);
                }
                continue;
            }
            let [columns, rows, layers] = spans.map(|span| span as u32);
            for (layer, row, column) in grid(layers, rows, columns) {
                let place = [low[0] + f64::from(column), low[1] + f64::from(row), low[2] + f64::from(layer)];
                if let Some(cell) = self.cell_at(number as u32, place) {
                    self.visit_all(&self.cells[cell], &mut visit);
                }
            }
        }
    }

    fn visit_all(&self, cell: &Cell, visit: &mut impl FnMut(usize)) {
        for entry in &self.entries[cell.first..cell.end] {
            visit(entry.ball as usize);
        }
    }

    fn pairs_within(&self, number: usize, skips: &impl Fn(usize, usize) -> bool, visit: &impl Fn(usize, usize)) {
        if skips(number, number) {
            return;
        }
        let entries = &self.entries[self.cells[number].first..self.cells[number].end];
        for (index, entry) in entries.iter().enumerate() {
            touching(entry, &entries[index + 1..], visit);
        }
    }

    fn pairs_with_neighbors(&self, number: usize, skips: &impl Fn(usize, usize) -> bool, visit: &impl Fn(usize, usize)) {
        let cell = self.cells[number];
        for way in FORWARD {
            let place = std::array::from_fn(|axis| cell.place[axis] + way[axis]);
            if let Some(other) = self.cell_at(cell.level, place).filter(|other| !skips(number, *other)) {
                let others = &self.entries[self.cells[other].first..self.cells[other].end];
                for entry in &self.entries[cell.first..cell.end] {
                    touching(entry, others, visit);
                }
            }
        }
    }

    /// Pairs with balls of coarser grids.
    fn pairs_with_larger(&self, number: usize, skips: &impl Fn(usize, usize) -> bool, visit: &impl Fn(usize, usize)) {
        let cell = self.cells[number];
        for level in cell.level as usize + 1..self.levels.len() {
            for entry in &self.entries[cell.first..cell.end] {
                let middle = self.levels[level].place(entry.center.map(f64::from));
                for (layer, row, column) in grid(3, 3, 3) {
                    let way = [column, row, layer].map(|step| f64::from(step) - 1.0);
                    let place = std::array::from_fn(|axis| middle[axis] + way[axis]);
                    if let Some(other) = self.cell_at(level as u32, place).filter(|other| !skips(number, *other)) {
                        touching(entry, &self.entries[self.cells[other].first..self.cells[other].end], visit);
                    }
                }
            }
        }
    }

    fn cell_at(&self, level: u32, place: [f64; 3]) -> Option<usize> {
        let mut slot = hash(level, place) as usize & (self.table.len() - 1);
        loop {
            let number = self.table[slot];
            if number == EMPTY {
                return None;
            }
            let cell = &self.cells[number as usize];
            if cell.level == level && cell.place == place {
                return Some(number as usize);
            }
            slot = (slot + 1) & (self.table.len() - 1);
        }
    }
}

fn grid(layers: u32, rows: u32, columns: u32) -> impl Iterator<Item = (u32, u32, u32)> {
    (0..layers).flat_map(move |layer| (0..rows).flat_map(move |row| (0..columns).map(move |column| (layer, row, column))))
}

fn touching(entry: &Entry, others: &[Entry], visit: &impl Fn(usize, usize)) {
    for other in others {
        let [x, y, z] = [0, 1, 2].map(|axis| entry.center[axis] - other.center[axis]);
        let reach = entry.reach + other.reach;
        if x * x + y * y + z * z < reach * reach {
            visit(entry.ball as usize, other.ball as usize);
        }
    }
}

/// The octaves of reach that there are, each with its greatest, from small to large.
fn levels_of(reaches: &[f32]) -> Vec<Level> {
    let mut greatest = std::collections::BTreeMap::new();
    for reach in reaches.iter().copied().filter(|reach| *reach > 0.0) {
        let most = greatest.entry(octave(reach)).or_insert(reach);
        *most = most.max(reach);
    }
    let level = |reach: f32| Level { side: 2.0 * f64::from(reach), greatest_reach: f64::from(reach), first: 0, end: 0 };
    greatest.into_values().map(level).collect()
}

fn octave(reach: f32) -> i32 {
    reach.log2().floor() as i32
}

fn level_of(levels: &[Level], reach: f32) -> usize {
    levels.partition_point(|level| octave(level.greatest_reach as f32) < octave(reach))
}

/// A whole number in a float, as bits with the same order.
fn ordered(place: f64) -> u64 {
    // Zero has two signs.
    let bits = (place + 0.0).to_bits();
    if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
}

fn hash(level: u32, place: [f64; 3]) -> u64 {
    let mixed = place.iter().fold(u64::from(level), |hash, coordinate| {
        (hash ^ ordered(*coordinate)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
    });
    mixed ^ mixed >> 32
}

fn table_of(cells: &[Cell]) -> Result<Vec<u32>> {
    let mut table = memory::filled(EMPTY, (2 * cells.len() + 1).next_power_of_two())?;
    for (number, cell) in cells.iter().enumerate() {
        let mut slot = hash(cell.level, cell.place) as usize & (table.len() - 1);
        while table[slot] != EMPTY {
            slot = (slot + 1) & (table.len() - 1);
        }
        table[slot] = number as u32;
    }
    Ok(table)
}
