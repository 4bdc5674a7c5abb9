//! What a particle draws, and where rays meet it.

use crate::bands::{Place, Placed};
use crate::glyphs::shape::Shape;
use crate::surface_particles::Particle;
use crate::surface_particles::fluid::Fluid;
use crate::tile_caster::View;
use crate::vectors::{difference, dot, double, plus};

/// A disc's radius in distances of the even spread that there is around its particle, and in reaches at least: what fills gaps
/// lets none be wider.
const RADIUS_SPACINGS: f64 = 1.2;
const RADIUS_REACHES: f64 = 0.65;

/// A disc that is blended says nothing where the surface would have turned away from its middle by more than this cosine.
pub const TURNED: f64 = 0.7;

/// What leads to the surface may turn as far as to its edge: where it leads nowhere the next sheet is looked at, and a tip that is
/// narrower than the discs around it has no other.
pub const TURNED_TO_EDGE: f64 = 0.0;

/// What lies farther behind the nearest disc than this, in radii of the disc, is another sheet.
pub const BLEND_BEHIND: f64 = 0.5;

/// A symmetric matrix: xx, yy, zz, xy, xz, yz.
type Symmetric = [f64; 6];

/// The part of the quadric `n . x + x A x / 2 = 0` that lies within a radius of its middle, where x counts from.
#[derive(Clone, Copy, Debug)]
pub struct Disc {
    pub middle: [f64; 3],
    /// n, unit, out of the fluid.
    pub normal: [f64; 3],
    /// A.
    pub bend: Symmetric,
    pub radius: f64,
    /// The least cosine between its normal in the middle and elsewhere.
    pub turned: f64,
}

/// A ray in the space of a disc.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub start: [f64; 3],
    /// Unit.
    pub direction: [f64; 3],
}

/// Where a ray meets a disc.
#[derive(Clone, Copy, Debug)]
pub struct Meeting {
    /// Along the ray.
    pub distance: f64,
    /// Unit, out of the fluid.
    pub normal: [f64; 3],
    /// In the blend, at most 1.
    pub weight: f64,
}

impl Disc {
    /// In world space; None where the particle is no longer on the surface. `reach` is how far particles push one another, in
    /// influence radii.
    pub fn new(fluid: &Fluid, particle: &Particle, reach: f64, turned: f64) -> Option<Self> {
        // Particles have single precision.
        let place = fluid.projected(double(particle.position))?;
        let radius = (RADIUS_SPACINGS * f64::from(particle.spacing)).max(RADIUS_REACHES * reach * f64::from(particle.scale));
        let bend = bend(place.normal, fluid.second_derivatives(place.position), fluid.sample(place.position).gradient);
        Some(Self { middle: place.position, normal: place.normal, bend, radius, turned })
    }

    /// In camera space.
    #[inline(always)]
    pub fn in_view(&self, view: &View) -> Self {
        let turn = |vector: [f64; 3]| view.camera_from_world.map(|row| dot(row, vector));
        let [right, up, forward] = view.camera_from_world;
        let bent = |one: [f64; 3], other: [f64; 3]| dot(one, times(&self.bend, other));
        Self {
            middle: turn(difference(self.middle, view.eye)),
            normal: turn(self.normal),
            bend: [
                bent(right, right),
                bent(up, up),
                bent(forward, forward),
                bent(right, up),
                bent(right, forward),
                bent(up, forward),
            ],
            radius: self.radius,
            turned: self.turned,
        }
    }

