//! How far a ray may go on from where the density F, its slope and a bound of how fast the slope can change are known.
//!
//! With the gap `g = T - F`, the slope s and the bound M, the density stays below T for
//! `2 g / (s + sqrt(s^2 + 2 M g))` ahead and, where it rises, for `(s + sqrt(s^2 + 2 M g)) / M` behind. Beyond the surface g is
//! negative: then the density was surely below T between the first and the second, counted back, and the surface lies nearer.

use crate::simd::{Simd, Vector};

/// How fast the slope rises where one has to guess, as a share of the bound.
const GUESSED_BEND: f32 = 0.25;

/// Less is nothing: the estimates of reciprocals need more.
pub const LEAST: f32 = 1e-30;

/// A bound of how fast the slope can rise.
pub struct Bend<S: Simd> {
    bend: S::Vector,
    inverse: S::Vector,
}

/// How far a ray may go on from where its density is known.
pub struct Steps<S: Simd> {
    /// No crossing is nearer; where the density is beyond the isovalue already, minus how far back the last one is.
    pub ahead: S::Vector,
    /// So far back the density was on the same side, but for the crossing just behind.
    pub behind: S::Vector,
    /// Where the crossing is, about.
    pub guess: S::Vector,
    /// The slope at the crossing is at least half of this, about.
    pub slope: S::Vector,
    /// Whether there are such roots.
    pub is_real: S::Mask,
}

impl<S: Simd> Bend<S> {
    #[inline(always)]
    pub fn new(simd: S, bend: S::Vector) -> Self {
        let bend = bend.max(simd.splat(LEAST));
        Self { bend, inverse: simd.splat(1.0) / bend }
    }

    /// With `gap` to the isovalue and the slope there, the density stays on its side for the positive roots of
    /// `gap = slope dt + bend dt^2 / 2` ahead and `gap = -slope dt + bend dt^2 / 2` behind.
    #[inline(always)]
    pub fn steps(&self, simd: S, gap: S::Vector, slope: S::Vector) -> Steps<S> {
        let zero = simd.splat(0.0);
        let (shorter, longer) = (simd.splat(1.0 - 4.0 * S::ESTIMATE_ERROR), simd.splat(1.0 + 4.0 * S::ESTIMATE_ERROR));
        let gap_2 = gap + gap;
        let pull = gap_2 * self.bend;
        let rises = zero.lt(slope);
        let steepness = slope.max(zero - slope);
        // Of the two forms of the roots the one without cancellation.
        let square = slope.mul_add(slope, pull);
        let root_sum = Self::sum(simd, square, steepness);
        let near = gap_2 * root_sum.reciprocal_estimate();
        let near = (near * shorter).min(near * longer);
        let far = root_sum * self.inverse * shorter;
        let guess_sum = Self::sum(simd, slope.mul_add(slope, pull * simd.splat(GUESSED_BEND)), steepness);
        let guess = gap_2 * guess_sum.reciprocal_estimate();
        Steps {
            ahead: near.select(rises, far),
            behind: far.select(rises, near),
            guess: guess.select(rises, zero),
            slope: root_sum,
            is_real: zero.lt(square),
        }
    }

    /// `sqrt(square) + steepness`, about.
    #[inline(always)]
    fn sum(simd: S, square: S::Vector, steepness: S::Vector) -> S::Vector {
        let least = simd.splat(LEAST);
        let square = square.max(least);
        square.mul_add(square.inverse_sqrt_estimate(), steepness).max(least)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::simd::{Lanes, Path, Task};

    struct StepsTask {
        bend: f32,
        gap: f32,
        slope: f32,
    }

    impl Task for StepsTask {
        type Output = (f64, f64, bool);

        fn run<S: Simd>(self, simd: S) -> Self::Output {
            let bend = Bend::new(simd, simd.splat(self.bend));
            let steps = bend.steps(simd, simd.splat(self.gap), simd.splat(self.slope));
            let first = |lanes: Lanes| f64::from(lanes.0[0]);
            (first(steps.ahead.lanes()), first(steps.behind.lanes()), crate::simd::Mask::bits(steps.is_real) & 1 == 1)
        }
    }

    proptest! {
        /// The density that rises as fast as the bound allows, on both sides, is the worst that can be.
        #[test]
        #[cfg_attr(miri, ignore = "nothing unsafe on the path that Miri takes")]
        fn nothing_that_bends_less_crosses_within_a_step(bend in 0.01..1e4f32, gap in -0.1..1.0f32, slope in -50.0..50.0f32) {
            for path in Path::available() {
                let (ahead, behind, is_real) = path.dispatch(StepsTask { bend, gap, slope });
                let (bend, gap, slope) = (f64::from(bend), f64::from(gap), f64::from(slope));
                let gap_at = |t: f64| gap - slope * t - bend * t * t / 2.0;
                // A hair less than the whole step.
                let (from, to) = (-behind * (1.0 - 1e-6), ahead - ahead.abs() * 1e-6);
                if is_real && from < to {
                    for step in 0..=64 {
                        let t = from + (to - from) * f64::from(step) / 64.0;
                        prop_assert!(gap_at(t) > -1e-6 * (gap.abs() + slope.abs() * t.abs()), "{t} of {from} to {to}");
                    }
                }
                if gap > 0.0 {
                    prop_assert!(is_real && ahead > 0.0 && behind > 0.0);
                    let root = 2.0 * gap / (slope + (slope * slope + 2.0 * bend * gap).sqrt());
                    prop_assert!(slope < 0.0 || ahead > 0.99 * root, "{ahead} is much less than {root}");
                }
            }
        }
    }
}
