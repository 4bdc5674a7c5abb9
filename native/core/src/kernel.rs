//! Density kernels: polynomials `f(x)` in `x = 1 - |p - c|^2 / R^2`, zero where `x <= 0`.

use crate::error::{Error, Result};

/// The highest power of x in a kernel.
pub const MAX_POWER: usize = 4;

/// A polynomial density kernel `f(x) = sum_k coefficients[k] x^k` with `f(0) = 0`, `f(1) = 1` and no negative coefficient,
/// so that it rises.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel {
    coefficients: [f64; MAX_POWER + 1],
}

impl Kernel {
    /// The kernel with these coefficients, the constant first.
    ///
    /// # Errors
    /// `InvalidInput` where they are not those of a kernel.
    pub fn new(coefficients: &[f64]) -> Result<Self> {
        let sum: f64 = coefficients.iter().sum();
        let is_kernel = (2..=MAX_POWER + 1).contains(&coefficients.len())
            && coefficients[0] == 0.0
            && coefficients.iter().all(|c| *c >= 0.0)
            && (sum - 1.0).abs() < 1e-12;
        if !is_kernel {
            return Err(Error::InvalidInput(format!(
                "a kernel has 2 to {} coefficients, the first 0, none negative, their sum 1, not {coefficients:?}",
                MAX_POWER + 1
            )));
        }
        let mut padded = [0.0; MAX_POWER + 1];
        padded[..coefficients.len()].copy_from_slice(coefficients);
        Ok(Self { coefficients: padded })
    }

    /// All coefficients; those beyond the degree are 0.
    pub fn coefficients(&self) -> &[f64; MAX_POWER + 1] {
        &self.coefficients
    }

    /// `f(x)`.
    pub fn value(&self, x: f64) -> f64 {
        let inside = x.max(0.0);
        self.coefficients.iter().rev().fold(0.0, |sum, c| sum * inside + c)
    }

    /// `f'(x)`, 0 where `x <= 0`.
    pub fn derivative(&self, x: f64) -> f64 {
        if x <= 0.0 {
            return 0.0;
        }
        (1..=MAX_POWER).rev().fold(0.0, |sum, power| sum * x + power as f64 * self.coefficients[power])
    }

    /// `f''(x)`, 0 where `x <= 0`.
    pub fn second_derivative(&self, x: f64) -> f64 {
        if x <= 0.0 {
            return 0.0;
        }
        (2..=MAX_POWER).rev().fold(0.0, |sum, power| sum * x + (power * (power - 1)) as f64 * self.coefficients[power])
    }

    /// x in [0, 1] with `f(x) = density`, where `density` is in [0, 1].
    pub fn inverse(&self, density: f64) -> Option<f64> {
        if !(0.0..=1.0).contains(&density) {
            return None;
        }
        // f is convex and rising on [0, 1], so Newton from x = 1 comes down to the root without passing it.
        let mut x = 1.0;
        for _ in 0..64 {
            let slope = self.derivative(x);
            let step = if slope > 0.0 { (self.value(x) - density) / slope } else { 0.0 };
            x = (x - step).max(0.0);
            if step < 1e-15 {
                break;
            }
        }
        Some(x)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// All kernels of Meniscus, by name.
    pub(crate) fn kernels() -> [(&'static str, Kernel); 5] {
        let kernel = |coefficients: &[f64]| Kernel::new(coefficients).expect("a kernel");
        [
            ("wyvill", kernel(&[0.0, 0.0, 5.0 / 9.0, 4.0 / 9.0])),
            ("quartic", kernel(&[0.0, 0.0, 1.0])),
            ("poly6", kernel(&[0.0, 0.0, 0.0, 1.0])),
            ("power_4", kernel(&[0.0, 0.0, 0.0, 0.0, 1.0])),
            ("power_1", kernel(&[0.0, 1.0])),
        ]
    }

    #[test]
    fn inverse_undoes_value() {
        for (name, kernel) in kernels() {
            for step in 0..=20 {
                let density = f64::from(step) / 20.0;
                let x = kernel.inverse(density).expect("in range");
                assert!((kernel.value(x) - density).abs() < 1e-14, "{name} {density}");
            }
            assert_eq!(kernel.inverse(1.5), None);
        }
    }

    #[test]
    fn derivatives_are_the_slopes_of_what_they_derive() {
        for (name, kernel) in kernels() {
            for x in [0.1, 0.5, 0.9] {
                let slope = (kernel.value(x + 1e-6) - kernel.value(x - 1e-6)) / 2e-6;
                assert!((kernel.derivative(x) - slope).abs() < 1e-8, "{name} {x}");
                let change = (kernel.derivative(x + 1e-6) - kernel.derivative(x - 1e-6)) / 2e-6;
                assert!((kernel.second_derivative(x) - change).abs() < 1e-8, "{name} {x}");
            }
            assert_eq!([kernel.derivative(-0.5), kernel.second_derivative(-0.5)], [0.0; 2]);
        }
    }

    #[test]
    fn what_is_no_kernel_is_refused() {
        for coefficients in [&[][..], &[0.0], &[0.5, 0.5], &[0.0, 2.0], &[0.0, f64::NAN], &[0.0, 2.0, -1.0]] {
            assert!(Kernel::new(coefficients).is_err(), "{coefficients:?}");
        }
    }
}
