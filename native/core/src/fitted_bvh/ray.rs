//! A ray within the scene, with what tests against boxes need.

use crate::simd::{Simd, Vector};

use super::hierarchy::Node;
use super::members::splat_point;
use super::wide::WideNode;

/// A ray. The surface is looked for from `t_min` to `t_max`.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// World space.
    pub origin: [f64; 3],
    /// Unit.
    pub direction: [f64; 3],
    /// Distance from the origin.
    pub t_min: f64,
    /// Distance from the origin, may be infinite.
    pub t_max: f64,
}

/// The part of a ray within the box of the root, from 0 to `length`, in scene coordinates and double precision.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// Where it begins; near the scene, however far the ray's origin is.
    pub start: [f64; 3],
    /// Unit.
    pub direction: [f64; 3],
    /// Distance of `start` from the ray's origin.
    pub t_start: f64,
    /// How long it is.
    pub length: f64,
    inverse: [f64; 3],
}

impl Segment {
    /// The part of a ray in a box, none where it misses.
    pub fn new(ray: &Ray, scene_origin: &[f64; 3], root: &Node) -> Option<Self> {
        let from = std::array::from_fn(|axis| ray.origin[axis] - scene_origin[axis]);
        let inverse = ray.direction.map(|d| 1.0 / d);
        let [enter, exit] = interval(&from, &inverse, root);
        let (t_start, t_end) = (enter.max(ray.t_min), exit.min(ray.t_max));
        (t_start <= t_end).then(|| Self {
            start: std::array::from_fn(|axis| from[axis] + t_start * ray.direction[axis]),
            direction: ray.direction,
            t_start,
            length: t_end - t_start,
            inverse,
        })
    }

    /// Where it is in a box, clipped to [0, `end`]; none where it misses.
    #[inline(always)]
    pub fn interval_in(&self, node: &Node, end: f64) -> Option<[f64; 2]> {
        let [enter, exit] = interval(&self.start, &self.inverse, node);
        let (enter, exit) = (enter.max(0.0), exit.min(end));
        (enter <= exit).then_some([enter, exit])
    }

    /// A point of it.
    #[inline(always)]
    pub fn at(&self, distance: f64) -> [f64; 3] {
        std::array::from_fn(|axis| self.start[axis] + distance * self.direction[axis])
    }
}

/// Where a line is in a box; the first greater than the second where it misses.
#[inline(always)]
fn interval(from: &[f64; 3], inverse: &[f64; 3], node: &Node) -> [f64; 2] {
    let (mut enter, mut exit) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let (low, high) = (f64::from(node.low[axis]) - from[axis], f64::from(node.high[axis]) - from[axis]);
        if inverse[axis].is_finite() {
            let (a, b) = (low * inverse[axis], high * inverse[axis]);
            enter = enter.max(a.min(b));
            exit = exit.min(a.max(b));
        } else if low > 0.0 || high < 0.0 {
            // Parallel to the sides, and not between them.
            exit = f64::NEG_INFINITY;
        }
    }
    [enter, exit]
}

/// A segment in single precision, for boxes of sixteen children. Whatever is rounded makes the boxes larger.
#[derive(Clone, Copy)]
pub struct BoxTest<S: Simd> {
    near_planes: [usize; 3],
    far_planes: [usize; 3],
    near_from: [S::Vector; 3],
    far_from: [S::Vector; 3],
    inverse: [S::Vector; 3],
    zero: S::Vector,
    longer: S::Vector,
}

/// Keeps products with differences of coordinates finite.
const MOST_INVERSE: f64 = 1e18;

/// More than the relative error of a distance.
const DISTANCE_ERROR: f32 = 8.0 * f32::EPSILON;

impl<S: Simd> BoxTest<S> {
    #[inline(always)]
    pub fn new(simd: S, segment: &Segment, root: &Node) -> Self {
        let is_negative = segment.direction.map(f64::is_sign_negative);
        let inverse = segment.inverse.map(|inverse| inverse.clamp(-MOST_INVERSE, MOST_INVERSE) as f32);
        // More than the start, which lies in the root, is off when it is rounded.
        let largest = root.low.iter().chain(&root.high).fold(0.0, |most: f32, c| most.max(c.abs()));
        let off = largest * (2.0 * f32::EPSILON);
        let shifted = |axis: usize, side: f32| segment.start[axis] as f32 + if is_negative[axis] { -side } else { side };
        let from = |side: f32| splat_point(simd, [shifted(0, side), shifted(1, side), shifted(2, side)]);
        Self {
            near_planes: std::array::from_fn(|axis| if is_negative[axis] { 3 + axis } else { axis }),
            far_planes: std::array::from_fn(|axis| if is_negative[axis] { axis } else { 3 + axis }),
            near_from: from(off),
            far_from: from(-off),
            inverse: splat_point(simd, inverse),
            zero: simd.splat(0.0),
            longer: simd.splat(1.0 + DISTANCE_ERROR),
        }
    }

    /// Which children the segment meets before `end`, and where it enters them.
    #[inline(always)]
    pub fn meets(&self, simd: S, node: &WideNode, end: S::Vector) -> (S::Mask, S::Vector) {
        let (mut enter, mut exit) = (self.zero, end);
        for axis in 0..3 {
            let near = simd.load(&node.planes[self.near_planes[axis]]);
            let far = simd.load(&node.planes[self.far_planes[axis]]);
            enter = enter.max((near - self.near_from[axis]) * self.inverse[axis]);
            exit = exit.min((far - self.far_from[axis]) * self.inverse[axis]);
        }
        (enter.le(exit * self.longer), enter)
    }
}
