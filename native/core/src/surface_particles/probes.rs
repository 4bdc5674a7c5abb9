//! Points all over the surface, found from the balls alone: where rays from a ball's centre leave the fluid for the last time
//! within its influence sphere. Every part of the surface has balls that reach it, so none is missed, whoever looks from where.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::error::Result;
use crate::job::Job;
use crate::memory;
use crate::tracing::random::{any_direction, branch};
use crate::vectors::{along, difference, dot, plus};

use super::fluid::{Fluid, SurfacePoint};

/// Directions of a ball at least: a part of it that is seen between others is missed where it is smaller than their distance.
const FEWEST: usize = 40;

/// Directions of a ball at most.
const MOST: usize = 1 << 16;

/// Balls that a thread takes at a time.
const PART: usize = 64;

/// Where a ray is looked at between the kernel sphere and the influence sphere.
const STEPS: usize = 6;

/// Finds points of the surface that are about `spacing` influence radii apart on the surface of each ball. Of balls of which no point
/// of a few is one to `look_at` there are only these.
///
/// # Errors
/// `OutOfMemory`, `Cancelled`.
pub fn probes(
    fluid: &Fluid,
    spacing: f64,
    look_at: impl Fn(&SurfacePoint) -> bool + Sync,
    seed: u32,
    job: &Job,
) -> Result<Vec<SurfacePoint>> {
    let kernels_hold = !fluid.carves();
    let parts = fluid.len().div_ceil(PART);
    job.expect(parts);
    let of_part = |part: usize| {
        let mut points = Vec::new();
        for ball in part * PART..((part + 1) * PART).min(fluid.len()) {
            of_ball(&Rays::of(fluid, ball, kernels_hold, branch(seed, ball as u32)), spacing, &look_at, &mut points)?;
        }
        job.advance(1)?;
        Ok(points)
    };
    let found: Vec<Vec<SurfacePoint>> = (0..parts).into_par_iter().map(of_part).collect::<Result<_>>()?;
    let mut points = memory::with_capacity(found.iter().map(Vec::len).sum())?;
    found.into_iter().for_each(|part| points.extend(part));
    Ok(points)
}

/// How large the surface is, or larger, in squares of the influence radii of the balls that it is of: of each ball's surface what is
/// exposed, which others may expose too.
pub fn exposed_area(fluid: &Fluid, seed: u32) -> f64 {
    let kernels_hold = !fluid.carves();
    let of_ball = |ball: usize| {
        let rays = Rays::of(fluid, ball, kernels_hold, branch(seed, ball as u32));
        rays.leaving(FEWEST).map(|(_, distance)| 2.0 * TAU * (distance / rays.radius).powi(2) / FEWEST as f64).sum::<f64>()
    };
    let of_part = |part: usize| (part * PART..((part + 1) * PART).min(fluid.len())).map(of_ball).sum::<f64>();
    // Summed in one order, whatever threads do.
    let areas: Vec<f64> = (0..fluid.len().div_ceil(PART)).into_par_iter().map(of_part).collect();
    areas.into_iter().sum()
}

/// Adds the points around a ball. Where a few directions find nothing, it lies deep within the fluid, or has none of it.
fn of_ball(
    rays: &Rays<'_>,
    spacing: f64,
    look_at: &impl Fn(&SurfacePoint) -> bool,
    points: &mut Vec<SurfacePoint>,
) -> Result<()> {
    let before = points.len();
    let wanted = (2.0 * TAU / (spacing * spacing)).min(MOST as f64) as usize;
    for count in [FEWEST, wanted] {
        memory::reserve(points, count)?;
        points.extend(rays.leaving(count).map(|(point, _)| point));
        if wanted <= FEWEST || !points[before..].iter().any(look_at) {
            break;
        }
    }
    Ok(())
}

/// Rays from a ball's centre.
struct Rays<'a> {
    fluid: &'a Fluid,
    center: [f64; 3],
    radius: f64,
    /// Up to here they are in the fluid.
    kernel_radius: f64,
    pole: [f64; 3],
}

impl<'a> Rays<'a> {
    /// `kernels_hold` says that no ball takes density away.
    fn of(fluid: &'a Fluid, ball: usize, kernels_hold: bool, seed: u32) -> Self {
        let (center, radius, weight) = fluid.ball(ball);
        let kernel_radius = if kernels_hold { radius * fluid.field().kernel_radius_share(weight) } else { 0.0 };
        Self { fluid, center, radius, kernel_radius, pole: any_direction(seed) }
    }

    /// The points where so many rays leave the fluid, and how far they are from the centre.
    fn leaving(&self, count: usize) -> impl Iterator<Item = (SurfacePoint, f64)> {
        (0..count).filter_map(move |index| self.leaving_along(along(self.pole, fibonacci(index, count))))
    }

    /// Where a ray leaves the fluid for the last time before the end of the influence sphere, about.
    fn leaving_along(&self, direction: [f64; 3]) -> Option<(SurfacePoint, f64)> {
        let is_inside = |distance: f64| self.fluid.is_inside(plus(self.center, distance, direction));
        if is_inside(self.radius) {
            return None;
        }
        let step = (self.radius - self.kernel_radius) / STEPS as f64;
        // The kernel sphere itself is decided by no rounding.
        let is_in = |distance: &f64| is_inside(*distance);
        let found = (1..STEPS).map(|count| self.radius - count as f64 * step).find(is_in);
        let inside = found.or_else(|| (self.kernel_radius > 0.0 || is_inside(0.0)).then_some(self.kernel_radius))?;
        let point = self.fluid.projected(plus(self.center, inside + 0.5 * step, direction))?;
        let offset = difference(point.position, self.center);
        let squared = dot(offset, offset);
        (squared <= self.radius * self.radius).then(|| (point, squared.sqrt()))
    }
}

/// Points that are spread evenly over the unit sphere: a spiral whose turns follow the golden section.
fn fibonacci(index: usize, count: usize) -> [f64; 3] {
    let z = 1.0 - (2 * index + 1) as f64 / count as f64;
    let (sine, cosine) = (TAU * (index as f64 * 0.618_033_988_749_894_9).fract()).sin_cos();
    let radius = (1.0 - z * z).max(0.0).sqrt();
    [radius * cosine, radius * sine, z]
}
