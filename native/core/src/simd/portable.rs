//! Plain arrays, which compilers turn into whatever vectors the target has at least.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use super::{LANES, Lanes, Mask, Simd, Vector};

/// Runs on any processor.
#[derive(Clone, Copy, Debug)]
pub struct Portable;

#[derive(Clone, Copy, Debug)]
pub struct Numbers([f32; LANES]);

impl Numbers {
    #[inline(always)]
    fn zip(self, other: Self, operation: impl Fn(f32, f32) -> f32) -> Self {
        let mut result = self.0;
        for (lane, other) in result.iter_mut().zip(other.0) {
            *lane = operation(*lane, other);
        }
        Self(result)
    }

    #[inline(always)]
    fn compare(self, other: Self, holds: impl Fn(f32, f32) -> bool) -> Bits {
        let mut bits = 0;
        for (lane, (a, b)) in self.0.into_iter().zip(other.0).enumerate() {
            bits |= u16::from(holds(a, b)) << lane;
        }
        Bits(bits)
    }

    #[inline(always)]
    fn fold(self, operation: impl Fn(f32, f32) -> f32) -> f32 {
        // In the order in which vector registers are halved, so that every path gives the same sum.
        let mut lanes = self.0;
        let mut count = LANES;
        while count > 1 {
            count /= 2;
            for lane in 0..count {
                lanes[lane] = operation(lanes[lane], lanes[lane + count]);
            }
        }
        lanes[0]
    }
}

// Sixteen operations instead of one: inlined everywhere, they would make most of the library, and minutes of building it.

impl Add for Numbers {
    type Output = Self;
    #[inline(never)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Numbers {
    type Output = Self;
    #[inline(never)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Numbers {
    type Output = Self;
    #[inline(never)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl Div for Numbers {
    type Output = Self;
    #[inline(never)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
}

impl Vector for Numbers {
    type Mask = Bits;

    #[inline(never)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        // Not f32::mul_add, which is a slow call where the processor has no such instruction.
        self * factor + addend
    }

    #[inline(never)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        addend - self * factor
    }

    #[inline(never)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    #[inline(never)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    #[inline(never)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    #[inline(never)]
    fn reciprocal_estimate(self) -> Self {
        Self(self.0.map(f32::recip))
    }

    #[inline(never)]
    fn inverse_sqrt_estimate(self) -> Self {
        Self(self.0.map(|lane| lane.sqrt().recip()))
    }

    #[inline(never)]
    fn floor(self) -> Self {
        Self(self.0.map(f32::floor))
    }

    #[inline(never)]
    fn lt(self, other: Self) -> Bits {
        self.compare(other, |a, b| a < b)
    }

    #[inline(never)]
    fn le(self, other: Self) -> Bits {
        self.compare(other, |a, b| a <= b)
    }

    #[inline(never)]
    fn select(self, mask: Bits, other: Self) -> Self {
        let mut result = other.0;
        for (lane, target) in result.iter_mut().enumerate() {
            if mask.0 >> lane & 1 == 1 {
                *target = self.0[lane];
            }
        }
        Self(result)
    }

    #[inline(never)]
    fn store(self, lanes: &mut Lanes) {
        lanes.0 = self.0;
    }

    #[inline(never)]
    fn compress(self, bits: u16, target: &mut [f32; LANES]) {
        compress_lanes(&self.0, bits, target);
    }

    #[inline(never)]
    fn reduce_min(self) -> f32 {
        self.fold(|a, b| if a < b { a } else { b })
    }

    #[inline(never)]
    fn reduce_max(self) -> f32 {
        self.fold(|a, b| if a > b { a } else { b })
    }

    #[inline(never)]
    fn reduce_sum(self) -> f32 {
        self.fold(|a, b| a + b)
    }
}

/// Moves the lanes whose bits are set to the front, for paths without an instruction for it.
#[inline(always)]
pub fn compress_lanes(lanes: &[f32; LANES], bits: u16, target: &mut [f32; LANES]) {
    let mut rest = bits;
    let mut count = 0;
    while rest != 0 {
        target[count] = lanes[rest.trailing_zeros() as usize];
        rest &= rest - 1;
        count += 1;
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Bits(u16);

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

impl Simd for Portable {
    type Vector = Numbers;
    type Mask = Bits;
    const ESTIMATE_ERROR: f32 = f32::EPSILON;
    // Nobody chooses this path for its speed.
    const IS_SPECIALISED: bool = false;

    #[inline(always)]
    fn splat(self, value: f32) -> Numbers {
        Numbers([value; LANES])
    }

    #[inline(always)]
    fn load(self, lanes: &Lanes) -> Numbers {
        Numbers(lanes.0)
    }

    #[inline(always)]
    fn load_unaligned(self, numbers: &[f32; LANES]) -> Numbers {
        Numbers(*numbers)
    }

    #[inline(always)]
    fn mask(self, bits: u16) -> Bits {
        Bits(bits)
    }
}
