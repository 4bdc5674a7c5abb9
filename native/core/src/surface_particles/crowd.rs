//! How crowded surface particles are, and where they push one another (van Kooten, van den Bergen and Telea 2007, sections 7.3.1
//! and 7.3.3; here the neighbours are found in a grid, so that none is lost).

use rayon::prelude::*;

use crate::error::Result;
use crate::memory;
use crate::tracing::random::{any_direction, mixed};
use crate::vectors::{difference, dot, double, plus};

use super::hash::{Cell, tag};

/// A particle as its neighbours see it.
#[derive(Clone, Copy, Debug, Default)]
struct Member {
    position: [f32; 3],
    normal: [f32; 3],
    tag: u32,
    particle: u32,
}

/// Particles in cells as wide as their reach.
#[derive(Debug)]
pub struct Crowd {
    reach: f64,
    /// The first member of each bucket, and the end.
    starts: Vec<u32>,
    members: Vec<Member>,
}

/// What the particles around a place do there.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pressure {
    /// The sum of `(1 - r / h)^3` (equation 5, scaled so that a particle has the density 1 where it is).
    pub density: f64,
    /// Its negative gradient times h / 3 (equation 6): the sum of `(1 - r / h)^2` times the direction from each.
    pub force: [f64; 3],
    /// How many there are.
    pub count: usize,
    /// The square of the distance to the nearest, infinite where there is none.
    pub nearest: f64,
}

impl Crowd {
    /// Puts particles, of which there are fewer than 2^32, into cells. `reach` is h, greater than 0.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn new(positions: &[[f32; 3]], normals: &[[f32; 3]], reach: f64) -> Result<Self> {
        let buckets = positions.len().max(1).next_power_of_two();
        let mut crowd = Self { reach, starts: memory::filled(0, buckets + 1)?, members: Vec::new() };
        for position in positions {
            let bucket = crowd.bucket(crowd.cell(double(*position)));
            crowd.starts[bucket + 1] += 1;
        }
        for bucket in 0..buckets {
            crowd.starts[bucket + 1] += crowd.starts[bucket];
        }
        crowd.members = memory::filled(Member::default(), positions.len())?;
        let mut next = memory::with_capacity(buckets)?;
        next.extend_from_slice(&crowd.starts[..buckets]);
        for (particle, (position, normal)) in positions.iter().zip(normals).enumerate() {
            let cell = crowd.cell(double(*position));
            let next = &mut next[crowd.bucket(cell)];
            let particle = particle as u32;
            crowd.members[*next as usize] = Member { position: *position, normal: *normal, tag: tag(cell), particle };
            *next += 1;
        }
        Ok(crowd)
    }

    /// What the particles that face the same way do at a place of the surface; `own` is the one that is there, if any.
    pub fn pressure(&self, position: [f64; 3], normal: [f64; 3], own: Option<usize>) -> Pressure {
        let mut pressure = Pressure { nearest: f64::INFINITY, ..Pressure::default() };
        let own = own.map(|particle| particle as u32);
        let [x, y, z] = self.cell(position);
        for step in 0..27i32 {
            let cell = [x.wrapping_add(step / 9 - 1), y.wrapping_add(step / 3 % 3 - 1), z.wrapping_add(step % 3 - 1)];
            let (tag, bucket) = (tag(cell), self.bucket(cell));
            let members = &self.members[self.starts[bucket] as usize..self.starts[bucket + 1] as usize];
            for member in members.iter().filter(|member| member.tag == tag && Some(member.particle) != own) {
                let offset = difference(position, double(member.position));
                let squared = dot(offset, offset);
                if squared < self.reach * self.reach && dot(normal, double(member.normal)) > 0.0 {
                    pressure.add(offset, squared.sqrt(), self.reach, own.unwrap_or(member.particle));
                }
            }
        }
        pressure
    }

    /// The pressure on each of the particles.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn pressures(&self, positions: &[[f32; 3]], normals: &[[f32; 3]]) -> Result<Vec<Pressure>> {
        let mut pressures = memory::filled(Pressure::default(), positions.len())?;
        // In the order of the cells, whose neighbours are in the cache.
        let found = self.members.par_iter().map(|member| {
            let particle = member.particle as usize;
            (particle, self.pressure(double(positions[particle]), double(normals[particle]), Some(particle)))
        });
        let mut ordered = memory::with_capacity(positions.len())?;
        found.collect_into_vec(&mut ordered);
        for (particle, pressure) in ordered {
            pressures[particle] = pressure;
        }
        Ok(pressures)
    }

    fn cell(&self, point: [f64; 3]) -> Cell {
        point.map(|coordinate| (coordinate / self.reach).floor() as i32)
    }

    fn bucket(&self, [x, y, z]: Cell) -> usize {
        let mix = mixed(mixed(mixed(x as u32) ^ y as u32) ^ z as u32);
        mix as usize & (self.starts.len() - 2)
    }
}

impl Pressure {
    /// Adds a neighbour; one at the same point pushes in a direction that follows from `number`.
    fn add(&mut self, offset: [f64; 3], distance: f64, reach: f64, number: u32) {
        let share = 1.0 - distance / reach;
        let direction = if distance > 0.0 { offset.map(|c| c / distance) } else { any_direction(number) };
        self.density += share * share * share;
        self.force = plus(self.force, share * share, direction);
        self.count += 1;
        self.nearest = self.nearest.min(distance * distance);
    }
}
