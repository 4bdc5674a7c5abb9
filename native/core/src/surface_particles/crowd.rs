//! How crowded surface particles are, and where they push one another (van Kooten, van den Bergen and Telea 2007, sections 7.3.1
//! and 7.3.3; here the neighbours are found in cells, so that none is lost).

use rayon::prelude::*;

use crate::error::Result;
use crate::memory;
use crate::tracing::random::any_direction;
use crate::vectors::{difference, dot, double, plus};

use super::fluid::SurfacePoint;
use super::levels::{LevelCell, Levels, present};

/// A particle as its neighbours see it.
#[derive(Clone, Copy, Debug, Default)]
struct Member {
    position: [f32; 3],
    normal: [f32; 3],
    reach: f32,
    cell: LevelCell,
    particle: u32,
}

/// Particles in cells as wide as they reach.
#[derive(Debug)]
pub struct Crowd {
    /// Influence radii.
    reach: f64,
    levels: Levels,
    present: Vec<u32>,
    /// The first member of each bucket, and the end.
    starts: Vec<u32>,
    members: Vec<Member>,
}

/// What the particles around a place do there. Two push one another where they are nearer than the lesser of their reaches, h.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pressure {
    /// The sum of `(1 - r / h)^3` (equation 5, scaled so that a particle has the density 1 where it is).
    pub density: f64,
    /// Its negative gradient times h / 3 (equation 6): the sum of `(1 - r / h)^2` times the direction from each.
    pub force: [f64; 3],
    /// How many there are.
    pub count: usize,
}

impl Crowd {
    /// Puts particles, of which there are fewer than 2^32, into cells. `reach` is how far they push one another, in influence radii,
    /// greater than 0.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn new(places: &[SurfacePoint], reach: f64) -> Result<Self> {
        let farthest = places.iter().map(|place| place.scale).fold(0.0, f64::max);
        let levels = Levels::new(reach * farthest);
        let present = present(places.iter().map(|place| levels.level(reach * place.scale)))?;
        let buckets = places.len().max(1).next_power_of_two();
        let mut crowd = Self {
            reach,
            levels,
            present,
            starts: memory::filled(0, buckets + 1)?,
            members: memory::filled(Member::default(), places.len())?,
        };
        for place in places {
            let bucket = crowd.cell_of(place).bucket(buckets);
            crowd.starts[bucket + 1] += 1;
        }
        for bucket in 0..buckets {
            crowd.starts[bucket + 1] += crowd.starts[bucket];
        }
        let mut next = memory::with_capacity(buckets)?;
        next.extend_from_slice(&crowd.starts[..buckets]);
        for (particle, place) in places.iter().enumerate() {
            let cell = crowd.cell_of(place);
            let next = &mut next[cell.bucket(buckets)];
            crowd.members[*next as usize] = Member {
                position: crate::vectors::single(place.position),
                normal: crate::vectors::single(place.normal),
                reach: (reach * place.scale) as f32,
                cell,
                particle: particle as u32,
            };
            *next += 1;
        }
        Ok(crowd)
    }

    /// What the particles that face the same way do to one of them.
    fn pressure(&self, place: &SurfacePoint, own: u32) -> Pressure {
        let mut pressure = Pressure::default();
        self.levels.for_around(&self.present, place.position, |cell| {
            for member in self.members_of(cell).filter(|member| member.particle != own) {
                if let Some((offset, squared, reach)) = self.met(place, member, 1.0) {
                    pressure.add(offset, squared.sqrt(), reach, own);
                }
            }
        });
        pressure
    }

    /// Whether a particle that faces the same way is within a share of the reach, up to 1, of a place of the surface.
    pub fn is_near(&self, place: &SurfacePoint, share: f64) -> bool {
        self.levels.any_around(&self.present, place.position, |cell| {
            self.members_of(cell).any(|member| self.met(place, member, share).is_some())
        })
    }

    #[inline]
    fn members_of(&self, cell: LevelCell) -> impl Iterator<Item = &Member> {
        let bucket = cell.bucket(self.starts.len() - 1);
        let members = &self.members[self.starts[bucket] as usize..self.starts[bucket + 1] as usize];
        members.iter().filter(move |member| member.cell == cell)
    }

    /// The way from a particle to a place that faces the same way and is within a share of its reach; its square, and the reach.
    #[inline]
    fn met(&self, place: &SurfacePoint, member: &Member, share: f64) -> Option<([f64; 3], f64, f64)> {
        let offset = difference(place.position, double(member.position));
        let (squared, reach) = (dot(offset, offset), (self.reach * place.scale).min(f64::from(member.reach)));
        let is_met = squared < (share * reach).powi(2) && dot(place.normal, double(member.normal)) > 0.0;
        is_met.then_some((offset, squared, reach))
    }

    /// The pressure on each of the particles.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn pressures(&self, places: &[SurfacePoint]) -> Result<Vec<Pressure>> {
        let mut pressures = memory::filled(Pressure::default(), places.len())?;
        // In the order of the cells, whose neighbours are in the cache.
        let found = self.members.par_iter().map(|member| {
            let particle = member.particle as usize;
            (particle, self.pressure(&places[particle], member.particle))
        });
        let mut ordered = memory::with_capacity(places.len())?;
        found.collect_into_vec(&mut ordered);
        for (particle, pressure) in ordered {
            pressures[particle] = pressure;
        }
        Ok(pressures)
    }

    fn cell_of(&self, place: &SurfacePoint) -> LevelCell {
        self.levels.cell(self.levels.level(self.reach * place.scale), place.position)
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
    }
}
