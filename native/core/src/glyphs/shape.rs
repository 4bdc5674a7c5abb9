//! One glyph in camera space: x to the right, y up, planar depth; and where rays meet it.

use super::{View, cross, dot};
use crate::bands::Place;

/// An ellipsoid: the points `center + sum_k s_k axes_k` with |s| at most 1.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    pub center: [f64; 3],
    /// Three semi-axes at right angles.
    pub axes: [[f64; 3]; 3],
}

/// Rays on which the glyph is the unit sphere about the origin: that of a place (x, y) in the window is `z direction - start` at
/// the planar depth z, where one of both is linear in the place, and the other the same for all.
#[derive(Clone, Copy)]
pub struct Rays {
    /// Rows: the axes by their squared lengths, which turn camera space into that of the unit sphere.
    unit_from_camera: [[f64; 3]; 3],
    /// The centre there.
    center: [f64; 3],
    is_perspective: bool,
}

/// A ray, as [`Rays`] has it.
#[derive(Clone, Copy)]
pub struct Ray {
    pub direction: [f64; 3],
    pub start: [f64; 3],
}

impl Rays {
    #[inline(always)]
    pub fn new(shape: &Shape, is_perspective: bool) -> Self {
        let unit_from_camera = shape.axes.map(|axis| {
            let length_2 = dot(axis, axis);
            axis.map(|part| part / length_2)
        });
        Self { unit_from_camera, center: unit_from_camera.map(|row| dot(row, shape.center)), is_perspective }
    }

    /// The ray of a place in the window.
    #[inline(always)]
    pub fn at(&self, x: f64, y: f64) -> Ray {
        let rows = &self.unit_from_camera;
        let across = [0, 1, 2].map(|axis| rows[axis][0] * x + rows[axis][1] * y);
        let forward = [rows[0][2], rows[1][2], rows[2][2]];
        if self.is_perspective {
            Ray { direction: [0, 1, 2].map(|axis| across[axis] + forward[axis]), start: self.center }
        } else {
            Ray { direction: forward, start: [0, 1, 2].map(|axis| self.center[axis] - across[axis]) }
        }
    }

    /// The rays of a row of places, of which `middle` is one within the glyph's rectangle.
    #[inline(always)]
    pub fn row(&self, middle: f64, y: f64) -> Row {
        let Ray { direction, start } = self.at(middle, y);
        let column = [0, 1, 2].map(|axis| self.unit_from_camera[axis][0]);
        // What direction and start gain with x.
        let (turn, shift) = if self.is_perspective { (column, [0.0; 3]) } else { ([0.0; 3], column.map(|part| -part)) };
        let (apart, turned, shifted) = (cross(direction, start), cross(turn, start), cross(direction, shift));
        let gain = [0, 1, 2].map(|axis| turned[axis] + shifted[axis]);
        let length_2 = [dot(direction, direction), 2.0 * dot(direction, turn), dot(turn, turn)];
        let apart_2 = [dot(apart, apart), 2.0 * dot(apart, gain), dot(gain, gain)];
        Row {
            middle,
            length_2,
            along: [dot(direction, start), dot(turn, start) + dot(direction, shift)],
            rest: [0, 1, 2].map(|power| length_2[power] - apart_2[power]),
        }
    }

    /// The normal where a ray meets the surface at a planar depth: camera space, of any length, out of the glyph.
    #[inline(always)]
    pub fn normal(&self, ray: &Ray, depth: f64) -> [f64; 3] {
        let point = [0, 1, 2].map(|axis| depth * ray.direction[axis] - ray.start[axis]);
        let rows = &self.unit_from_camera;
        [0, 1, 2].map(|axis| rows[0][axis] * point[0] + rows[1][axis] * point[1] + rows[2][axis] * point[2])
    }
}