    /// The first point between the clip depths, in camera space, at which a ray comes from outside; from inside where it starts
    /// there.
    #[inline(always)]
    pub fn meeting(&self, ray: &Ray, starts_inside: bool, clip: [f64; 2]) -> Option<Meeting> {
        let offset = difference(ray.start, self.middle);
        // From the ray's nearest point, so that little is subtracted from little.
        let along = -dot(offset, ray.direction);
        let nearest = plus(offset, along, ray.direction);
        let (bent, radius_2) = (times(&self.bend, ray.direction), self.radius * self.radius);
        if dot(nearest, nearest) >= radius_2 {
            return None;
        }
        let square = dot(ray.direction, bent);
        let linear = dot(self.normal, ray.direction) + dot(nearest, bent);
        let constant = dot(self.normal, nearest) + 0.5 * dot(nearest, times(&self.bend, nearest));
        for root in roots(square, linear, constant) {
            let place = plus(nearest, root, ray.direction);
            let normal = plus(self.normal, 1.0, times(&self.bend, place));
            let share = dot(place, place) / radius_2;
            let depth = (along + root) * ray.direction[2] + ray.start[2];
            let is_between = depth >= clip[0] && depth <= clip[1];
            let is_near = share < 1.0 && dot(normal, self.normal) > self.turned * dot(normal, normal).sqrt();
            if is_near && is_between && (dot(normal, ray.direction) > 0.0) == starts_inside {
                let length = dot(normal, normal).sqrt();
                let normal = normal.map(|c| c / length);
                return Some(Meeting { distance: along + root, normal, weight: (1.0 - share) * (1.0 - share) });
            }
        }
        None
    }

    /// Whether no ray from outside can meet it because all of it looks away from the camera.
    #[inline(always)]
    fn looks_away(&self, view: &View) -> bool {
        // How far the normal turns over the disc, at most.
        let turn = self.radius
            * self.bend.iter().zip([1.0, 1.0, 1.0, 2.0, 2.0, 2.0]).map(|(c, times)| times * c * c).sum::<f64>().sqrt();
        if !view.is_perspective {
            return dot(view.camera_from_world[2], self.normal) > turn;
        }
        let to_middle = difference(self.middle, view.eye);
        let distance = dot(to_middle, to_middle).sqrt();
        dot(self.normal, to_middle) > turn * distance + (1.0 + turn) * self.radius
    }
}

/// Discs as an image has them.
pub struct Shown<'a> {
    /// World space.
    pub discs: &'a [Disc],
    pub can_start_inside: bool,
}

impl Placed for Shown<'_> {
    fn count(&self) -> usize {
        self.discs.len()
    }

    #[inline(always)]
    fn place(&self, index: usize, view: &View) -> Option<Place> {
        let disc = &self.discs[index];
        if !self.can_start_inside && disc.looks_away(view) {
            return None;
        }
        let offset = difference(disc.middle, view.eye);
        let center = view.camera_from_world.map(|row| dot(row, offset));
        let radius = disc.radius;
        Shape { center, axes: [[radius, 0.0, 0.0], [0.0, radius, 0.0], [0.0, 0.0, radius]] }.place(view)
    }
}

/// How the surface bends where its unit normal is n: A such that it is `n . x + x A x / 2 = 0` near there. Along the surface A
/// is how the normal changes, `-P H P / |grad F|` with the second derivatives H of F and `P = I - n n^T`; along the normal it
/// is the mean of that, which is right for spheres. 0 where there is no gradient.
pub fn bend(normal: [f64; 3], [xx, yy, zz, xy, xz, yz]: Symmetric, gradient: [f64; 3]) -> Symmetric {
    let change = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let flat = axes.map(|axis| plus(axis, -dot(axis, normal), normal));
    let slope = dot(gradient, gradient).sqrt();
    let shape = |one: usize, other: usize| -dot(flat[one], change.map(|row| dot(row, flat[other]))) / slope;
    let mean = (shape(0, 0) + shape(1, 1) + shape(2, 2)) / 2.0;
    let bend = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
        .map(|(one, other)| shape(one, other) + mean * normal[one] * normal[other]);
    if bend.iter().all(|number| number.is_finite()) { bend } else { [0.0; 6] }
}

/// The product of a matrix and a vector.
#[inline(always)]
fn times([xx, yy, zz, xy, xz, yz]: &Symmetric, [x, y, z]: [f64; 3]) -> [f64; 3] {
    [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z]
}

/// The roots of `square t^2 / 2 + linear t + constant`, the smaller first; infinite where there is none.
#[inline(always)]
fn roots(square: f64, linear: f64, constant: f64) -> [f64; 2] {
    let rest = linear * linear - 2.0 * square * constant;
    if rest < 0.0 {
        return [f64::INFINITY; 2];
    }
    let sum = -(linear + rest.sqrt().copysign(linear));
    let one = if square != 0.0 { sum / square } else { f64::INFINITY };
    let other = if sum != 0.0 { 2.0 * constant / sum } else { 0.0 };
    [one.min(other), one.max(other)]
}
