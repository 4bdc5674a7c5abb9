//! Points all over the surface, found from the balls alone: where rays from a ball's centre leave the fluid within its influence
//! sphere. Every part of the surface has balls that reach it, so none is missed, whoever looks from where.
//!
//! Rays into the kernel sphere of another ball are left to that. No point of the surface loses all of its rays by this, where no
//! ball takes density away: of the balls that reach the point let `i` have the kernel sphere that is nearest to it. If the ray from
//! there left that sphere within another one, of `j`, this would be nearer to the point, by the triangle inequality; and so `j` would
//! reach it as well, where its influence sphere is at least as far from its kernel sphere as that of `i` is.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::error::Result;
use crate::job::Job;
use crate::memory;
use crate::tracing::random::{any_direction, branch};
use crate::vectors::{along, difference, dot, plus, tangents};

use super::fluid::{Fluid, SurfacePoint};

/// Directions of a ball at least: a part of it that is seen between others is missed where it is smaller than their distance.
const FEWEST: usize = 256;

/// Directions of a ball at most.
const MOST: usize = 1 << 16;

/// Rays of a ball that are cast first, at least, where it has as many.
const FIRST: usize = 5;

/// Of so many rays one is cast first, at least.
const SPARSEST: usize = 6;

/// Balls that a thread takes at a time.
const PART: usize = 64;

/// Where a ray is looked at between the kernel sphere and the influence sphere.
const STEPS: usize = 6;

/// Rounding, of the cosine of what another ball hides.
const SLACK: f64 = 1e-6;

/// The least cosine between a ray and the normal by which the surface counts.
const FLATTEST: f64 = 0.1;

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
    let directions = fibonacci(((2.0 * TAU / (spacing * spacing)) as usize).clamp(FEWEST, MOST))?;
    let kernel_radii = kernel_radii(fluid)?;
    let parts = fluid.len().div_ceil(PART);
    job.expect(parts);
    let of_part = |part: usize| {
        let (mut points, mut scratch) = (Vec::new(), Scratch::default());
        for ball in part * PART..((part + 1) * PART).min(fluid.len()) {
            let rays = Rays::of(fluid, &kernel_radii, ball, branch(seed, ball as u32));
            of_ball(&rays, &directions, &look_at, &mut scratch, &mut points)?;
        }
        job.advance(1)?;
        Ok(points)
    };
    let found: Vec<Vec<SurfacePoint>> = (0..parts).into_par_iter().map(of_part).collect::<Result<_>>()?;
    let mut points = memory::with_capacity(found.iter().map(Vec::len).sum())?;
    found.into_iter().for_each(|part| points.extend(part));
    Ok(points)
}

/// How large the surface is, about, in squares of the influence radii of the balls that it is of; more, where rays of several balls
/// meet it.
///
/// # Errors
/// `OutOfMemory`.
pub fn exposed_area(fluid: &Fluid, seed: u32) -> Result<f64> {
    let directions = fibonacci(FEWEST)?;
    let kernel_radii = kernel_radii(fluid)?;
    let of_part = |part: usize| {
        let (mut area, mut scratch, mut points) = (0.0, Scratch::default(), Vec::new());
        for ball in part * PART..((part + 1) * PART).min(fluid.len()) {
            let rays = Rays::of(fluid, &kernel_radii, ball, branch(seed, ball as u32));
            rays.find_open(&directions, &mut scratch)?;
            for direction in &scratch.open {
                points.clear();
                rays.cast(*direction, &mut points)?;
                let seen = points.iter().map(|point| rays.area_around(point, *direction));
                area += seen.sum::<f64>() * 2.0 * TAU / FEWEST as f64;
            }
        }
        Ok(area)
    };
    // Summed in one order, whatever threads do.
    let areas: Vec<f64> = (0..fluid.len().div_ceil(PART)).into_par_iter().map(of_part).collect::<Result<_>>()?;
    Ok(areas.into_iter().sum())
}

/// Adds the points around a ball.
fn of_ball(
    rays: &Rays<'_>,
    directions: &[[f64; 3]],
    look_at: &impl Fn(&SurfacePoint) -> bool,
    scratch: &mut Scratch,
    points: &mut Vec<SurfacePoint>,
) -> Result<()> {
    rays.find_open(directions, scratch)?;
    let before = points.len();
    let every = (scratch.open.len() / FIRST).clamp(1, SPARSEST);
    for direction in scratch.open.iter().step_by(every) {
        rays.cast(*direction, points)?;
    }
    if points[before..].iter().any(look_at) {
        let others = scratch.open.iter().enumerate().filter(|(index, _)| index % every != 0);
        others.map(|(_, direction)| direction).try_for_each(|direction| rays.cast(*direction, points))?;
    }
    Ok(())
}

/// Memory for a ball after the other.
#[derive(Default)]
struct Scratch {
    caps: Vec<Cap>,
    /// Directions that no other ball hides.
    open: Vec<[f64; 3]>,
}

/// Directions in which a ball's kernel sphere is within that of another.
#[derive(Clone, Copy)]
struct Cap {
    axis: [f64; 3],
    /// Of the angle to the axis from which on they are not.
    cosine: f64,
}

