//! A density kernel on the rays of a packet, its powers known when it is compiled.

use crate::kernel::{Kernel, MAX_POWER};
use crate::simd::{Simd, Vector};

/// Greatest second derivative of `(1 - u^2)^k` for k = 1 to 4 where it is not cut off.
const STEEPEST_UP: [f64; MAX_POWER] = [0.0, 8.0, 4.8, 256.0 / 49.0];
/// The least one, negated.
const STEEPEST_DOWN: [f64; MAX_POWER] = [2.0, 4.0, 6.0, 8.0];

/// `f(x) = sum_k c_k x^k` for k = LOW to HIGH.
#[derive(Clone, Copy)]
pub struct Polynomial<S: Simd, const LOW: usize, const HIGH: usize> {
    simd: S,
    value: [f32; MAX_POWER],
    slope: [f32; MAX_POWER],
    up: [f32; MAX_POWER],
    down: [f32; MAX_POWER],
}

impl<S: Simd, const LOW: usize, const HIGH: usize> Polynomial<S, LOW, HIGH> {
    /// The kernel, which must have no other powers.
    #[inline(always)]
    pub fn new(simd: S, kernel: &Kernel) -> Self {
        let scaled = |factor: &dyn Fn(usize) -> f64| {
            std::array::from_fn(|index| (kernel.coefficients()[index + 1] * factor(index)) as f32)
        };
        // A little larger, so that rounding cannot make a bound too low.
        let bound = 1.0 + 1e-5;
        Self {
            simd,
            value: scaled(&|_| 1.0),
            slope: scaled(&|index| (index + 1) as f64),
            up: scaled(&|index| STEEPEST_UP[index] * bound),
            down: scaled(&|index| STEEPEST_DOWN[index] * bound),
        }
    }

    /// `f(x)`, where x is not negative.
    #[inline(always)]
    pub fn value(&self, x: S::Vector) -> S::Vector {
        self.horner(&self.value, x) * self.power(x, LOW)
    }

    /// `f(x)` and `f'(x)`, where x is not negative; 0 where x is.
    #[inline(always)]
    pub fn value_and_slope(&self, x: S::Vector) -> (S::Vector, S::Vector) {
        let slope = self.horner(&self.slope, x) * self.power(x, LOW - 1);
        let zero = self.simd.splat(0.0);
        (self.value(x), if LOW == 1 { slope.select(zero.lt(x), zero) } else { slope })
    }

    /// How fast the slope of `f(a - b s^2)` rises with s at most, for b = 1 and a not negative.
    #[inline(always)]
    pub fn steepest_up(&self, a: S::Vector) -> S::Vector {
        self.horner(&self.up, a) * self.power(a, LOW - 1)
    }

    /// How fast the slope of `f(a - b s^2)` falls with s at most, for b = 1 and a not negative.
    #[inline(always)]
    pub fn steepest_down(&self, a: S::Vector) -> S::Vector {
        self.horner(&self.down, a) * self.power(a, LOW - 1)
    }

    /// `sum_k c_k x^(k - LOW)`; the coefficients begin with k = 1.
    #[inline(always)]
    fn horner(&self, coefficients: &[f32; MAX_POWER], x: S::Vector) -> S::Vector {
        let mut sum = self.simd.splat(coefficients[HIGH - 1]);
        for power in (LOW..HIGH).rev() {
            sum = sum.mul_add(x, self.simd.splat(coefficients[power - 1]));
        }
        sum
    }

    #[inline(always)]
    fn power(&self, x: S::Vector, exponent: usize) -> S::Vector {
        let square = x * x;
        match exponent {
            0 => self.simd.splat(1.0),
            1 => x,
            2 => square,
            3 => square * x,
            _ => square * square,
        }
    }
}

/// The least and the greatest power of a kernel.
pub fn powers(kernel: &Kernel) -> (usize, usize) {
    let is_there = |power: &usize| kernel.coefficients()[*power] != 0.0;
    ((1..=MAX_POWER).find(is_there).unwrap_or(1), (1..=MAX_POWER).rev().find(is_there).unwrap_or(MAX_POWER))
}
