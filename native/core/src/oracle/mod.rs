//! The exact caster that every other way to find the surface is judged by: any rays, all crossings, double precision.
//!
//! A ray is cut where it enters and leaves influence spheres. On each interval the density is a polynomial, summed anew in
//! Bernstein form, whose changes of sign are isolated (the intervals of Nishita and Nakamae 1994, which Kanamori et al. 2008
//! describe in section 3.1). It shares no code with the methods that it judges.
//!
//! What counts as a crossing: the fluid is where the density exceeds the isovalue, and a crossing is where a ray goes from
//! outside to inside or back, at a distance greater than 0. So crossings alternate, the first one tells on which side the ray
//! starts, and the surface at the very start of a ray is not seen. A ray that only touches the fluid does not cross it. Two
//! crossings between which the density stays so near to the isovalue that its rounding hides the difference count as touching.

mod bernstein;
mod chord;
mod rays;
mod sphere_tree;
#[cfg(test)]
mod tests;

use std::ops::ControlFlow;

use rayon::prelude::*;

use self::bernstein::{Bernstein, Sign};
use self::chord::{Chord, Interval, Intervals};
use self::rays::Ray;
pub use self::rays::Rays;
pub(crate) use self::rays::unit;
use self::sphere_tree::SphereTree;
use crate::balls::Balls;
use crate::error::Result;
use crate::field::Field;
use crate::job::Job;
use crate::memory;

/// Rays between two looks at whether the user gave up.
const RAYS_AT_ONCE: usize = 64;

/// Rounding of the sum of a few dozen densities, as a share of the sum of their sizes.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Where rays first cross the surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FirstCrossings {
    /// Distance along each unit ray; infinite where it does not cross.
    pub t: Vec<f64>,
    /// Unit normals, out of the fluid; 0 where the ray does not cross.
    pub normals: Vec<[f64; 3]>,
}

/// Where rays cross the surface, in order of ray and distance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Crossings {
    /// The index of the ray.
    pub rays: Vec<i64>,
    /// Distance along the unit ray.
    pub t: Vec<f64>,
    /// Whether the ray goes into the fluid there.
    pub is_entering: Vec<bool>,
}

/// A ray's way through the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Crossing {
    t: f64,
    is_entering: bool,
}

/// Finds where each ray first crosses the surface, in either direction.
///
/// # Errors
/// `Cancelled`, or `OutOfMemory`.
pub fn cast(balls: Balls<'_>, field: Field, rays: Rays<'_>, job: &Job) -> Result<FirstCrossings> {
    let caster = Caster::new(balls, field)?;
    let mut first =
        FirstCrossings { t: memory::filled(f64::INFINITY, rays.len())?, normals: memory::filled([0.0; 3], rays.len())? };
    job.expect(rays.len());
    let ts = first.t.par_chunks_mut(RAYS_AT_ONCE);
    let chunks = ts.zip(first.normals.par_chunks_mut(RAYS_AT_ONCE)).enumerate();
    chunks.try_for_each_init(Intervals::default, |intervals, (chunk, (ts, normals))| {
        for (offset, (t, normal)) in ts.iter_mut().zip(normals.iter_mut()).enumerate() {
            let ray = rays.unit(chunk * RAYS_AT_ONCE + offset);
            if let Some(crossing) = caster.first_crossing(&ray, intervals) {
                *t = crossing.t;
                *normal = outward_normal(field, &ray, intervals.chords(), crossing);
            }
        }
        job.advance(ts.len())
    })?;
    Ok(first)
}

