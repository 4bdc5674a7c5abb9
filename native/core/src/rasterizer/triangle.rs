//! One triangle in camera space: x to the right, y up, planar depth.

use super::{Place, View};

/// Its corners.
pub type Corners = [[f64; 3]; 3];

/// Its edge functions: for the ray of a pixel, each corner's share of the point that it meets, but for a common factor.
pub struct Edges {
    functions: [[f64; 3]; 3],
    /// Depth by the sum of the shares (perspective), or the depths of the corners (orthographic).
    volume: f64,
    depths: Option<[f64; 3]>,
}

impl Edges {
    /// Of a triangle that rays from the eye, or parallel ones, meet.
    #[inline(always)]
    pub fn new(corners: &Corners, is_perspective: bool) -> Self {
        let flat = |corner: [f64; 3]| if is_perspective { corner } else { [corner[0], corner[1], 1.0] };
        let [a, b, c] = corners.map(flat);
        let functions = [cross(b, c), cross(c, a), cross(a, b)];
        let volume = super::dot(a, functions[0]);
        Self { functions, volume, depths: if is_perspective { None } else { Some(corners.map(|corner| corner[2])) } }
    }

    /// The planar depth at which the ray of a place in the window meets the triangle, if it does.
    #[inline(always)]
    pub fn depth(&self, place: [f64; 2]) -> Option<f64> {
        let values = self.values(place);
        let is_inside = values.iter().all(|value| *value >= 0.0) || values.iter().all(|value| *value <= 0.0);
        let sum = values[0] + values[1] + values[2];
        if !is_inside || sum == 0.0 {
            return None;
        }
        Some(match self.depths {
            None => self.volume / sum,
            Some(depths) => super::dot(depths, values) / sum,
        })
    }

    /// The shares of the corners in the point that the ray of a place in the window meets.
    pub fn shares(&self, place: [f64; 2]) -> [f64; 3] {
        let values = self.values(place);
        let sum = values[0] + values[1] + values[2];
        values.map(|value| value / sum)
    }

    #[inline(always)]
    fn values(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        self.functions.map(|function| function[0] * x + function[1] * y + function[2])
    }
}

/// The normal of a triangle, in camera space and of any length, that faces the ray of a place in the window.
pub fn facing([a, b, c]: &Corners, place: [f64; 2], view: &View) -> [f64; 3] {
    let side = |end: &[f64; 3]| [end[0] - a[0], end[1] - a[1], end[2] - a[2]];
    let normal = cross(side(b), side(c));
    let ray = if view.is_perspective { [place[0], place[1], 1.0] } else { [0.0, 0.0, 1.0] };
    if super::dot(normal, ray) > 0.0 { normal.map(|part| -part) } else { normal }
}

/// The pixels whose rays may meet a triangle between the clip depths.
pub fn place(corners: &Corners, view: &View) -> Place {
    let depths = corners.map(|corner| corner[2]);
    let (near, far) = (least(depths), greatest(depths));
    let is_finite = corners.iter().flatten().all(|number| number.is_finite());
    if !is_finite || far < view.clip[0] || near > view.clip[1] {
        return Place::default();
    }
    if view.is_perspective && near <= 1e-6 * far.abs() {
        // It reaches to the eye or behind it, and may be seen anywhere.
        return if far <= 0.0 { Place::default() } else { whole(view) };
    }
    let scaled = |axis: usize| corners.map(|corner| if view.is_perspective { corner[axis] / corner[2] } else { corner[axis] });
    let [width, height] = view.pixel_size();
    Place {
        columns: pixels(scaled(0), view.window[0], width, view.width),
        rows: pixels(scaled(1), view.window[2], height, view.height),
    }
}

fn whole(view: &View) -> Place {
    Place { columns: [0, view.width as u16], rows: [0, view.height as u16] }
}

/// Pixels whose centres lie between coordinates, and one more to each side for rounding.
fn pixels(values: [f64; 3], start: f64, size: f64, count: usize) -> [u16; 2] {
    let first = ((least(values) - start) / size - 1.5).floor();
    let end = ((greatest(values) - start) / size + 1.5).ceil();
    [first, end].map(|bound| bound.clamp(0.0, count as f64) as u16)
}

fn least(values: [f64; 3]) -> f64 {
    values[0].min(values[1]).min(values[2])
}

fn greatest(values: [f64; 3]) -> f64 {
    values[0].max(values[1]).max(values[2])
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
