//! NEON: four registers of four lanes. Every 64-bit ARM processor that Rust's standard library runs on has it, which is
//! why the `unsafe` blocks here are sound.

use std::arch::aarch64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use super::portable::compress_lanes;
use super::{LANES, Lanes, Mask, Simd, Vector};

const PARTS: usize = 4;

/// NEON, which is always there.
#[derive(Clone, Copy, Debug)]
pub struct Neon;

#[derive(Clone, Copy, Debug)]
pub struct Numbers([float32x4_t; PARTS]);

impl Numbers {
    #[inline(always)]
    fn zip(self, other: Self, operation: impl Fn(float32x4_t, float32x4_t) -> float32x4_t) -> Self {
        Self(std::array::from_fn(|part| operation(self.0[part], other.0[part])))
    }

    #[inline(always)]
    fn compare(self, other: Self, operation: impl Fn(float32x4_t, float32x4_t) -> uint32x4_t) -> Bits {
        Bits(std::array::from_fn(|part| operation(self.0[part], other.0[part])))
    }

    /// Halves until four lanes are left.
    #[inline(always)]
    fn halve(self, operation: impl Fn(float32x4_t, float32x4_t) -> float32x4_t) -> float32x4_t {
        operation(operation(self.0[0], self.0[2]), operation(self.0[1], self.0[3]))
    }
}

macro_rules! binary {
    ($trait:ident, $method:ident, $instruction:ident) => {
        impl $trait for Numbers {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: NEON is always there.
                self.zip(other, |a, b| unsafe { $instruction(a, b) })
            }
        }
    };
}

binary!(Add, add, vaddq_f32);
binary!(Sub, sub, vsubq_f32);
binary!(Mul, mul, vmulq_f32);
binary!(Div, div, vdivq_f32);

impl Vector for Numbers {
    type Mask = Bits;

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        // SAFETY: NEON is always there.
        Self(std::array::from_fn(|part| unsafe { vfmaq_f32(addend.0[part], self.0[part], factor.0[part]) }))
    }

    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        // SAFETY: NEON is always there.
        Self(std::array::from_fn(|part| unsafe { vfmsq_f32(addend.0[part], self.0[part], factor.0[part]) }))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // By comparison, so that a NaN goes as on the other paths.
        self.select(self.lt(other), other)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.select(other.lt(self), other)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: NEON is always there.
        Self(self.0.map(|part| unsafe { vsqrtq_f32(part) }))
    }

    #[inline(always)]
    fn reciprocal_estimate(self) -> Self {
        // The instruction gives eight bits; a Newton step doubles them.
        // SAFETY: NEON is always there.
        Self(self.0.map(|part| unsafe {
            let estimate = vrecpeq_f32(part);
            vmulq_f32(estimate, vrecpsq_f32(part, estimate))
        }))
    }

    #[inline(always)]
    fn inverse_sqrt_estimate(self) -> Self {
        // SAFETY: NEON is always there.
        Self(self.0.map(|part| unsafe {
            let estimate = vrsqrteq_f32(part);
            vmulq_f32(estimate, vrsqrtsq_f32(vmulq_f32(part, estimate), estimate))
        }))
    }

    #[inline(always)]
    fn floor(self) -> Self {
        // SAFETY: NEON is always there.
        Self(self.0.map(|part| unsafe { vrndmq_f32(part) }))
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Bits {
        // SAFETY: NEON is always there.
        self.compare(other, |a, b| unsafe { vcltq_f32(a, b) })
    }

    #[inline(always)]
    fn le(self, other: Self) -> Bits {
        // SAFETY: NEON is always there.
        self.compare(other, |a, b| unsafe { vcleq_f32(a, b) })
    }

    #[inline(always)]
    fn select(self, mask: Bits, other: Self) -> Self {
        // SAFETY: NEON is always there.
        Self(std::array::from_fn(|part| unsafe { vbslq_f32(mask.0[part], self.0[part], other.0[part]) }))
    }

    #[inline(always)]
    fn store(self, lanes: &mut Lanes) {
        for (target, part) in lanes.0.as_chunks_mut::<PARTS>().0.iter_mut().zip(self.0) {
            // SAFETY: NEON is always there; the target holds four lanes.
            unsafe { vst1q_f32(target.as_mut_ptr(), part) }
        }
    }

    #[inline(always)]
    fn compress(self, bits: u16, target: &mut [f32; LANES]) {
        compress_lanes(&self.lanes().0, bits, target);
    }

    #[inline(always)]
    fn reduce_min(self) -> f32 {
        // SAFETY: NEON is always there.
        unsafe { vminvq_f32(self.halve(|a, b| vminq_f32(a, b))) }
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        // SAFETY: NEON is always there.
        unsafe { vmaxvq_f32(self.halve(|a, b| vmaxq_f32(a, b))) }
    }

    #[inline(always)]
    fn reduce_sum(self) -> f32 {
        // SAFETY: NEON is always there.
        unsafe {
            let four = self.halve(|a, b| vaddq_f32(a, b));
            let two = vadd_f32(vget_low_f32(four), vget_high_f32(four));
            vget_lane_f32::<0>(two) + vget_lane_f32::<1>(two)
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Bits([uint32x4_t; PARTS]);

impl BitAnd for Bits {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        // SAFETY: NEON is always there.
        Self(std::array::from_fn(|part| unsafe { vandq_u32(self.0[part], other.0[part]) }))
    }
}

impl BitOr for Bits {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        // SAFETY: NEON is always there.
        Self(std::array::from_fn(|part| unsafe { vorrq_u32(self.0[part], other.0[part]) }))
    }
}

impl Not for Bits {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        // SAFETY: NEON is always there.
        Self(self.0.map(|part| unsafe { vmvnq_u32(part) }))
    }
}

impl Mask for Bits {
    #[inline(always)]
    fn bits(self) -> u16 {
        let weights = [1u32, 2, 4, 8];
        let mut bits = 0;
        for (part, lanes) in self.0.into_iter().enumerate() {
            // SAFETY: NEON is always there; there are four weights.
            let four = unsafe { vaddvq_u32(vandq_u32(lanes, vld1q_u32(weights.as_ptr()))) };
            bits |= (four as u16) << (PARTS * part);
        }
        bits
    }
}

impl Simd for Neon {
    type Vector = Numbers;
    type Mask = Bits;
    const ESTIMATE_ERROR: f32 = 1.0 / (1 << 14) as f32;

    #[inline(always)]
    fn splat(self, value: f32) -> Numbers {
        // SAFETY: NEON is always there.
        Numbers([unsafe { vdupq_n_f32(value) }; PARTS])
    }

    #[inline(always)]
    fn load(self, lanes: &Lanes) -> Numbers {
        self.load_unaligned(&lanes.0)
    }

    #[inline(always)]
    fn load_unaligned(self, numbers: &[f32; LANES]) -> Numbers {
        // SAFETY: NEON is always there; the numbers hold four parts of four.
        Numbers(std::array::from_fn(|part| unsafe { vld1q_f32(numbers.as_ptr().add(PARTS * part)) }))
    }

    #[inline(always)]
    fn mask(self, bits: u16) -> Bits {
        Bits(std::array::from_fn(|part| {
            let lanes: [u32; PARTS] = std::array::from_fn(|lane| if bits >> (PARTS * part + lane) & 1 == 1 { !0 } else { 0 });
            // SAFETY: NEON is always there; there are four lanes.
            unsafe { vld1q_u32(lanes.as_ptr()) }
        }))
    }
}