/// Finds all crossings of each ray with the surface.
///
/// # Errors
/// `Cancelled`, or `OutOfMemory`.
pub fn crossings(balls: Balls<'_>, field: Field, rays: Rays<'_>, job: &Job) -> Result<Crossings> {
    let caster = Caster::new(balls, field)?;
    job.expect(rays.len());
    let chunk_count = rays.len().div_ceil(RAYS_AT_ONCE);
    let chunks = (0..chunk_count).into_par_iter().map_init(<(Intervals, Vec<_>)>::default, |(intervals, found), chunk| {
        let begin = chunk * RAYS_AT_ONCE;
        let end = rays.len().min(begin + RAYS_AT_ONCE);
        found.clear();
        for index in begin..end {
            caster.walk(&rays.unit(index), intervals, &mut |crossing| {
                found.push((index, crossing));
                ControlFlow::Continue(())
            });
        }
        job.advance(end - begin)?;
        let mut kept = memory::with_capacity(found.len())?;
        kept.extend_from_slice(found);
        Ok(kept)
    });
    joined(&chunks.collect::<Result<Vec<_>>>()?)
}

fn joined(chunks: &[Vec<(usize, Crossing)>]) -> Result<Crossings> {
    let count = chunks.iter().map(Vec::len).sum();
    let mut all = Crossings {
        rays: memory::with_capacity(count)?,
        t: memory::with_capacity(count)?,
        is_entering: memory::with_capacity(count)?,
    };
    for (ray, crossing) in chunks.iter().flatten() {
        all.rays.push(*ray as i64);
        all.t.push(crossing.t);
        all.is_entering.push(crossing.is_entering);
    }
    Ok(all)
}

/// What is cast at.
struct Caster {
    tree: SphereTree,
    field: Field,
}

impl Caster {
    fn new(balls: Balls<'_>, field: Field) -> Result<Self> {
        Ok(Self { tree: SphereTree::new(balls)?, field })
    }

    fn first_crossing(&self, ray: &Ray, intervals: &mut Intervals) -> Option<Crossing> {
        let mut first = None;
        self.walk(ray, intervals, &mut |crossing| {
            first = Some(crossing);
            ControlFlow::Break(())
        });
        first
    }

    /// Calls `visit` with the crossings of a ray, the nearest first, until it breaks off.
    fn walk(&self, ray: &Ray, intervals: &mut Intervals, visit: &mut impl FnMut(Crossing) -> ControlFlow<()>) {
        intervals.clear();
        self.tree.visit(ray, &mut |ball| {
            if let Some(chord) = Chord::new(ball, ray) {
                intervals.push(chord);
            }
        });
        let mut side = None;
        // Whether it broke off does not matter here.
        let _ = intervals.walk(&mut |interval| {
            let (difference, rounding) = density_less_isovalue(self.field, interval);
            difference.walk_signs(rounding, &mut |u, sign| match side.replace(sign) {
                Some(last) if last != sign => {
                    let t = interval.begin + u * (interval.end - interval.begin);
                    visit(Crossing { t, is_entering: sign == Sign::Positive })
                }
                _ => ControlFlow::Continue(()),
            })
        });
    }
}

/// The density over an interval less the isovalue, and how far rounding may have moved its coefficients.
///
/// Neighbours agree to the last bit where they meet: a ball that begins or ends there adds exactly 0, and the others are
/// added in the same order.
fn density_less_isovalue(field: Field, interval: Interval) -> (Bernstein, f64) {
    let mut density = Bernstein::zero(field.kernel);
    let mut size = field.isovalue;
    for chord in interval.chords() {
        let share = Bernstein::of_kernel(field.kernel, chord.x_over(interval.begin, interval.end));
        density.add_scaled(&share, chord.weight);
        size += share.largest() * chord.weight.abs();
    }
    density.add_constant(-field.isovalue);
    (density, ROUNDING * size)
}

/// The unit normal at a crossing. Where the density is level, which has no normal, the one that faces along the ray.
fn outward_normal(field: Field, ray: &Ray, chords: &[Chord], crossing: Crossing) -> [f64; 3] {
    let mut outward = [0.0; 3];
    for chord in chords {
        let pull = chord.weight * field.kernel.derivative(chord.x(crossing.t)) / (chord.radius * chord.radius);
        let offset = chord.offset(ray, crossing.t);
        outward = std::array::from_fn(|axis| outward[axis] + pull * offset[axis]);
    }
    rays::unit(outward).unwrap_or_else(|| ray.direction.map(|d| if crossing.is_entering { -d } else { d }))
}
