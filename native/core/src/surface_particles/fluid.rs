//! The density and its derivatives at points (van Kooten, van den Bergen and Telea 2007, section 7.2).

use crate::balls::Balls;
use crate::error::{Error, Result};
use crate::field::Field;
use crate::memory;
use crate::vectors::{difference, dot, double, plus};

use super::hash::BallHash;

/// How often a point is moved onto the surface.
const PROJECTIONS: usize = 8;

/// A projection goes at most so far, in influence radii: beyond it the slope says nothing.
const LONGEST_PROJECTION: f64 = 0.25;

/// How near to the surface a point must come before its last step, in influence radii: so far is its normal from that of the surface,
/// in radians, where this bends by its influence radius.
const NEAR: f64 = 1e-4;

/// What the balls give at a point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sample {
    /// F.
    pub density: f64,
    /// The derivative of F by the point.
    pub gradient: [f64; 3],
    /// How fast F changes at the point because balls move: its derivative by their positions times their velocities.
    pub rate: f64,
    /// The mean of the balls' velocities, weighted by the lengths of their gradients (equation 3).
    pub velocity: [f64; 3],
    /// The harmonic mean of their influence radii, weighted by the lengths of their gradients: how large things are there; 0 where
    /// none reaches.
    pub scale: f64,
}

/// A point of the surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// World space.
    pub position: [f64; 3],
    /// Unit, out of the fluid.
    pub normal: [f64; 3],
    /// See [`Sample::scale`].
    pub scale: f64,
}

/// A ball as a density asks for it, in one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
struct Ball {
    /// Of the squared influence radius.
    reciprocal: f64,
    center: [f32; 3],
    radius: f32,
    weight: f32,
}

/// Moving balls, and which of them reach a point.
#[derive(Debug)]
pub struct Fluid {
    balls: Vec<Ball>,
    /// None where nothing moves.
    velocities: Option<Vec<[f32; 3]>>,
    field: Field,
    hash: BallHash,
}

impl Fluid {
    /// Copies the balls; `velocities` are in units a second.
    ///
    /// # Errors
    /// `InvalidInput` where velocities are not one finite vector for each ball; `OutOfMemory`.
    pub fn new(balls: &Balls<'_>, velocities: Option<&[[f32; 3]]>, field: Field, cell_share: f64) -> Result<Self> {
        if let Some(velocities) = velocities {
            let count = balls.len();
            if velocities.len() != count {
                return Err(Error::InvalidInput(format!(
                    "there must be {count} velocities, one for each ball, not {}",
                    velocities.len()
                )));
            }
            let broken = velocities.iter().filter(|velocity| velocity.iter().any(|number| !number.is_finite())).count();
            if broken > 0 {
                return Err(Error::InvalidInput(format!(
                    "{broken} of {count} balls have a velocity that is not finite: correct these, or give no velocities"
                )));
            }
        }
        let hash = BallHash::new(balls.positions(), balls.radii(), cell_share)?;
        let mut packed = memory::with_capacity(balls.len())?;
        packed.extend((0..balls.len()).map(|ball| {
            let (center, radius, weight) = (balls.positions()[ball], balls.radii()[ball], balls.weights()[ball]);
            Ball { reciprocal: f64::from(radius).powi(2).recip(), center, radius, weight }
        }));
        Ok(Self { balls: packed, velocities: velocities.map(copied).transpose()?, field, hash })
    }

    /// Which balls reach a point.
    pub fn hash(&self) -> &BallHash {
        &self.hash
    }

    /// How many balls there are.
    pub fn len(&self) -> usize {
        self.balls.len()
    }

    /// A ball's centre, influence radius and weight.
    pub fn ball(&self, ball: usize) -> ([f64; 3], f64, f64) {
        let Ball { center, radius, weight, .. } = self.balls[ball];
        (double(center), f64::from(radius), f64::from(weight))
    }

    /// The field.
    pub fn field(&self) -> &Field {
        &self.field
    }

    /// Whether a ball takes density away.
    pub fn carves(&self) -> bool {
        self.balls.iter().any(|ball| ball.weight < 0.0)
    }

    /// Whether a point is in the fluid.
    pub fn is_inside(&self, point: [f64; 3]) -> bool {
        let mut density = 0.0;
        self.hash.for_near(point, |ball| {
            let ball = &self.balls[ball];
            let x = ball.inside(difference(point, double(ball.center)));
            if x > 0.0 {
                density += f64::from(ball.weight) * self.field.kernel.value(x);
            }
        });
        density >= self.field.isovalue
    }

