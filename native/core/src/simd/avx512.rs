//! AVX-512: one register of sixteen lanes.
//!
//! Every `unsafe` block here calls instructions of AVX-512 F, BW, DQ or VL. That is sound because an [`Avx512`], and hence
//! a vector or a mask made by one, exists only where [`Avx512::new`] has found them all.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use super::{LANES, Lanes, Mask, Simd, Task, Vector};

/// Proof that the processor has AVX-512.
#[derive(Clone, Copy, Debug)]
pub struct Avx512(());

impl Avx512 {
    /// The proof, where there is one.
    pub fn new() -> Option<Self> {
        let has = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi2");
        has.then_some(Self(()))
    }

    /// Does the task, compiled for this path.
    pub fn run<T: Task>(self, task: T) -> T::Output {
        #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        fn compiled<T: Task>(task: T, simd: Avx512) -> T::Output {
            task.run(simd)
        }
        // SAFETY: see the head of this file.
        unsafe { compiled(task, self) }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Numbers(__m512);

macro_rules! binary {
    ($trait:ident, $method:ident, $instruction:ident) => {
        impl $trait for Numbers {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: see the head of this file.
                unsafe { Self($instruction(self.0, other.0)) }
            }
        }
    };
}

binary!(Add, add, _mm512_add_ps);
binary!(Sub, sub, _mm512_sub_ps);
binary!(Mul, mul, _mm512_mul_ps);
binary!(Div, div, _mm512_div_ps);

impl Vector for Numbers {
    type Mask = Bits;

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm512_fmadd_ps(self.0, factor.0, addend.0)) }
    }

    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm512_fnmadd_ps(self.0, factor.0, addend.0)) }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm512_min_ps(self.0, other.0)) }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm512_max_ps(self.0, other.0)) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm512_sqrt_ps(self.0)) }
    }

    #[inline(always)]
    fn reciprocal_estimate(self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm512_rcp14_ps(self.0)) }
    }

    #[inline(always)]
    fn inverse_sqrt_estimate(self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm512_rsqrt14_ps(self.0)) }
    }

    #[inline(always)]
    fn floor(self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(self.0)) }
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Bits {
        // SAFETY: see the head of this file.
        unsafe { Bits(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0)) }
    }

    #[inline(always)]
    fn le(self, other: Self) -> Bits {
        // SAFETY: see the head of this file.
        unsafe { Bits(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0)) }
    }

    #[inline(always)]
    fn select(self, mask: Bits, other: Self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm512_mask_blend_ps(mask.0, other.0, self.0)) }
    }

    #[inline(always)]
    fn store(self, lanes: &mut Lanes) {
        // SAFETY: see the head of this file; lanes are aligned to 64 bytes.
        unsafe { _mm512_store_ps(lanes.0.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn compress(self, bits: u16, target: &mut [f32; LANES]) {
        // In a register first: the form that writes to memory takes a hundred cycles on some processors.
        // SAFETY: see the head of this file; the target holds all lanes.
        unsafe { _mm512_storeu_ps(target.as_mut_ptr(), _mm512_maskz_compress_ps(bits, self.0)) }
    }

    #[inline(always)]
    fn reduce_min(self) -> f32 {
        // SAFETY: see the head of this file.
        unsafe { _mm512_reduce_min_ps(self.0) }
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        // SAFETY: see the head of this file.
        unsafe { _mm512_reduce_max_ps(self.0) }
    }

    #[inline(always)]
    fn reduce_sum(self) -> f32 {
        // SAFETY: see the head of this file.
        unsafe { _mm512_reduce_add_ps(self.0) }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Bits(__mmask16);

impl BitAnd for Bits {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl BitOr for Bits {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl Not for Bits {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0)
    }
}

impl Mask for Bits {
    #[inline(always)]
    fn bits(self) -> u16 {
        self.0
    }
}

impl Simd for Avx512 {
    type Vector = Numbers;
    type Mask = Bits;
    const ESTIMATE_ERROR: f32 = 1.0 / (1 << 14) as f32;

    #[inline(always)]
    fn splat(self, value: f32) -> Numbers {
        // SAFETY: see the head of this file.
        unsafe { Numbers(_mm512_set1_ps(value)) }
    }

    #[inline(always)]
    fn load(self, lanes: &Lanes) -> Numbers {
        // SAFETY: see the head of this file; lanes are aligned to 64 bytes.
        unsafe { Numbers(_mm512_load_ps(lanes.0.as_ptr())) }
    }

    #[inline(always)]
    fn load_unaligned(self, numbers: &[f32; LANES]) -> Numbers {
        // SAFETY: see the head of this file.
        unsafe { Numbers(_mm512_loadu_ps(numbers.as_ptr())) }
    }

    #[inline(always)]
    fn mask(self, bits: u16) -> Bits {
        Bits(bits)
    }
}
