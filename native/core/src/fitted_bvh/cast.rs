//! Batches of rays.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::job::Job;
use crate::memory;
use crate::oracle::unit;
use crate::simd::{Simd, Task};

use super::FittedBvh;
use super::ray::Ray;
use super::traversal::{Caster, Counts, Hit, Uncounted};

/// Rays that a thread casts at a time.
const CHUNK: usize = 1024;

/// N rays.
#[derive(Clone, Copy, Debug)]
pub struct Rays<'a> {
    origins: &'a [[f64; 3]],
    directions: &'a [[f64; 3]],
    t_min: &'a [f64],
    t_max: &'a [f64],
}

impl<'a> Rays<'a> {
    /// Borrows the arrays: origins in world space, directions of any length, and between which distances from the origin
    /// the surface is looked for, one number for all rays or one for each.
    ///
    /// # Errors
    /// `InvalidInput` where lengths differ.
    pub fn new(origins: &'a [[f64; 3]], directions: &'a [[f64; 3]], t_min: &'a [f64], t_max: &'a [f64]) -> Result<Self> {
        let count = origins.len();
        if directions.len() != count {
            return Err(Error::InvalidInput(format!(
                "directions must have a row for each of the {count} origins, not {}",
                directions.len()
            )));
        }
        for (name, limits) in [("t_min", t_min), ("t_max", t_max)] {
            if limits.len() != count && limits.len() != 1 {
                return Err(Error::InvalidInput(format!(
                    "{name} must be one number, or one for each of the {count} rays, not {}",
                    limits.len()
                )));
            }
        }
        Ok(Self { origins, directions, t_min, t_max })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.origins.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.origins.is_empty()
    }

    fn get(&self, index: usize) -> Result<Ray> {
        let origin = self.origins[index];
        let direction = self.directions[index];
        let limit = |limits: &[f64]| limits[if limits.len() == 1 { 0 } else { index }];
        let (t_min, t_max) = (limit(self.t_min), limit(self.t_max));
        let is_finite = |vector: &[f64; 3]| vector.iter().all(|c| c.is_finite());
        let Some(direction) = unit(direction).filter(|direction| is_finite(&origin) && is_finite(direction)) else {
            return Err(unusable(
                index,
                format!("from {origin:?} along {direction:?}: both must be finite, and no direction zero"),
            ));
        };
        if !t_min.is_finite() || t_max.is_nan() {
            return Err(unusable(
                index,
                format!("cast from t_min {t_min} to t_max {t_max}: both must be numbers, t_min finite"),
            ));
        }
        Ok(Ray { origin, direction, t_min, t_max })
    }
}

fn unusable(index: usize, why: String) -> Error {
    Error::InvalidInput(format!("Ray {index} is {why}"))
}

/// What rays hit; one element for each.
#[derive(Debug)]
pub struct FirstHits {
    /// Distance from the origin, infinite where there is no surface.
    pub t: Vec<f64>,
    /// Unit, world space, out of the fluid; 0 where there is no surface.
    pub normals: Vec<[f32; 3]>,
    /// The ball with the greatest share of the field; -1 where there is no surface.
    pub balls: Vec<i32>,
}

impl FittedBvh {
    /// Where each ray first crosses the surface, either way.
    ///
    /// # Errors
    /// `InvalidInput` names a ray that is unusable; `OutOfMemory`, `Cancelled`.
    pub fn first_hit(&self, rays: &Rays, job: &Job) -> Result<FirstHits> {
        let mut hits = FirstHits {
            t: memory::filled(f64::INFINITY, rays.len())?,
            normals: memory::filled([0.0; 3], rays.len())?,
            balls: memory::filled(-1, rays.len())?,
        };
        job.expect(rays.len());
        let targets = (hits.t.par_chunks_mut(CHUNK), hits.normals.par_chunks_mut(CHUNK), hits.balls.par_chunks_mut(CHUNK));
        targets.into_par_iter().enumerate().try_for_each(|(chunk, (t, normals, balls))| {
            let count = t.len();
            let write = |index: usize, hit: Option<Hit>| {
                if let Some(hit) = hit {
                    (t[index], normals[index], balls[index]) = (hit.t, hit.normal, hit.ball as i32);
                }
            };
            self.path.dispatch(FirstHitTask { bvh: self, rays, first: chunk * CHUNK, count, write })?;
            job.advance(count)
        })?;
        Ok(hits)
    }

    /// Whether each ray crosses the surface.
    ///
    /// # Errors
    /// `InvalidInput` names a ray that is unusable; `OutOfMemory`, `Cancelled`.
    pub fn any_hit(&self, rays: &Rays, job: &Job) -> Result<Vec<bool>> {
        let mut hits = memory::filled(false, rays.len())?;
        job.expect(rays.len());
        hits.par_chunks_mut(CHUNK).enumerate().try_for_each(|(chunk, hits)| {
            let count = hits.len();
            self.path.dispatch(AnyHitTask { bvh: self, rays, first: chunk * CHUNK, hits })?;
            job.advance(count)
        })?;
        Ok(hits)
    }

    /// What finding the first hits of rays takes, summed.
    ///
    /// # Errors
    /// `InvalidInput` names a ray that is unusable; `Cancelled`.
    pub fn count(&self, rays: &Rays, job: &Job) -> Result<Counts> {
        job.expect(rays.len());
        let chunks = (0..rays.len().div_ceil(CHUNK)).into_par_iter();
        let counted = chunks.map(|chunk| {
            let first = chunk * CHUNK;
            let count = CHUNK.min(rays.len() - first);
            let counts = self.path.dispatch(CountTask { bvh: self, rays, first, count })?;
            job.advance(count)?;
            Ok(counts)
        });
        counted.try_reduce(Counts::default, |a, b| Ok(a + b))
    }
}

struct FirstHitTask<'a, W> {
    bvh: &'a FittedBvh,
    rays: &'a Rays<'a>,
    first: usize,
    count: usize,
    write: W,
}

impl<W: FnMut(usize, Option<Hit>)> Task for FirstHitTask<'_, W> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Result<()> {
        let mut caster = Caster::new(simd, self.bvh, Uncounted);
        for index in 0..self.count {
            let ray = self.rays.get(self.first + index)?;
            (self.write)(index, caster.first_hit(&ray));
        }
        Ok(())
    }
}

struct AnyHitTask<'a> {
    bvh: &'a FittedBvh,
    rays: &'a Rays<'a>,
    first: usize,
    hits: &'a mut [bool],
}

impl Task for AnyHitTask<'_> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Result<()> {
        let mut caster = Caster::new(simd, self.bvh, Uncounted);
        for (index, hit) in self.hits.iter_mut().enumerate() {
            *hit = caster.any_hit(&self.rays.get(self.first + index)?);
        }
        Ok(())
    }
}

struct CountTask<'a> {
    bvh: &'a FittedBvh,
    rays: &'a Rays<'a>,
    first: usize,
    count: usize,
}

impl Task for CountTask<'_> {
    type Output = Result<Counts>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Result<Counts> {
        let mut caster = Caster::new(simd, self.bvh, Counts::default());
        for index in 0..self.count {
            caster.first_hit(&self.rays.get(self.first + index)?);
        }
        Ok(caster.counter)
    }
}
