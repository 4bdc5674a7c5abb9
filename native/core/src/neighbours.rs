//! For each ball those whose influence spheres overlap its own, the vicinity of Mueller, Grottel and Ertl 2007, section 3.1: no
//! other ball adds to the density anywhere in that sphere.
//!
//! Lists are counted, then allotted, then filled, so that what they take is known before. Balls lie in the order of cells of
//! space, and so do lists and what they name: neighbours are near one another in memory too.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use rayon::prelude::*;

use crate::balls::Balls;
use crate::cells::{AROUND, Cells, Part, first_bits};
use crate::error::{Error, Result};
use crate::job::Job;
use crate::memory;
use crate::simd::{LANES, Mask, Simd, Task, Vector};

/// Influence spheres are so much larger, as a share: rounding may put balls into a list that only touch, but leaves none out.
const MARGIN: f32 = 1e-6;

/// Neighbours nearer than this share of both radii come first in a list. They add most to the density, and part space with the
/// ball.
const NEAR: f32 = 0.35;

/// Neighbours that a thread counts before it tells the others.
const MANY: u64 = 1 << 16;

/// The neighbours of all balls, in an order of space.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Neighbours {
    /// The ball at each place of that order.
    pub order: Vec<u32>,
    /// Where the list of each place begins, and where the last one ends.
    pub starts: Vec<u32>,
    /// The lists, one after the other: places in the order. The nearest come first, and no ball is in its own list.
    pub places: Vec<u32>,
}

/// Finds the neighbours of all balls: those whose influence spheres overlap.
///
/// # Errors
/// `InvalidInput` where there are more than `most`, each pair counted twice; `OutOfMemory`, `Cancelled`.
pub fn neighbours(balls: &Balls, most: u32, job: &Job) -> Result<Neighbours> {
    let mut reaches = memory::filled(0.0f32, balls.len())?;
    reaches.par_iter_mut().zip(balls.radii()).with_min_len(1 << 13).for_each(|(reach, radius)| {
        *reach = (radius * (1.0 + MARGIN)).min(f32::MAX);
    });
    let cells = Cells::new(balls.positions(), &reaches)?;
    drop(reaches);
    let parts = cells.parts();
    job.expect(2 * parts.len());
    let counts = counted(&cells, &parts, most, job)?;
    let mut starts = memory::with_capacity(counts.len() + 1)?;
    starts.push(0);
    for count in &counts {
        starts.push(starts[starts.len() - 1] + count.load(Ordering::Relaxed));
    }
    drop(counts);
    let places = filled(&cells, &parts, &starts, job)?;
    let mut order = memory::with_capacity(balls.len())?;
    order.extend_from_slice(cells.balls());
    Ok(Neighbours { order, starts, places })
}

fn counted(cells: &Cells, parts: &[Part], most: u32, job: &Job) -> Result<Vec<AtomicU32>> {
    let mut counts = memory::with_capacity(cells.balls().len())?;
    counts.resize_with(cells.balls().len(), AtomicU32::default);
    let total = AtomicU64::new(0);
    parts.par_iter().try_for_each(|part| {
        let is_few = || job.advance(0).is_ok() && total.load(Ordering::Relaxed) <= u64::from(most);
        let found = cells.path.dispatch(CountTask { cells, part, counts: &counts, total: &total, is_few: &is_few });
        total.fetch_add(found, Ordering::Relaxed);
        if total.load(Ordering::Relaxed) > u64::from(most) {
            return Err(Error::InvalidInput(format!(
                "The influence spheres of {} balls overlap in more than {most} places, counted for each ball; use fewer balls, \
                 or smaller radii",
                cells.balls().len()
            )));
        }
        job.advance(1)
    })?;
    Ok(counts)
}

/// Counts the neighbours of a part's balls. Of balls of different grids the smaller one finds the larger one.
struct CountTask<'a, F> {
    cells: &'a Cells,
    part: &'a Part,
    counts: &'a [AtomicU32],
    total: &'a AtomicU64,
    is_few: &'a F,
}

