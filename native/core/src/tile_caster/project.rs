//! Moves balls into camera space, sixteen at a time, and finds the pixels that their influence spheres may cover.

use super::view::View;
use crate::balls::Balls;
use crate::simd::{LANES, Lanes, Mask, Simd, Vector};

/// How much wider than computed a ball's rectangle is, pixels and share of the image: rounding must not lose one.
const PIXEL_MARGIN: [f32; 2] = [0.01, 1e-5];

/// Share of a ball's distance that float32 may get wrong.
pub const DISTANCE_ERROR: f32 = 1e-6;

/// Camera space of sixteen balls.
pub struct Projected {
    /// x, y and planar depth of the centres.
    pub center: [Lanes; 3],
    /// Influence radii.
    pub radius: Lanes,
    /// q.
    pub weight: Lanes,
    /// Distance of the centre along a ray through it: from the eye, or planar for parallel rays.
    pub distance: Lanes,
}

impl Projected {
    /// Distances before which no ray meets the influence spheres.
    #[inline(always)]
    pub fn front<S: Simd>(&self, simd: S) -> S::Vector {
        let (distance, zero) = (simd.load(&self.distance), simd.splat(0.0));
        let error = distance.max(zero - distance) * simd.splat(DISTANCE_ERROR);
        distance - error - simd.load(&self.radius)
    }
}

/// First and last column and row of pixels, whole numbers; sixteen balls' rectangles.
#[derive(Clone, Copy)]
pub struct Rectangles {
    pub x_min: Lanes,
    pub x_max: Lanes,
    pub y_min: Lanes,
    pub y_max: Lanes,
}

impl Rectangles {
    /// First and last columns, first and last rows.
    #[inline(always)]
    pub fn sides(&self) -> [&Lanes; 4] {
        [&self.x_min, &self.x_max, &self.y_min, &self.y_max]
    }

    /// First and last column, first and last row of one that is not empty.
    #[inline(always)]
    pub fn pixels(&self, lane: usize) -> [u16; 4] {
        self.sides().map(|side| side.0[lane] as u16)
    }
}

/// What projecting needs of a view, in the form that it needs.
#[derive(Clone, Copy)]
pub struct Projector {
    rows: [[f64; 3]; 3],
    eye: [f64; 3],
    is_perspective: bool,
    clip: [f32; 2],
    /// Left and bottom of the window.
    origin: [f32; 2],
    /// Pixels for each unit of the window.
    scale: [f32; 2],
    size: [f32; 2],
}

impl Projector {
    pub fn new(view: &View) -> Self {
        let pixel = view.pixel_size();
        Self {
            rows: view.camera_from_world,
            eye: view.eye,
            is_perspective: view.is_perspective,
            clip: view.clip.map(|clip| clip as f32),
            origin: [view.window[0] as f32, view.window[2] as f32],
            scale: pixel.map(|size| (1.0 / size) as f32),
            size: [view.width as f32, view.height as f32],
        }
    }

    /// Projects the balls from `first` on, at most sixteen; lanes beyond the last repeat it.
    #[inline(always)]
    pub fn project<S: Simd>(&self, simd: S, balls: &Balls<'_>, first: usize) -> Projected {
        let (positions, radius, weight) = sixteen(balls, first);
        // In double precision: only the subtraction of the eye makes coordinates small. In plain loops, which compilers turn
        // into vectors with the path's instructions; in a closure they would not have them.
        let mut center = [Lanes::splat(0.0); 3];
        for (axis, row) in center.iter_mut().zip(&self.rows) {
            for (turned, [x, y, z]) in axis.0.iter_mut().zip(positions) {
                let (x, y, z) = (f64::from(x) - self.eye[0], f64::from(y) - self.eye[1], f64::from(z) - self.eye[2]);
                *turned = (row[0] * x + row[1] * y + row[2] * z) as f32;
            }
        }
        let [x, y, depth] = center.each_ref().map(|lanes| simd.load(lanes));
        let distance = if self.is_perspective { x.mul_add(x, y.mul_add(y, depth * depth)).sqrt() } else { depth };
        Projected { center, radius, weight, distance: distance.lanes() }
    }