/// A row of rays on which the glyph is met where a quadratic is not negative. All numbers are of places relative to one within
/// the glyph's rectangle, so that no square of a large number takes the digits of a small one.
#[derive(Clone, Copy)]
pub struct Row {
    /// The place in the window that x is relative to.
    pub middle: f64,
    /// `|direction|^2` and `direction . start`: the line is nearest to the centre at the planar depth of their ratio.
    length_2: [f64; 3],
    along: [f64; 2],
    /// `|direction|^2 - |direction x start|^2`: the root of it by `|direction|^2` is half the chord.
    rest: [f64; 3],
}

impl Row {
    /// The planar depth at which the ray of a place meets the surface first between the clip depths; infinity where it does not.
    #[inline(always)]
    pub fn crossing(&self, x: f64, clip: [f64; 2]) -> f64 {
        let x = x - self.middle;
        let inverse = 1.0 / (self.length_2[0] + x * (self.length_2[1] + x * self.length_2[2]));
        let middle = self.along[0] + x * self.along[1];
        // Not a number where the line misses, which fails each comparison.
        let half = (self.rest[0] + x * (self.rest[1] + x * self.rest[2])).sqrt();
        let (front, back) = ((middle - half) * inverse, (middle + half) * inverse);
        let first = if front >= clip[0] { front } else { back };
        if (first >= clip[0]) & (first <= clip[1]) { first } else { f64::INFINITY }
    }
}

impl Ray {
    /// The planar depth of that crossing of the line and the surface which is nearer to `depth`.
    #[inline(always)]
    pub fn crossing_near(&self, depth: f64) -> f64 {
        let length_2 = dot(self.direction, self.direction);
        // How far the line passes the centre: of the difference of two squares nothing would remain in far views.
        let apart = cross(self.direction, self.start);
        let half = ((1.0 - dot(apart, apart) / length_2).max(0.0) / length_2).sqrt();
        let middle = dot(self.direction, self.start) / length_2;
        if depth < middle { middle - half } else { middle + half }
    }
}

impl Shape {
    /// The pixels whose rays may meet it between the clip depths, if there are any.
    #[inline(always)]
    pub fn place(&self, view: &View) -> Option<Place> {
        let reach = self.reach_2(2, 2).sqrt();
        let [near, far] = [self.center[2] - reach, self.center[2] + reach];
        if !(far >= view.clip[0] && near <= view.clip[1] && far.is_finite()) {
            return None;
        }
        Place::of_window([self.extent(0, view.is_perspective), self.extent(1, view.is_perspective)], view)
    }

    /// A planar depth before which no ray meets it.
    #[inline(always)]
    pub fn front(&self) -> f64 {
        self.center[2] - self.reach_2(2, 2).sqrt()
    }

    /// An element of the matrix of the axes by its own transpose.
    #[inline(always)]
    fn reach_2(&self, one: usize, other: usize) -> f64 {
        self.axes[0][one] * self.axes[0][other]
            + self.axes[1][one] * self.axes[1][other]
            + self.axes[2][one] * self.axes[2][other]
    }

    /// Where in the window it begins and ends along an axis.
    ///
    /// In perspective between the tangent planes through the eye, which are roots of a quadratic: the plane with the normal
    /// `n = (1, 0, -x)` is tangent where `(n . center)^2 = |axes n|^2`. What reaches behind the eye may be anywhere.
    #[inline(always)]
    fn extent(&self, axis: usize, is_perspective: bool) -> [f64; 2] {
        let (across, depth) = (self.center[axis], self.center[2]);
        let (own, mixed, deep) = (self.reach_2(axis, axis), self.reach_2(axis, 2), self.reach_2(2, 2));
        if !is_perspective {
            return [across - own.sqrt(), across + own.sqrt()];
        }
        let clearance = depth * depth - deep;
        if !(clearance > 0.0 && depth > 0.0) {
            return [f64::NEG_INFINITY, f64::INFINITY];
        }
        // The determinant of 2 x 2 reaches is not negative; without it the extent is never too small.
        let square = depth * depth * own - 2.0 * across * depth * mixed + across * across * deep;
        let root = (square - (own * deep - mixed * mixed)).max(0.0).sqrt();
        let middle = across * depth - mixed;
        [(middle - root) / clearance, (middle + root) / clearance]
    }
}
