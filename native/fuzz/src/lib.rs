//! Scenes for the fuzz targets: mostly near the origin and of the size of a screen, so that rays meet surfaces, with any
//! numbers among them that the core accepts.

use libfuzzer_sys::arbitrary::{self, Arbitrary};
use meniscus_core::balls::Balls;
use meniscus_core::field::Field;
use meniscus_core::kernel::Kernel;

/// More would only make a run slower.
const MOST_BALLS: usize = 64;
const MOST_RAYS: usize = 32;

/// Everything that a caster casts at.
#[derive(Arbitrary, Debug)]
pub struct Scene {
    shares: [u8; 4],
    isovalue: u16,
    near: Vec<NearBall>,
    any: Vec<AnyBall>,
}

#[derive(Arbitrary, Clone, Copy, Debug)]
struct NearBall {
    position: [i8; 3],
    radius: u8,
    weight: i8,
}

#[derive(Arbitrary, Clone, Copy, Debug)]
struct AnyBall {
    position: [f32; 3],
    radius: f32,
    weight: f32,
}

/// The arrays of a scene.
#[derive(Debug, Default)]
pub struct Arrays {
    positions: Vec<[f32; 3]>,
    radii: Vec<f32>,
    weights: Vec<f32>,
}

impl Scene {
    /// The field, where the shares are those of a kernel.
    pub fn field(&self) -> Option<Field> {
        let sum: f64 = self.shares.iter().copied().map(f64::from).sum();
        let coefficients: Vec<_> = [0.0].into_iter().chain(self.shares.iter().map(|share| f64::from(*share) / sum)).collect();
        Field::new(Kernel::new(&coefficients).ok()?, (f64::from(self.isovalue) + 1.0) / 32768.0).ok()
    }

    /// The balls that can be cast at.
    pub fn arrays(&self) -> Arrays {
        let near = self.near.iter().map(|ball| AnyBall {
            position: ball.position.map(|number| f32::from(number) / 16.0),
            radius: (f32::from(ball.radius) + 1.0) / 64.0,
            weight: f32::from(ball.weight) / 32.0,
        });
        let mut arrays = Arrays::default();
        for ball in near.chain(self.any.iter().copied().filter(AnyBall::is_usable)).take(MOST_BALLS) {
            arrays.positions.push(ball.position);
            arrays.radii.push(ball.radius);
            arrays.weights.push(ball.weight);
        }
        arrays
    }
}

impl AnyBall {
    fn is_usable(&self) -> bool {
        let numbers = [self.radius, self.weight].into_iter().chain(self.position);
        self.radius > 0.0 && numbers.into_iter().all(f32::is_finite)
    }
}

impl Arrays {
    /// Borrowed as the core wants them.
    pub fn balls(&self) -> Balls<'_> {
        Balls::new(&self.positions, &self.radii, &self.weights).expect("only usable balls were kept")
    }
}

/// Rays from near the origin, and any others.
#[derive(Arbitrary, Debug)]
pub struct RayArrays {
    near: Vec<([i8; 3], [i8; 3])>,
    any: Vec<([f64; 3], [f64; 3])>,
}

impl RayArrays {
    /// Origins and directions.
    pub fn arrays(&self) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
        let near = self.near.iter().map(|(o, d)| (o.map(|n| f64::from(n) / 8.0), d.map(f64::from)));
        near.chain(self.any.iter().copied()).take(MOST_RAYS).unzip()
    }
}

/// Whether a normal has the length 1, as far as float32 can tell.
pub fn is_unit(normal: [f64; 3]) -> bool {
    (normal.iter().map(|n| n * n).sum::<f64>() - 1.0).abs() < 1e-5
}