    /// The density at a point and what it changes with.
    pub fn sample(&self, point: [f64; 3]) -> Sample {
        let mut sample = Sample::default();
        let (mut velocity, mut lengths, mut curvatures) = ([0.0; 3], 0.0, 0.0);
        self.hash.for_near(point, |index| {
            let ball = &self.balls[index];
            let offset = difference(point, double(ball.center));
            let x = ball.inside(offset);
            if x <= 0.0 {
                return;
            }
            let weight = f64::from(ball.weight);
            let steepness = -2.0 * weight * self.field.kernel.derivative(x) * ball.reciprocal;
            let slope = offset.map(|c| steepness * c);
            sample.density += weight * self.field.kernel.value(x);
            sample.gradient = plus(sample.gradient, 1.0, slope);
            let length = dot(slope, slope).sqrt();
            lengths += length;
            curvatures += length / f64::from(ball.radius);
            if let Some(velocities) = &self.velocities {
                let own = double(velocities[index]);
                sample.rate -= dot(slope, own);
                velocity = plus(velocity, length, own);
            }
        });
        if lengths > 0.0 {
            sample.velocity = velocity.map(|c| c / lengths);
            sample.scale = lengths / curvatures;
        }
        sample
    }

    /// The second derivatives of F by the point: xx, yy, zz, xy, xz, yz.
    pub fn second_derivatives(&self, point: [f64; 3]) -> [f64; 6] {
        let mut sum = [0.0; 6];
        self.hash.for_near(point, |ball| {
            let (center, radius, weight) = self.ball(ball);
            let [x, y, z] = difference(point, center).map(|c| c / radius);
            let inside = 1.0 - dot([x, y, z], [x, y, z]);
            let (change, slope) = (self.field.kernel.second_derivative(inside), self.field.kernel.derivative(inside));
            let scale = weight / (radius * radius);
            let products = [x * x, y * y, z * z, x * y, x * z, y * z];
            for (number, product) in products.into_iter().enumerate() {
                let along_axis = if number < 3 { 2.0 * slope } else { 0.0 };
                sum[number] += scale * (4.0 * change * product - along_axis);
            }
        });
        sum
    }

    /// Visits the balls that reach a point, with the share that each has in the density.
    pub fn for_shares(&self, point: [f64; 3], mut visit: impl FnMut(usize, f64)) {
        self.hash.for_near(point, |ball| {
            let (center, radius, weight) = self.ball(ball);
            let offset = difference(point, center).map(|c| c / radius);
            let share = weight * self.field.kernel.value(1.0 - dot(offset, offset));
            if share != 0.0 {
                visit(ball, share);
            }
        });
    }

    /// The point of the surface that the slope leads to from a point near it; None where it leads nowhere.
    pub fn projected(&self, start: [f64; 3]) -> Option<SurfacePoint> {
        let mut position = start;
        for _ in 0..PROJECTIONS {
            let sample = self.sample(position);
            let slope = dot(sample.gradient, sample.gradient).sqrt();
            let distance = (self.field.isovalue - sample.density) / slope;
            if !distance.is_finite() {
                return None;
            }
            if distance.abs() <= NEAR * sample.scale {
                let normal = sample.gradient.map(|c| -c / slope);
                return Some(SurfacePoint { position: plus(position, -distance, normal), normal, scale: sample.scale });
            }
            let longest = LONGEST_PROJECTION * sample.scale;
            position = plus(position, distance.clamp(-longest, longest) / slope, sample.gradient);
        }
        None
    }
}

impl Ball {
    /// The kernel's argument, from the way from the centre.
    #[inline(always)]
    fn inside(&self, offset: [f64; 3]) -> f64 {
        1.0 - dot(offset, offset) * self.reciprocal
    }
}

impl Sample {
    /// The velocity of a point that stays on the surface and moves as desired where it may (equation 2, corrected: the desired
    /// velocity is its first term). `feedback` is the share of the excess of density that goes in a second.
    pub fn constrained(&self, desired: [f64; 3], isovalue: f64, feedback: f64) -> [f64; 3] {
        let steepness = dot(self.gradient, self.gradient);
        if steepness < f64::MIN_POSITIVE {
            return desired;
        }
        let excess = dot(self.gradient, desired) + self.rate + feedback * (self.density - isovalue);
        plus(desired, -excess / steepness, self.gradient)
    }
}

fn copied<T: Copy>(values: &[T]) -> Result<Vec<T>> {
    let mut copy = memory::with_capacity(values.len())?;
    copy.extend_from_slice(values);
    Ok(copy)
}
