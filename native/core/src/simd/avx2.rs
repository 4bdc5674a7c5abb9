//! AVX2 with FMA: two registers of eight lanes.
//!
//! Every `unsafe` block here calls instructions of AVX, AVX2 or FMA. That is sound because an [`Avx2`], and hence a vector
//! or a mask made by one, exists only where [`Avx2::new`] has found them all.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use super::portable::compress_lanes;
use super::{LANES, Lanes, Mask, Simd, Task, Vector};

/// Proof that the processor has AVX2 and FMA.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

impl Avx2 {
    /// The proof, where there is one.
    pub fn new() -> Option<Self> {
        let has = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") && is_x86_feature_detected!("bmi2");
        has.then_some(Self(()))
    }

    /// Does the task, compiled for this path.
    pub fn run<T: Task>(self, task: T) -> T::Output {
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        fn compiled<T: Task>(task: T, simd: Avx2) -> T::Output {
            task.run(simd)
        }
        // SAFETY: see the head of this file.
        unsafe { compiled(task, self) }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Numbers(__m256, __m256);

macro_rules! binary {
    ($trait:ident, $method:ident, $instruction:ident) => {
        impl $trait for Numbers {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: see the head of this file.
                unsafe { Self($instruction(self.0, other.0), $instruction(self.1, other.1)) }
            }
        }
    };
}

binary!(Add, add, _mm256_add_ps);
binary!(Sub, sub, _mm256_sub_ps);
binary!(Mul, mul, _mm256_mul_ps);
binary!(Div, div, _mm256_div_ps);

impl Numbers {
    /// Halves until one lane is left.
    #[inline(always)]
    fn fold(halved: __m256, operation: impl Fn(__m128, __m128) -> __m128) -> f32 {
        // SAFETY: see the head of this file.
        unsafe {
            let four = operation(_mm256_castps256_ps128(halved), _mm256_extractf128_ps::<1>(halved));
            let two = operation(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(operation(two, _mm_movehdup_ps(two)))
        }
    }
}

impl Vector for Numbers {
    type Mask = Bits;

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm256_fmadd_ps(self.0, factor.0, addend.0), _mm256_fmadd_ps(self.1, factor.1, addend.1)) }
    }

    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm256_fnmadd_ps(self.0, factor.0, addend.0), _mm256_fnmadd_ps(self.1, factor.1, addend.1)) }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm256_min_ps(self.0, other.0), _mm256_min_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm256_max_ps(self.0, other.0), _mm256_max_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm256_sqrt_ps(self.0), _mm256_sqrt_ps(self.1)) }
    }

    #[inline(always)]
    fn reciprocal_estimate(self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm256_rcp_ps(self.0), _mm256_rcp_ps(self.1)) }
    }

    #[inline(always)]
    fn inverse_sqrt_estimate(self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm256_rsqrt_ps(self.0), _mm256_rsqrt_ps(self.1)) }
    }

    #[inline(always)]
    fn floor(self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm256_floor_ps(self.0), _mm256_floor_ps(self.1)) }
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Bits {
        // SAFETY: see the head of this file.
        unsafe { Bits(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0), _mm256_cmp_ps::<_CMP_LT_OQ>(self.1, other.1)) }
    }

    #[inline(always)]
    fn le(self, other: Self) -> Bits {
        // SAFETY: see the head of this file.
        unsafe { Bits(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0), _mm256_cmp_ps::<_CMP_LE_OQ>(self.1, other.1)) }
    }

    #[inline(always)]
    fn select(self, mask: Bits, other: Self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm256_blendv_ps(other.0, self.0, mask.0), _mm256_blendv_ps(other.1, self.1, mask.1)) }
    }

    #[inline(always)]
    fn store(self, lanes: &mut Lanes) {
        let target = lanes.0.as_mut_ptr();
        // SAFETY: see the head of this file; lanes are aligned to 64 bytes and hold both halves.
        unsafe {
            _mm256_store_ps(target, self.0);
            _mm256_store_ps(target.add(LANES / 2), self.1);
        }
    }

    #[inline(always)]
    fn compress(self, bits: u16, target: &mut [f32; LANES]) {
        compress_lanes(&self.lanes().0, bits, target);
    }

    #[inline(always)]
    fn reduce_min(self) -> f32 {
        // SAFETY: see the head of this file.
        unsafe { Self::fold(_mm256_min_ps(self.0, self.1), |a, b| _mm_min_ps(a, b)) }
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        // SAFETY: see the head of this file.
        unsafe { Self::fold(_mm256_max_ps(self.0, self.1), |a, b| _mm_max_ps(a, b)) }
    }

    #[inline(always)]
    fn reduce_sum(self) -> f32 {
        // SAFETY: see the head of this file.
        unsafe { Self::fold(_mm256_add_ps(self.0, self.1), |a, b| _mm_add_ps(a, b)) }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Bits(__m256, __m256);

impl BitAnd for Bits {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm256_and_ps(self.0, other.0), _mm256_and_ps(self.1, other.1)) }
    }
}

impl BitOr for Bits {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        // SAFETY: see the head of this file.
        unsafe { Self(_mm256_or_ps(self.0, other.0), _mm256_or_ps(self.1, other.1)) }
    }
}

impl Not for Bits {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        // SAFETY: see the head of this file.
        unsafe {
            let ones = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
            Self(_mm256_xor_ps(self.0, ones), _mm256_xor_ps(self.1, ones))
        }
    }
}

impl Mask for Bits {
    #[inline(always)]
    fn bits(self) -> u16 {
        // SAFETY: see the head of this file.
        unsafe { _mm256_movemask_ps(self.0) as u16 | (_mm256_movemask_ps(self.1) as u16) << 8 }
    }
}

impl Simd for Avx2 {
    type Vector = Numbers;
    type Mask = Bits;
    const ESTIMATE_ERROR: f32 = 1.5 / (1 << 12) as f32;

    #[inline(always)]
    fn splat(self, value: f32) -> Numbers {
        // SAFETY: see the head of this file.
        unsafe { Numbers(_mm256_set1_ps(value), _mm256_set1_ps(value)) }
    }

    #[inline(always)]
    fn load(self, lanes: &Lanes) -> Numbers {
        let source = lanes.0.as_ptr();
        // SAFETY: see the head of this file; lanes are aligned to 64 bytes and hold both halves.
        unsafe { Numbers(_mm256_load_ps(source), _mm256_load_ps(source.add(LANES / 2))) }
    }

    #[inline(always)]
    fn load_unaligned(self, numbers: &[f32; LANES]) -> Numbers {
        let source = numbers.as_ptr();
        // SAFETY: see the head of this file; the numbers hold both halves.
        unsafe { Numbers(_mm256_loadu_ps(source), _mm256_loadu_ps(source.add(LANES / 2))) }
    }

    #[inline(always)]
    fn mask(self, bits: u16) -> Bits {
        // SAFETY: see the head of this file.
        unsafe {
            let weights = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let half = |byte: u16| {
                let repeated = _mm256_set1_epi32(i32::from(byte & 0xff));
                _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(repeated, weights), weights))
            };
            Bits(half(bits), half(bits >> 8))
        }
    }
}
