//! The metaballs, borrowed from their owner.

use crate::error::{Error, Result};

/// The greatest weight of a ball in single precision, in radii: the squares of the density's slopes must be floats. A ball of a
/// greater one has its surface where its influence sphere ends, to the last digit, as it has with this.
const GREATEST_WEIGHT: f32 = 1e15;

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
        check(positions.iter().all(|p| p[0].is_finite() & p[1].is_finite() & p[2].is_finite()), "positions", "finite")?;
        check(radii.iter().all(|r| r.is_finite() & (*r > 0.0)), "radii", "finite and greater than zero")?;
        check(weights.iter().all(|w| w.is_finite()), "weights", "finite")?;
        Ok(Self { positions, radii, weights })
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
}

fn check(holds: bool, name: &str, wanted: &str) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::InvalidInput(format!("all {name} must be {wanted}"))) }
}
