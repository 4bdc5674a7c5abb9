//! The metaballs, borrowed from their owner.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::simd::LANES;

/// The greatest weight of a ball in single precision, in radii: the squares of the density's slopes must be floats. A ball of a
/// greater one has its surface where its influence sphere ends, to the last digit, as it has with this.
const GREATEST_WEIGHT: f32 = 1e15;

/// Numbers that are looked at together.
const STRETCH: usize = 256;

/// Numbers that a thread takes at a time.
const PART: usize = 1 << 16;

/// A ball's weight, bounded for computing in single precision.
#[inline(always)]
pub fn bounded_weight(weight: f32, radius: f32) -> f32 {
    let greatest = GREATEST_WEIGHT * radius;
    weight.clamp(-greatest, greatest)
}

/// N metaballs: centres in world space, influence radii R and weights q.
///
/// All slices have the same length; centres are finite, radii finite and greater than 0, weights finite.
#[derive(Clone, Copy, Debug)]
pub struct Balls<'a> {
    positions: &'a [[f32; 3]],
    radii: &'a [f32],
    weights: &'a [f32],
}

impl<'a> Balls<'a> {
    /// Checks and borrows the arrays.
    ///
    /// # Errors
    /// `InvalidInput` where lengths differ, a number is not finite, or a radius is not greater than zero.
    pub fn new(positions: &'a [[f32; 3]], radii: &'a [f32], weights: &'a [f32]) -> Result<Self> {
        let count = positions.len();
        if radii.len() != count || weights.len() != count {
            return Err(Error::InvalidInput(format!(
                "radii and weights must have one number for each of the {count} positions, not {} and {}",
                radii.len(),
                weights.len()
            )));
        }
        if count > i32::MAX as usize {
            return Err(Error::InvalidInput(format!("{count} balls are more than the {} that can be numbered", i32::MAX)));
        }
        check(all(positions.as_flattened(), f32::is_finite), "positions", "finite")?;
        check(all(radii, |radius| radius.is_finite() & (radius > 0.0)), "radii", "finite and greater than zero")?;
        check(all(weights, f32::is_finite), "weights", "finite")?;
        Ok(Self { positions, radii, weights })
    }

    /// The greatest weight, 0 where there is none above.
    pub fn greatest_weight(&self) -> f32 {
        let greater = |a: f32, b: f32| if a > b { a } else { b };
        let greatest = |weights: &[f32]| {
            let mut lanes = [0.0; LANES];
            for weights in weights.chunks(LANES) {
                lanes.iter_mut().zip(weights).for_each(|(lane, weight)| *lane = greater(*weight, *lane));
            }
            lanes.into_iter().fold(0.0, greater)
        };
        self.weights.par_chunks(PART).map(greatest).reduce(|| 0.0, greater)
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.radii.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.radii.is_empty()
    }

    /// Centres, world space.
    pub fn positions(&self) -> &'a [[f32; 3]] {
        self.positions
    }

    /// Influence radii R.
    pub fn radii(&self) -> &'a [f32] {
        self.radii
    }

    /// Weights q.
    pub fn weights(&self) -> &'a [f32] {
        self.weights
    }

    /// An origin from which every centre is a float exactly: on an axis where all lie within a factor of two of each other,
    /// differences are exact; elsewhere the world's own.
    pub fn exact_origin(&self) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let along = self.positions.iter().map(|position| position[axis]);
            let (low, high) = along.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
            if low > 0.0 && high <= 2.0 * low {
                f64::from(low)
            } else if high < 0.0 && low >= 2.0 * high {
                f64::from(high)
            } else {
                0.0
            }
        })
    }
}

/// Whether all numbers pass a test; they are looked at in stretches, for which compilers use vectors.
fn all(numbers: &[f32], test: impl Fn(f32) -> bool + Sync) -> bool {
    let pass = |stretch: &[f32]| stretch.iter().fold(true, |passes, number| passes & test(*number));
    numbers.par_chunks(PART).all(|part| part.chunks(STRETCH).all(pass))
}

fn check(holds: bool, name: &str, wanted: &str) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::InvalidInput(format!("all {name} must be {wanted}"))) }
}