/// Rays from a ball's centre.
struct Rays<'a> {
    fluid: &'a Fluid,
    /// Of all balls.
    kernel_radii: &'a [f64],
    center: [f64; 3],
    radius: f64,
    /// Up to here they are in the fluid.
    kernel_radius: f64,
    pole: [f64; 3],
}

impl<'a> Rays<'a> {
    fn of(fluid: &'a Fluid, kernel_radii: &'a [f64], ball: usize, seed: u32) -> Self {
        let (center, radius, _) = fluid.ball(ball);
        Self { fluid, kernel_radii, center, radius, kernel_radius: kernel_radii[ball], pole: any_direction(seed) }
    }

    /// Of directions around the pole those that no other ball hides, in world space.
    fn find_open(&self, directions: &[[f64; 3]], scratch: &mut Scratch) -> Result<()> {
        let Scratch { caps, open } = scratch;
        open.clear();
        if !self.find_caps(caps)? {
            return Ok(());
        }
        memory::reserve(open, directions.len())?;
        let is_open = |direction: &&[f64; 3]| !caps.iter().any(|cap| dot(**direction, cap.axis) > cap.cosine);
        open.extend(directions.iter().filter(is_open).map(|direction| along(self.pole, *direction)));
        Ok(())
    }

    /// Finds what others hide, in the frame of the pole, the widest first. False where one hides all.
    fn find_caps(&self, caps: &mut Vec<Cap>) -> Result<bool> {
        caps.clear();
        let (own, margin) = (self.kernel_radius, self.radius - self.kernel_radius);
        let [right, up] = tangents(self.pole);
        let (mut hides_all, mut has_memory) = (false, Ok(()));
        self.fluid.hash().for_near(self.center, |other| {
            let (center, radius, _) = self.fluid.ball(other);
            let kernel_radius = self.kernel_radii[other];
            if radius - kernel_radius < margin {
                return;
            }
            let offset = difference(center, self.center);
            let squared = dot(offset, offset);
            let distance = squared.sqrt();
            if distance + own < kernel_radius {
                hides_all = true;
            } else if kernel_radius > (distance - own).abs() && has_memory.is_ok() {
                has_memory = memory::reserve(caps, 1);
                if has_memory.is_err() {
                    return;
                }
                let axis = [right, up, self.pole].map(|side| dot(side, offset) / distance);
                let cosine = (own * own + squared - kernel_radius * kernel_radius) / (2.0 * own * distance);
                caps.push(Cap { axis, cosine: cosine + SLACK });
            }
        });
        has_memory?;
        caps.sort_unstable_by(|one, other| one.cosine.total_cmp(&other.cosine));
        Ok(!hides_all)
    }

    /// Adds the points where a ray leaves the fluid before the end of the influence sphere.
    fn cast(&self, direction: [f64; 3], points: &mut Vec<SurfacePoint>) -> Result<()> {
        let step = (self.radius - self.kernel_radius) / STEPS as f64;
        let is_inside = |distance: f64| self.fluid.is_inside(plus(self.center, distance, direction));
        // The kernel sphere itself is decided by no rounding.
        let mut was_inside = self.kernel_radius > 0.0 || is_inside(0.0);
        for count in 1..=STEPS {
            let distance = self.kernel_radius + count as f64 * step;
            let is_inside = is_inside(distance);
            if was_inside && !is_inside {
                let point = self.fluid.projected(plus(self.center, distance - 0.5 * step, direction));
                memory::reserve(points, 1)?;
                points.extend(point.filter(|point| self.squared_distance(point) <= self.radius * self.radius));
            }
            was_inside = is_inside;
        }
        Ok(())
    }

    /// The surface for each part of the unit sphere, in squares of influence radii.
    fn area_around(&self, point: &SurfacePoint, direction: [f64; 3]) -> f64 {
        self.squared_distance(point) / (self.radius * self.radius * dot(point.normal, direction).max(FLATTEST))
    }

    fn squared_distance(&self, point: &SurfacePoint) -> f64 {
        let offset = difference(point.position, self.center);
        dot(offset, offset)
    }
}

/// The radii of the balls' kernel spheres; 0 where some take density away, so that there may be none.
fn kernel_radii(fluid: &Fluid) -> Result<Vec<f64>> {
    let mut radii = memory::filled(0.0, fluid.len())?;
    if !fluid.carves() {
        radii.par_iter_mut().enumerate().for_each(|(ball, kernel_radius)| {
            let (_, radius, weight) = fluid.ball(ball);
            *kernel_radius = radius * fluid.field().kernel_radius_share(weight);
        });
    }
    Ok(radii)
}

/// Directions that are spread evenly: a spiral whose turns follow the golden section.
fn fibonacci(count: usize) -> Result<Vec<[f64; 3]>> {
    let mut directions = memory::with_capacity(count)?;
    directions.extend((0..count).map(|index| {
        let z = 1.0 - (2 * index + 1) as f64 / count as f64;
        let (sine, cosine) = (TAU * (index as f64 * 0.618_033_988_749_894_9).fract()).sin_cos();
        let radius = (1.0 - z * z).max(0.0).sqrt();
        [radius * cosine, radius * sine, z]
    }));
    Ok(directions)
}