impl<F: Fn() -> bool> Task for CountTask<'_, F> {
    /// How many of them have not been told to `total`.
    type Output = u64;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> u64 {
        let (cells, mut untold, mut begins) = (self.cells, 0, [0; AROUND]);
        for cell in Cells::cells_of(self.part) {
            let around = cells.around(self.part, cell, &mut begins);
            for entry in cells.entries_of(cell) {
                let sphere = cells.sphere(simd, entry);
                let mut count = 0;
                for others in &around {
                    let mut begin = others.start;
                    while begin < others.end {
                        let [distance_2, reach_2] = cells.distances(simd, sphere, begin);
                        count += first_bits(distance_2.le(reach_2).bits(), others.end - begin).count_ones();
                        begin += LANES;
                    }
                }
                count -= 1; // itself
                let mut larger = 0;
                for level in cells.coarser(self.part) {
                    for others in cells.around_in(level, entry) {
                        let mut begin = others.start;
                        while begin < others.end {
                            let [distance_2, reach_2] = cells.distances(simd, sphere, begin);
                            let mut bits = first_bits(distance_2.le(reach_2).bits(), others.end - begin);
                            larger += bits.count_ones();
                            while bits != 0 {
                                self.counts[begin + next_bit(&mut bits)].fetch_add(1, Ordering::Relaxed);
                            }
                            begin += LANES;
                        }
                    }
                }
                self.counts[entry].fetch_add(count + larger, Ordering::Relaxed);
                untold += u64::from(count) + 2 * u64::from(larger);
                if untold >= MANY {
                    self.total.fetch_add(untold, Ordering::Relaxed);
                    untold = 0;
                    if !(self.is_few)() {
                        return 0;
                    }
                }
            }
        }
        untold
    }
}

fn filled(cells: &Cells, parts: &[Part], starts: &[u32], job: &Job) -> Result<Vec<u32>> {
    let total = starts[starts.len() - 1] as usize;
    let mut places = memory::with_capacity(total)?;
    places.resize_with(total, AtomicU32::default);
    let mut ends = memory::with_capacity(starts.len() - 1)?;
    ends.extend(starts[1..].iter().map(|start| AtomicU32::new(*start)));
    parts.par_iter().try_for_each(|part| {
        cells.path.dispatch(FillTask { cells, part, starts, ends: &ends, places: &places })?;
        job.advance(1)
    })?;
    let mut places: Vec<u32> = places.into_iter().map(AtomicU32::into_inner).collect();
    if cells.has_levels() {
        sort_smaller(&mut places, starts, &ends)?;
    }
    Ok(places)
}

/// Writes the neighbours of a part's balls: from the front of a list those that the ball finds, from its end those smaller ones that
/// find the ball.
struct FillTask<'a> {
    cells: &'a Cells,
    part: &'a Part,
    starts: &'a [u32],
    ends: &'a [AtomicU32],
    places: &'a [AtomicU32],
}

