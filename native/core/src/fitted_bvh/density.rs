//! The field in single precision, and what bounds it.

use crate::field::Field;
use crate::kernel::MAX_POWER;
use crate::simd::{Simd, Vector};

/// Steps of the table of shares in an octave of weight.
const STEPS_PER_OCTAVE: f32 = 8.0;
const OCTAVES: usize = 12;

/// A share of the influence radius that is added to where the field could reach the isovalue. So the field is below the
/// isovalue by more than rounding where a fitted box ends, and a ray that leaves the fluid leaves it within a box.
const SHARE_MARGIN: f64 = 1e-3;

/// A field whose bounds over a box are this close to the isovalue, relatively, may cross it.
const RANGE_MARGIN: f32 = 1e-5;

/// `f`, `T`, and numbers derived from them.
#[derive(Clone, Debug)]
pub struct Density {
    /// `c_k` of `x^k`, for k = 1 to 4.
    coefficients: [f32; MAX_POWER],
    /// T.
    pub isovalue: f32,
    shares: Vec<f32>,
}

impl Density {
    pub fn new(field: &Field) -> Self {
        let coefficients = field.kernel.coefficients();
        let share = |step: usize| {
            let weight = field.isovalue * f64::from(step as f32 / STEPS_PER_OCTAVE).exp2();
            (field.kernel_radius_share(weight) + SHARE_MARGIN).min(1.0) as f32
        };
        Self {
            coefficients: std::array::from_fn(|index| coefficients[index + 1] as f32),
            isovalue: field.isovalue as f32,
            shares: (0..=OCTAVES * STEPS_PER_OCTAVE as usize).map(share).collect(),
        }
    }

    /// Whether the slope of the field jumps where influence spheres begin.
    pub fn has_kinks(&self) -> bool {
        self.coefficients[0] > 0.0
    }

    /// Where balls with this sum of positive weights reach the isovalue, one of them is nearer than this share of its
    /// influence radius; none where they never do. Generalises `r_max` (Gourmel et al. 2010, section 5.3.1).
    pub fn reach(&self, positive_weight: f32) -> Option<f32> {
        let ratio = positive_weight / self.isovalue;
        if ratio < 1.0 - RANGE_MARGIN {
            return None;
        }
        // The next greater weight in the table reaches farther.
        let step = (ratio.max(1.0).log2() * STEPS_PER_OCTAVE).ceil() as usize;
        Some(self.shares.get(step).copied().unwrap_or(1.0))
    }

    /// Whether a field between these bounds is surely below the isovalue.
    pub fn is_below(&self, [_, most]: [f32; 2]) -> bool {
        most < self.isovalue * (1.0 - RANGE_MARGIN)
    }

    /// Whether a field between these bounds is surely above the isovalue.
    pub fn is_above(&self, [least, _]: [f32; 2]) -> bool {
        least > self.isovalue * (1.0 + RANGE_MARGIN)
    }

    /// The kernel in registers.
    #[inline(always)]
    pub fn lanes<S: Simd>(&self, simd: S) -> KernelLanes<S> {
        let [linear, square, cube, fourth] = self.coefficients;
        // The greatest of x^(k-2) (2 (k - 1) a - (2 k - 1) x), times k, over x in [0, a]; see `KernelLanes::rise`.
        let rise = [4.0 * square, 2.4 * cube, 128.0 / 49.0 * fourth];
        KernelLanes {
            value: self.coefficients.map(|c| simd.splat(c)),
            slope: [linear, 2.0 * square, 3.0 * cube, 4.0 * fourth].map(|c| simd.splat(c)),
            rise: rise.map(|c| simd.splat(c)),
        }
    }
}

/// `f` and its derivatives for sixteen balls.
#[derive(Clone, Copy)]
pub struct KernelLanes<S: Simd> {
    value: [S::Vector; MAX_POWER],
    slope: [S::Vector; MAX_POWER],
    rise: [S::Vector; MAX_POWER - 1],
}

impl<S: Simd> KernelLanes<S> {
    /// `f(x)` for `x >= 0`.
    #[inline(always)]
    pub fn value(&self, x: S::Vector) -> S::Vector {
        let [c1, c2, c3, c4] = self.value;
        c4.mul_add(x, c3).mul_add(x, c2).mul_add(x, c1) * x
    }

    /// `f'(x)` for `x >= 0`.
    #[inline(always)]
    pub fn slope(&self, x: S::Vector) -> S::Vector {
        let [c1, c2, c3, c4] = self.slope;
        c4.mul_add(x, c3).mul_add(x, c2).mul_add(x, c1)
    }

    /// What bounds the curvature of `f` along a ray from above, where x is at most `peak`: with `x(t) = a - (t / R)^2`,
    /// `d^2 f / dt^2 <= 2 rise(a) / R^2`, and `>= -2 slope(a) / R^2`.
    #[inline(always)]
    pub fn rise(&self, peak: S::Vector) -> S::Vector {
        let [c2, c3, c4] = self.rise;
        c4.mul_add(peak, c3).mul_add(peak, c2) * peak
    }
}
