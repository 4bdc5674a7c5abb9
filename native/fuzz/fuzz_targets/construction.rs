//! Any numbers at all: what is accepted keeps what its documentation promises.

#![no_main]

use libfuzzer_sys::arbitrary::{self, Arbitrary};
use libfuzzer_sys::fuzz_target;
use meniscus_core::balls::Balls;
use meniscus_core::field::Field;
use meniscus_core::kernel::Kernel;

#[derive(Arbitrary, Debug)]
struct Input {
    coefficients: Coefficients,
    isovalue: f64,
    weight: f64,
    x: f64,
    positions: Vec<[f32; 3]>,
    radii: Vec<f32>,
    weights: Vec<f32>,
}

/// Random numbers are hardly ever those of a kernel, so shares of 1 are tried as well.
#[derive(Arbitrary, Debug)]
enum Coefficients {
    Any(Vec<f64>),
    Shares(Vec<u8>),
}

impl Coefficients {
    fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Any(numbers) => numbers.clone(),
            Self::Shares(shares) => {
                let sum: f64 = shares.iter().copied().map(f64::from).sum();
                [0.0].into_iter().chain(shares.iter().map(|share| f64::from(*share) / sum)).collect()
            }
        }
    }
}

fuzz_target!(|input: Input| {
    if let Ok(kernel) = Kernel::new(&input.coefficients.numbers()) {
        check_kernel(kernel, input.x);
        if let Ok(field) = Field::new(kernel, input.isovalue) {
            let share = field.kernel_radius_share(input.weight);
            assert!((0.0..=1.0).contains(&share), "{share}");
        }
    }
    if let Ok(balls) = Balls::new(&input.positions, &input.radii, &input.weights) {
        assert_eq!([balls.positions().len(), balls.radii().len(), balls.weights().len()], [balls.len(); 3]);
        assert!(balls.radii().iter().all(|radius| *radius > 0.0 && radius.is_finite()));
        assert!(balls.positions().as_flattened().iter().chain(balls.weights()).all(|number| number.is_finite()));
    }
});

fn check_kernel(kernel: Kernel, x: f64) {
    let ends = [kernel.value(0.0), kernel.value(1.0)];
    assert!(ends[0] == 0.0 && (ends[1] - 1.0).abs() < 1e-11, "{ends:?}");
    let inside = x.abs().fract();
    if inside.is_nan() {
        return;
    }
    assert!(kernel.derivative(inside) >= 0.0);
    let density = kernel.value(inside);
    if let Some(back) = kernel.inverse(density) {
        assert!((0.0..=1.0).contains(&back), "{back}");
        assert!((kernel.value(back) - density).abs() < 1e-11, "{inside} {density} {back}");
    } else {
        assert!(density > 1.0, "{inside} {density}");
    }
}