    /// The pixels that influence spheres may cover, and a bit for each of the `count` balls that may be seen at all.
    ///
    /// The tangents from the eye in each axis' plane (Kanamori et al. 2008, appendix B). A sphere that reaches behind the
    /// eye may cover everything.
    #[inline(always)]
    pub fn rectangles<S: Simd>(&self, simd: S, balls: &Projected, count: usize) -> (Rectangles, u16) {
        let depth = simd.load(&balls.center[2]);
        let radius = simd.load(&balls.radius);
        let near = simd.splat(self.clip[0]).lt(depth + radius);
        let far = (depth - radius).lt(simd.splat(self.clip[1]));
        let (x_min, x_max) = self.extent(simd, balls, 0);
        let (y_min, y_max) = self.extent(simd, balls, 1);
        let seen = near & far & x_min.le(x_max) & y_min.le(y_max);
        let rectangles = Rectangles { x_min: x_min.lanes(), x_max: x_max.lanes(), y_min: y_min.lanes(), y_max: y_max.lanes() };
        (rectangles, seen.bits() & lowest_bits(count))
    }

    /// First and last pixel along an axis within the image; the first is greater where there is none.
    #[inline(always)]
    fn extent<S: Simd>(&self, simd: S, balls: &Projected, axis: usize) -> (S::Vector, S::Vector) {
        let (zero, size) = (simd.splat(0.0), simd.splat(self.size[axis]));
        let (origin, scale) = (simd.splat(self.origin[axis]), simd.splat(self.scale[axis]));
        let across = simd.load(&balls.center[axis]);
        let radius = simd.load(&balls.radius);
        let (low, high) = if self.is_perspective {
            let depth = simd.load(&balls.center[2]);
            let clearance = (depth - radius) * (depth + radius);
            // Below this the tangents are too steep for float32.
            let is_bounded = (radius * simd.splat(1.01)).lt(depth);
            let tangent = across.mul_add(across, clearance).max(zero).sqrt() * radius;
            let share = simd.splat(1.0) / clearance;
            let far = simd.splat(f32::MAX);
            let low = across.mul_add(depth, zero - tangent) * share;
            let high = across.mul_add(depth, tangent) * share;
            (low.select(is_bounded, zero - far), high.select(is_bounded, far))
        } else {
            (across - radius, across + radius)
        };
        // Pixel i has its centre at i + 0.5.
        let margin = simd.splat(PIXEL_MARGIN[0] + PIXEL_MARGIN[1] * self.size[axis]);
        let half = simd.splat(0.5);
        let first = (zero - ((zero - (low - origin) * scale) + half + margin).floor()).max(zero);
        let last = ((high - origin) * scale - half + margin).floor().min(size - simd.splat(1.0));
        (first.min(size), last.max(zero - simd.splat(1.0)))
    }
}

/// Positions, radii and weights of sixteen balls from `first` on; beyond the last it is repeated.
#[inline(always)]
fn sixteen(balls: &Balls<'_>, first: usize) -> ([[f32; 3]; LANES], Lanes, Lanes) {
    let (positions, radii, weights) = (&balls.positions()[first..], &balls.radii()[first..], &balls.weights()[first..]);
    if let (Some(positions), Some(radii), Some(weights)) = (positions.first_chunk(), radii.first_chunk(), weights.first_chunk())
    {
        return (*positions, Lanes(*radii), Lanes(*weights));
    }
    let last = radii.len() - 1;
    let position = std::array::from_fn(|lane| positions[lane.min(last)]);
    let number = |numbers: &[f32]| Lanes(std::array::from_fn(|lane| numbers[lane.min(last)]));
    (position, number(radii), number(weights))
}

/// The lowest `count` bits of sixteen.
#[inline(always)]
pub fn lowest_bits(count: usize) -> u16 {
    if count < LANES { (1 << count) - 1 } else { u16::MAX }
}

/// The numbers of the bits that are set, the lowest first.
#[inline(always)]
pub fn set_bits(bits: u16) -> impl Iterator<Item = usize> {
    let mut rest = bits;
    std::iter::from_fn(move || {
        let lane = (rest != 0).then(|| rest.trailing_zeros() as usize)?;
        rest &= rest - 1;
        Some(lane)
    })
}

/// One more than the greatest number that [`whole_numbers`] knows.
pub const MOST_WHOLE: usize = 1 << 23;

/// Whole numbers less than [`MOST_WHOLE`] as integers.
#[inline(always)]
pub fn whole_numbers<S: Simd>(simd: S, numbers: S::Vector) -> [usize; LANES] {
    // From 2^23 on the last bits of a float are the whole number.
    let shifted = (numbers + simd.splat(MOST_WHOLE as f32)).lanes();
    shifted.0.map(|number| number.to_bits() as usize & (MOST_WHOLE - 1))
}