impl Task for FillTask<'_> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Result<()> {
        let (cells, mut begins) = (self.cells, [0; AROUND]);
        let (mut near, mut far) = (Vec::new(), Vec::new());
        let near_2 = simd.splat(NEAR * NEAR);
        for cell in Cells::cells_of(self.part) {
            let around = cells.around(self.part, cell, &mut begins);
            for entry in cells.entries_of(cell) {
                let sphere = cells.sphere(simd, entry);
                let (mut next, end) = (self.starts[entry] as usize, self.starts[entry + 1] as usize);
                make_room(&mut near, end - next + LANES)?;
                make_room(&mut far, end - next + LANES)?;
                let (mut near_count, mut far_count) = (0, 0);
                for others in &around {
                    let mut begin = others.start;
                    while begin < others.end {
                        let [distance_2, reach_2] = cells.distances(simd, sphere, begin);
                        let mut bits = first_bits(distance_2.le(reach_2).bits(), others.end - begin);
                        if let Some(own) = entry.checked_sub(begin).filter(|own| *own < LANES) {
                            bits &= !(1 << own);
                        }
                        if bits != 0 {
                            let near_bits = bits & distance_2.lt(near_2 * reach_2).bits();
                            near_count = append(&mut near, near_count, begin, near_bits);
                            far_count = append(&mut far, far_count, begin, bits & !near_bits);
                        }
                        begin += LANES;
                    }
                }
                for found in [&near[..near_count], &far[..far_count]] {
                    let list = &self.places[next..next + found.len()];
                    list.iter().zip(found).for_each(|(place, other)| place.store(*other, Ordering::Relaxed));
                    next += found.len();
                }
                for level in cells.coarser(self.part) {
                    for others in cells.around_in(level, entry) {
                        let mut begin = others.start;
                        while begin < others.end {
                            let [distance_2, reach_2] = cells.distances(simd, sphere, begin);
                            let mut bits = first_bits(distance_2.le(reach_2).bits(), others.end - begin);
                            while bits != 0 {
                                let other = begin + next_bit(&mut bits);
                                self.places[next].store(other as u32, Ordering::Relaxed);
                                next += 1;
                                let end = self.ends[other].fetch_sub(1, Ordering::Relaxed);
                                self.places[end as usize - 1].store(entry as u32, Ordering::Relaxed);
                            }
                            begin += LANES;
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

/// Sorts the ends of lists, which threads have written at the same time.
fn sort_smaller(places: &mut [u32], starts: &[u32], ends: &[AtomicU32]) -> Result<()> {
    let mut written = memory::with_capacity(ends.len())?;
    let mut rest = places;
    for (end, list) in ends.iter().zip(starts.windows(2)) {
        let (found, behind) = rest.split_at_mut((list[1] - list[0]) as usize);
        rest = behind;
        let front = (end.load(Ordering::Relaxed) - list[0]) as usize;
        if front < found.len() {
            written.push(&mut found[front..]);
        }
    }
    written.into_par_iter().for_each(|list| list.sort_unstable());
    Ok(())
}

fn make_room(buffer: &mut Vec<u32>, count: usize) -> Result<()> {
    if buffer.len() < count {
        memory::reserve(buffer, count - buffer.len())?;
        buffer.resize(count, 0);
    }
    Ok(())
}

/// Writes the numbers of the bits that are set, plus `first`, to a buffer from `count` on; how many there are then. Four are written
/// at a time, wanted or not: to look at each bit would be a branch that nobody can foretell.
#[inline(always)]
fn append(buffer: &mut [u32], count: usize, first: usize, mut bits: u16) -> usize {
    let end = count + bits.count_ones() as usize;
    for four in buffer[count..].as_chunks_mut::<4>().0 {
        for number in four {
            *number = first as u32 + bits.trailing_zeros();
            bits &= bits.wrapping_sub(1);
        }
        if bits == 0 {
            break;
        }
    }
    end
}

/// Takes the lowest bit that is set; its number.
#[inline(always)]
fn next_bit(bits: &mut u16) -> usize {
    let bit = bits.trailing_zeros() as usize;
    *bits &= *bits - 1;
    bit
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOST: u32 = 1 << 26;

    fn found(positions: &[[f32; 3]], radii: &[f32]) -> Neighbours {
        let weights = vec![1.0; radii.len()];
        neighbours(&Balls::new(positions, radii, &weights).expect("usable balls"), MOST, &Job::default()).expect("neighbours")
    }

    /// The balls in each ball's list, sorted; checks that there is one list for each ball.
    fn lists(found: &Neighbours) -> Vec<Vec<u32>> {
        let mut lists = vec![None; found.order.len()];
        for (ball, list) in found.order.iter().zip(found.starts.windows(2)) {
            let places = &found.places[list[0] as usize..list[1] as usize];
            let mut list: Vec<u32> = places.iter().map(|place| found.order[*place as usize]).collect();
            list.sort_unstable();
            assert_eq!(lists[*ball as usize].replace(list), None);
        }
        assert_eq!(*found.starts.last().expect("an end") as usize, found.places.len());
        lists.into_iter().map(|list| list.expect("one list a ball")).collect()
    }

    fn by_force(positions: &[[f32; 3]], radii: &[f32]) -> Vec<Vec<u32>> {
        let overlap = |one: usize, other: usize| {
            let square = |axis: usize| (f64::from(positions[one][axis]) - f64::from(positions[other][axis])).powi(2);
            one != other && (square(0) + square(1) + square(2)).sqrt() < f64::from(radii[one]) + f64::from(radii[other])
        };
        let balls = 0..radii.len();
        balls
            .clone()
            .map(|one| balls.clone().filter(|other| overlap(one, *other)).map(|other| other as u32).collect())
            .collect()
    }

    fn random_numbers(mut state: u64) -> impl FnMut() -> f32 {
        move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        }
    }

    #[test]
    fn lists_are_those_of_all_pairs() {
        let mut random = random_numbers(3);
        let count = if cfg!(miri) { 40 } else { 700 };
        for (round, spread) in [1.0f32, 0.3, 0.001].into_iter().enumerate() {
            let positions: Vec<[f32; 3]> = (0..count).map(|_| [random(), random() - 2.0, 3.0 * random()]).collect();
            let radii: Vec<f32> = (0..count).map(|_| 0.2 * spread.powf(random())).collect();
            assert_eq!(lists(&found(&positions, &radii)), by_force(&positions, &radii), "{round}");
        }
    }

    #[test]
    fn lists_are_the_same_every_time_and_near_balls_come_first() {
        let mut random = random_numbers(4);
        let count = if cfg!(miri) { 40 } else { 3000 };
        let positions: Vec<[f32; 3]> = (0..count).map(|_| [random(), random(), random()]).collect();
        let radii: Vec<f32> = (0..count).map(|_| 0.15 * 0.001f32.powf(random())).collect();
        let first = found(&positions, &radii);
        for _ in 0..3 {
            assert_eq!(found(&positions, &radii), first);
        }
        let one_size = found(&positions, &vec![0.15; count]);
        for (place, list) in one_size.starts.windows(2).enumerate() {
            let at = |place: usize| positions[one_size.order[place] as usize];
            let is_near = |other: &u32| {
                let (one, other) = (at(place), at(*other as usize));
                (0..3).map(|axis| (one[axis] - other[axis]).powi(2)).sum::<f32>().sqrt() < NEAR * 0.3
            };
            let near: Vec<bool> = one_size.places[list[0] as usize..list[1] as usize].iter().map(is_near).collect();
            assert!(near.is_sorted_by(|one, other| one >= other));
        }
    }

    #[test]
    fn balls_that_only_touch_may_be_in_lists_and_those_apart_are_not() {
        let apart = found(&[[0.0; 3], [2.0001, 0.0, 0.0]], &[1.0, 1.0]);
        assert_eq!((apart.places, apart.starts), (vec![], vec![0, 0, 0]));
        assert_eq!(found(&[[0.0; 3], [1.9999, 0.0, 0.0]], &[1.0, 1.0]).places.len(), 2);
        assert_eq!(found(&[[0.0; 3], [1e-25, 0.0, 0.0]], &[1e-25, 1e-25]).places.len(), 2);
    }

    #[test]
    fn none_one_and_many_in_one_place() {
        assert_eq!(found(&[], &[]), Neighbours { order: vec![], starts: vec![0], places: vec![] });
        assert_eq!(found(&[[1.0; 3]], &[2.0]), Neighbours { order: vec![0], starts: vec![0, 0], places: vec![] });
        let count = if cfg!(miri) { 20 } else { 300 };
        let many = lists(&found(&vec![[1.0; 3]; count], &vec![2.0; count]));
        assert!(many.iter().enumerate().all(|(ball, list)| list.len() == count - 1 && !list.contains(&(ball as u32))));
    }

    #[test]
    #[cfg_attr(miri, ignore = "too slow")]
    fn too_many_are_an_error_before_there_is_memory_for_them() {
        let count = 30_000;
        let (positions, radii) = (vec![[0.5; 3]; count], vec![1.0; count]);
        let balls = Balls::new(&positions, &radii, &radii).expect("usable balls");
        let start = std::time::Instant::now();
        let refused = neighbours(&balls, 1 << 20, &Job::default()).expect_err("30000 squared");
        assert!(refused.to_string().contains("more than 1048576 places"), "{refused}");
        let job = Job::default();
        job.cancel();
        assert_eq!(neighbours(&balls, u32::MAX, &job), Err(Error::Cancelled));
        assert!(start.elapsed().as_secs() < 60);
    }

    /// As many small balls as large ones: work must not go with the product of their numbers.
    #[test]
    #[cfg_attr(miri, ignore = "too slow")]
    fn a_large_ball_finds_small_ones_far_apart() {
        let mut random = random_numbers(6);
        let count = 20_000;
        let positions: Vec<[f32; 3]> = (0..count).map(|_| [0, 1, 2].map(|_| 200.0 * random())).collect();
        let radii: Vec<f32> = (0..count).map(|ball| if ball % 2 == 0 { 1.0 } else { 1e-3 }).collect();
        let lists = lists(&found(&positions, &radii));
        for (one, list) in lists.iter().enumerate().step_by(97) {
            assert!(list.iter().all(|other| lists[*other as usize].contains(&(one as u32))));
        }
        assert!(lists.iter().skip(1).step_by(2).any(|list| !list.is_empty()));
    }
}
