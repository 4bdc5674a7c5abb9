//! Sixteen float32 lanes at once, on whatever the processor has. Algorithms are written once against [`Simd`] and compiled
//! once for each path; [`Path::dispatch`] enters one.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod portable;

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};
use std::sync::OnceLock;

/// Lanes of a vector on every path.
pub const LANES: usize = 16;

/// Sixteen numbers in memory, aligned for the widest load.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes(pub [f32; LANES]);

impl Lanes {
    /// The same number in every lane.
    pub const fn splat(value: f32) -> Self {
        Self([value; LANES])
    }
}

/// Sixteen float32 numbers in registers.
pub trait Vector: Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// What comparisons give.
    type Mask: Mask;

    /// `self * factor + addend`, rounded once where the processor can.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// `addend - self * factor`, rounded once where the processor can.
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self;
    /// The lesser of each lane; `other` where one is not a number.
    fn min(self, other: Self) -> Self;
    /// The greater of each lane; `other` where one is not a number.
    fn max(self, other: Self) -> Self;
    /// The square root of each lane.
    fn sqrt(self) -> Self;
    /// The reciprocal of each lane, within a share of [`Simd::ESTIMATE_ERROR`]; for numbers from 1e-30 to 1e30.
    fn reciprocal_estimate(self) -> Self;
    /// The reciprocal of the square root of each lane, within a share of [`Simd::ESTIMATE_ERROR`]; for numbers from 1e-30 to
    /// 1e30.
    fn inverse_sqrt_estimate(self) -> Self;
    /// The greatest whole number that is not greater than the lane.
    fn floor(self) -> Self;
    /// Where `self < other`.
    fn lt(self, other: Self) -> Self::Mask;
    /// Where `self <= other`.
    fn le(self, other: Self) -> Self::Mask;
    /// `self` where the mask is set, `other` elsewhere.
    fn select(self, mask: Self::Mask, other: Self) -> Self;
    /// Writes the lanes to memory.
    fn store(self, lanes: &mut Lanes);
    /// Writes the lanes whose bits are set to the front of `target`, in order; the rest of `target` may change.
    fn compress(self, bits: u16, target: &mut [f32; LANES]);

    /// The lanes in memory.
    #[inline(always)]
    fn lanes(self) -> Lanes {
        let mut lanes = Lanes::splat(0.0);
        self.store(&mut lanes);
        lanes
    }

    /// The least lane.
    fn reduce_min(self) -> f32;
    /// The greatest lane.
    fn reduce_max(self) -> f32;
    /// The sum of the lanes.
    fn reduce_sum(self) -> f32;
}

/// Sixteen truth values in registers.
pub trait Mask: Copy + Debug + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// Lane i in bit i.
    fn bits(self) -> u16;

    /// Whether any lane is set.
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

/// A way to compute, proof that the processor has it.
pub trait Simd: Copy + Send + Sync {
    /// Sixteen numbers.
    type Vector: Vector<Mask = Self::Mask>;
    /// Sixteen truth values.
    type Mask: Mask;
    /// Whether work may be compiled several times for this path, once for each of its special cases.
    const IS_SPECIALISED: bool = true;
    /// How wrong an estimate of a reciprocal may be, as a share.
    const ESTIMATE_ERROR: f32;

    /// The same number in every lane.
    fn splat(self, value: f32) -> Self::Vector;
    /// Sixteen numbers from memory.
    fn load(self, lanes: &Lanes) -> Self::Vector;
    /// Sixteen numbers from memory of any alignment.
    fn load_unaligned(self, numbers: &[f32; LANES]) -> Self::Vector;
    /// Bit i in lane i.
    fn mask(self, bits: u16) -> Self::Mask;
}

/// A piece of work that is compiled once for each path. Everything that `run` calls must be `#[inline(always)]`, or it is
/// compiled without the path's instructions.
pub trait Task {
    /// What it gives.
    type Output;
    /// Does it.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// The paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// x86-64 with AVX-512 F, BW, DQ and VL.
    Avx512,
    /// x86-64 with AVX2 and FMA.
    Avx2,
    /// 64-bit ARM.
    Neon,
    /// Any processor.
    Portable,
}

const PATHS: [Path; 4] = [Path::Avx512, Path::Avx2, Path::Neon, Path::Portable];

/// Names the path to take instead of the fastest.
pub const PATH_VARIABLE: &str = "MENISCUS_SIMD";

impl Path {
    /// As it is called in [`PATH_VARIABLE`].
    pub fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "avx512",
            Self::Avx2 => "avx2",
            Self::Neon => "neon",
            Self::Portable => "portable",
        }
    }

    /// Those that this processor has, the fastest first.
    pub fn available() -> Vec<Self> {
        PATHS.into_iter().filter(|path| path.runs_here()).collect()
    }

    /// The path to take: the one that [`PATH_VARIABLE`] names, else the fastest. Read once.
    ///
    /// # Errors
    /// `InvalidInput` where the variable names none that runs here.
    pub fn chosen() -> crate::error::Result<Self> {
        static CHOSEN: OnceLock<crate::error::Result<Path>> = OnceLock::new();
        CHOSEN.get_or_init(|| Self::named(std::env::var(PATH_VARIABLE).unwrap_or_default().as_str())).clone()
    }

    /// The path called `name`; the fastest where it is empty.
    fn named(name: &str) -> crate::error::Result<Self> {
        let available = Self::available();
        if name.is_empty() {
            return Ok(available[0]);
        }
        available.iter().copied().find(|path| path.name() == name).ok_or_else(|| {
            let names: Vec<_> = available.iter().map(|path| path.name()).collect();
            crate::error::Error::InvalidInput(format!(
                "{PATH_VARIABLE} is '{name}', which this processor does not have: choose one of {}",
                names.join(", ")
            ))
        })
    }

    fn runs_here(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => avx512::Avx512::new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => avx2::Avx2::new().is_some(),
            #[cfg(target_arch = "aarch64")]
            Self::Neon => true,
            Self::Portable => true,
            #[allow(unreachable_patterns, reason = "which paths there are goes with the architecture")]
            _ => false,
        }
    }

    /// Does `task` on this path; on the portable one where the processor lacks it.
    pub fn dispatch<T: Task>(self, task: T) -> T::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => match avx512::Avx512::new() {
                Some(simd) => simd.run(task),
                None => task.run(portable::Portable),
            },
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => match avx2::Avx2::new() {
                Some(simd) => simd.run(task),
                None => task.run(portable::Portable),
            },
            #[cfg(target_arch = "aarch64")]
            Self::Neon => task.run(neon::Neon),
            _ => task.run(portable::Portable),
        }
    }
}

#[cfg(test)]
mod tests;
