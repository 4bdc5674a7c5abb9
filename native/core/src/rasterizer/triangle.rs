//! One triangle in camera space: x to the right, y up, planar depth.

use super::{View, dot};
use crate::bands::Place;

/// Its corners.
pub type Corners = [[f64; 3]; 3];

/// Its edge functions: for the ray of a place in the window, each corner's share of the point that it meets, but for a common
/// factor.
#[derive(Clone, Copy)]
pub struct Edges {
    pub functions: [[f64; 3]; 3],
    /// Of the corners.
    pub depths: [f64; 3],
}

impl Edges {
    /// Of a triangle that rays from the eye, or parallel ones, meet.
    #[inline(always)]
    pub fn new(corners: &Corners, is_perspective: bool) -> Self {
        let flat = |corner: [f64; 3]| if is_perspective { corner } else { [corner[0], corner[1], 1.0] };
        let [a, b, c] = [flat(corners[0]), flat(corners[1]), flat(corners[2])];
        let functions = [cross(b, c), cross(c, a), cross(a, b)];
        Self { functions, depths: [corners[0][2], corners[1][2], corners[2][2]] }
    }

    /// Whether no place of a rectangle of the window is inside.
    ///
    /// Rounding keeps the order of numbers, so that no value inside is beyond those at the corners, to the last bit.
    #[inline(always)]
    pub fn miss(&self, columns: [f64; 2], rows: [f64; 2]) -> bool {
        let (mut is_never_positive, mut is_never_negative) = (false, false);
        for function in &self.functions {
            let (right, up) = (usize::from(function[0] > 0.0), usize::from(function[1] > 0.0));
            is_never_positive |= value(function, columns[right], rows[up]) < 0.0;
            is_never_negative |= value(function, columns[1 - right], rows[1 - up]) > 0.0;
        }
        is_never_positive && is_never_negative
    }

    /// The values at a place in the window; those of a place inside are all of one sign.
    #[inline(always)]
    pub fn values(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        [value(&self.functions[0], x, y), value(&self.functions[1], x, y), value(&self.functions[2], x, y)]
    }
}

#[inline(always)]
fn value(function: &[f64; 3], x: f64, y: f64) -> f64 {
    function[0] * x + function[1] * y + function[2]
}

/// The normal of a triangle in world space, of any length; of the side on which its corners run counterclockwise.
#[inline(always)]
pub fn plane_normal([a, b, c]: &Corners, view: &View) -> [f64; 3] {
    let side = |end: &[f64; 3]| [end[0] - a[0], end[1] - a[1], end[2] - a[2]];
    let normal = cross(side(b), side(c));
    let rows = &view.camera_from_world;
    [0, 1, 2].map(|axis| dot(normal, [rows[0][axis], rows[1][axis], rows[2][axis]]))
}

/// The pixels whose rays may meet a triangle between the clip depths, if there are any.
#[inline(always)]
pub fn place(corners: &Corners, view: &View) -> Option<Place> {
    let depths = [corners[0][2], corners[1][2], corners[2][2]];
    let (near, far) = (least(depths), greatest(depths));
    let is_between = far >= view.clip[0] && near <= view.clip[1] && (far > 0.0 || !view.is_perspective);
    if !(is_between && corners.as_flattened().iter().all(|number| number.is_finite())) {
        return None;
    }
    let window = if !view.is_perspective {
        [0, 1].map(|axis| [corners[0][axis], corners[1][axis], corners[2][axis]]).map(range)
    } else if near > 0.0 && near >= view.clip[0] {
        [0, 1].map(|axis| [0, 1, 2].map(|corner: usize| corners[corner][axis] / depths[corner])).map(range)
    } else if view.clip[0] > 0.0 {
        beyond(corners, view.clip[0])
    } else {
        // What reaches to the eye may be seen anywhere.
        [[view.window[0], view.window[1]], [view.window[2], view.window[3]]]
    };
    Place::of_window(window, view)
}

/// Where in a perspective window the part of a triangle lies that is beyond a depth: least and greatest x and y.
fn beyond(corners: &Corners, start: f64) -> [[f64; 2]; 2] {
    let mut ranges = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    let mut include = |point: [f64; 2], depth: f64| {
        for (range, number) in ranges.iter_mut().zip(point) {
            *range = [range[0].min(number / depth), range[1].max(number / depth)];
        }
    };
    for (from, to) in [(0, 1), (1, 2), (2, 0)] {
        let (from, to) = (corners[from], corners[to]);
        if from[2] >= start {
            include([from[0], from[1]], from[2]);
        }
        if (from[2] < start) != (to[2] < start) {
            let share = (start - from[2]) / (to[2] - from[2]);
            include([0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis])), start);
        }
    }
    ranges
}

#[inline(always)]
fn range(values: [f64; 3]) -> [f64; 2] {
    [least(values), greatest(values)]
}

#[inline(always)]
fn least(values: [f64; 3]) -> f64 {
    values[0].min(values[1]).min(values[2])
}

#[inline(always)]
fn greatest(values: [f64; 3]) -> f64 {
    values[0].max(values[1]).max(values[2])
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
