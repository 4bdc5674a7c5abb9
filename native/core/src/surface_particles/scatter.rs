//! Chooses points of many so that they are spread evenly. Distances are in influence radii, of the lesser of two points.

use crate::error::Result;
use crate::memory;
use crate::tracing::random::branch;
use crate::vectors::{difference, dot};

use super::fluid::SurfacePoint;
use super::levels::{LevelCell, Levels, present};

/// The next distance as a share of the one before.
const NEARER: f64 = 0.9;

/// Times that the distance is lessened: to a thousandth.
const MOST_TIMES: usize = 66;

/// The distance of neighbours in an even spread of as many points as random ones that have no room left for another, in the
/// least distance of these: random ones fill seven tenths of the room.
const EVEN: f64 = 1.2;

/// No point.
const NONE: u32 = u32::MAX;

/// At most `count` points that are far from one another and from those that are taken, and the distance of neighbours in an even
/// spread of as many, which is `farthest` at most.
///
/// Points are taken in random order where they have room; then those that have a little less, and so on.
///
/// # Errors
/// `OutOfMemory`.
pub fn scattered(
    points: &[SurfacePoint],
    taken: &[SurfacePoint],
    count: usize,
    farthest: f64,
    seed: u32,
) -> Result<(Vec<SurfacePoint>, f64)> {
    let mut distance = farthest;
    let mut rest = shuffled(points, seed)?;
    let mut chosen = memory::with_capacity(count.min(points.len()))?;
    for _ in 0..MOST_TIMES {
        let mut room = Room::new(distance, points.iter().chain(taken), taken.len() + count)?;
        taken.iter().chain(&chosen).for_each(|point| room.take(point));
        rest.retain(|point| {
            let is_chosen = chosen.len() < count && room.has(point);
            if is_chosen {
                room.take(point);
                chosen.push(*point);
            }
            !is_chosen
        });
        if chosen.len() == count || rest.is_empty() {
            break;
        }
        distance *= NEARER;
    }
    Ok((chosen, EVEN * distance))
}

/// Points in random order, `count` at most, whose neighbours are about as far apart as in an even spread of that distance.
///
/// # Errors
/// `OutOfMemory`.
pub fn evenly(points: &[SurfacePoint], distance: f64, count: usize, seed: u32) -> Result<Vec<SurfacePoint>> {
    apart(&shuffled(points, seed)?, distance / EVEN, count)
}

/// Points, `count` at most, of which no two are nearer than `distance`.
///
/// # Errors
/// `OutOfMemory`.
pub fn apart(points: &[SurfacePoint], distance: f64, count: usize) -> Result<Vec<SurfacePoint>> {
    let mut room = Room::new(distance, points.iter(), count.min(points.len()))?;
    let mut chosen = memory::with_capacity(count.min(points.len()))?;
    for point in points {
        if chosen.len() < count && room.has(point) {
            room.take(point);
            chosen.push(*point);
        }
    }
    Ok(chosen)
}

/// In an order that follows from a number.
fn shuffled(points: &[SurfacePoint], seed: u32) -> Result<Vec<SurfacePoint>> {
    let mut shuffled = memory::with_capacity(points.len())?;
    shuffled.extend_from_slice(points);
    for index in (1..shuffled.len()).rev() {
        shuffled.swap(index, branch(seed, index as u32) as usize % (index + 1));
    }
    Ok(shuffled)
}

/// Which places are taken, in cells that are linked lists.
struct Room {
    /// Influence radii.
    distance: f64,
    levels: Levels,
    present: Vec<u32>,
    first: Vec<u32>,
    taken: Vec<(SurfacePoint, LevelCell, u32)>,
}

impl Room {
    /// Room for so many of some points.
    fn new<'a>(distance: f64, points: impl Iterator<Item = &'a SurfacePoint> + Clone, count: usize) -> Result<Self> {
        let levels = Levels::new(distance * points.clone().map(|point| point.scale).fold(f64::MIN_POSITIVE, f64::max));
        let present = present(points.map(|point| levels.level(distance * point.scale)))?;
        let first = memory::filled(NONE, count.max(1).next_power_of_two())?;
        Ok(Self { distance, levels, present, first, taken: memory::with_capacity(count)? })
    }

    /// Whether no place near this one is taken on a surface that faces the same way.
    fn has(&self, point: &SurfacePoint) -> bool {
        !self.levels.any_around(&self.present, point.position, |cell| !self.is_free(cell, point))
    }

    fn is_free(&self, cell: LevelCell, point: &SurfacePoint) -> bool {
        let mut index = self.first[cell.bucket(self.first.len())];
        while index != NONE {
            let (other, place, next) = &self.taken[index as usize];
            let offset = difference(point.position, other.position);
            let distance = self.distance * point.scale.min(other.scale);
            if *place == cell && dot(offset, offset) < distance * distance && dot(point.normal, other.normal) > 0.0 {
                return false;
            }
            index = *next;
        }
        true
    }

    /// Takes a place; there is memory for as many as were announced.
    fn take(&mut self, point: &SurfacePoint) {
        let cell = self.levels.cell(self.levels.level(self.distance * point.scale), point.position);
        let bucket = cell.bucket(self.first.len());
        let next = std::mem::replace(&mut self.first[bucket], self.taken.len() as u32);
        self.taken.push((*point, cell, next));
    }
}
