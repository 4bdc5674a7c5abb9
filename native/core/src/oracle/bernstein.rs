//! Polynomials in Bernstein form on [0, 1], and where they change their sign.

use std::ops::ControlFlow;

use crate::kernel::{Kernel, MAX_POWER};

/// Along a ray x is a quadratic.
const MAX_DEGREE: usize = 2 * MAX_POWER;

/// Parts of [0, 1] are not halved below this width, where the distances along a ray no longer differ.
const MIN_WIDTH: f64 = f64::EPSILON;

/// `PRODUCT[n][k][j]`: in the product of a polynomial p of the degree n - 2 with a quadratic x, the coefficient k is the sum
/// over j of this times `p[k - j] x[j]`.
const PRODUCT: [[[f64; 3]; MAX_DEGREE + 1]; MAX_DEGREE + 1] = product_shares();

/// On which side of zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    Negative,
    Positive,
}

/// `p(u) = sum_k coefficients[k] binomial(degree, k) u^k (1 - u)^(degree - k)`.
#[derive(Clone, Copy, Debug)]
pub struct Bernstein {
    degree: usize,
    coefficients: [f64; MAX_DEGREE + 1],
}

impl Bernstein {
    /// 0, with the degree of a kernel along a ray.
    pub fn zero(kernel: Kernel) -> Self {
        Self { degree: 2 * power(kernel), coefficients: [0.0; MAX_DEGREE + 1] }
    }

    /// `f(x(u))` for a quadratic x in Bernstein form. Where x is not negative nothing cancels.
    pub fn of_kernel(kernel: Kernel, x: [f64; 3]) -> Self {
        let (leading, rest) = kernel.coefficients()[..=power(kernel)].split_last().unwrap_or((&0.0, &[]));
        let mut result = Self { degree: 0, coefficients: [0.0; MAX_DEGREE + 1] };
        result.add_constant(*leading);
        for coefficient in rest.iter().rev() {
            result = result.times_quadratic(x);
            result.add_constant(*coefficient);
        }
        result
    }

    fn times_quadratic(&self, x: [f64; 3]) -> Self {
        let degree = self.degree + 2;
        let mut coefficients = [0.0; MAX_DEGREE + 1];
        for (j, factor) in x.iter().enumerate() {
            for (k, p) in self.used().iter().enumerate() {
                coefficients[k + j] += PRODUCT[degree][k + j][j] * factor * p;
            }
        }
        Self { degree, coefficients }
    }

    /// Adds `scale` times another polynomial of the same degree.
    pub fn add_scaled(&mut self, other: &Self, scale: f64) {
        for (sum, coefficient) in self.coefficients.iter_mut().zip(other.used()) {
            *sum += scale * coefficient;
        }
    }

    /// Adds a number.
    pub fn add_constant(&mut self, constant: f64) {
        for coefficient in &mut self.coefficients[..=self.degree] {
            *coefficient += constant;
        }
    }

    /// The size of the largest coefficient, which p does not exceed.
    pub fn largest(&self) -> f64 {
        self.used().iter().fold(0.0, |largest, coefficient| largest.max(coefficient.abs()))
    }

    /// Calls `visit` with the sign of the polynomial, and where it has it from, each time that it may have changed, from 0 to 1
    /// until it breaks off. Coefficients within `rounding` of 0 have no sign.
    ///
    /// The coefficients change their sign as often as the polynomial, or more often by an even number (Lane and Riesenfeld
    /// 1981). Where that leaves a doubt the part is halved.
    pub fn walk_signs(&self, rounding: f64, visit: &mut impl FnMut(f64, Sign) -> ControlFlow<()>) -> ControlFlow<()> {
        self.walk_part(0.0, 1.0, rounding, visit)
    }

    /// As `walk_signs`, of a polynomial that is the part [low, low + width] of another.
    fn walk_part(
        &self,
        low: f64,
        width: f64,
        rounding: f64,
        visit: &mut impl FnMut(f64, Sign) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let mut signs = self.used().iter().filter_map(|coefficient| sign(*coefficient, rounding));
        let Some(first) = signs.next() else {
            return ControlFlow::Continue(());
        };
        let (last, changes) = signs.fold((first, 0), |(last, changes), sign| (sign, changes + usize::from(sign != last)));
        match changes {
            0 => visit(low, first),
            1 => {
                visit(low, first)?;
                visit(low + width * self.change_to(last), last)
            }
            _ if width <= MIN_WIDTH => ControlFlow::Continue(()),
            _ => {
                let (left, right) = self.halves();
                left.walk_part(low, 0.5 * width, rounding, visit)?;
                right.walk_part(low + 0.5 * width, 0.5 * width, rounding, visit)
            }
        }
    }

    /// Where a polynomial that changes its sign once has `sign` from. Bisection takes a microsecond and cannot go astray.
    fn change_to(&self, sign: Sign) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        while high - low > MIN_WIDTH {
            let middle = 0.5 * (low + high);
            if (self.value(middle) > 0.0) == (sign == Sign::Positive) {
                high = middle;
            } else {
                low = middle;
            }
        }
        0.5 * (low + high)
    }

    /// `p(u)` (de Casteljau).
    fn value(&self, u: f64) -> f64 {
        let mut part = self.coefficients;
        for last in (0..self.degree).rev() {
            for k in 0..=last {
                part[k] = (1.0 - u) * part[k] + u * part[k + 1];
            }
        }
        part[0]
    }

    /// The parts on [0, 1/2] and [1/2, 1], stretched to [0, 1] (de Casteljau).
    fn halves(&self) -> (Self, Self) {
        let (mut left, mut right) = (*self, *self);
        for step in 1..=self.degree {
            for k in 0..=self.degree - step {
                right.coefficients[k] = 0.5 * (right.coefficients[k] + right.coefficients[k + 1]);
            }
            left.coefficients[step] = right.coefficients[0];
        }
        (left, right)
    }

    fn used(&self) -> &[f64] {
        &self.coefficients[..=self.degree]
    }
}

fn sign(coefficient: f64, rounding: f64) -> Option<Sign> {
    if coefficient > rounding {
        Some(Sign::Positive)
    } else if coefficient < -rounding {
        Some(Sign::Negative)
    } else {
        None
    }
}

/// The highest power of x in a kernel.
fn power(kernel: Kernel) -> usize {
    kernel.coefficients().iter().rposition(|coefficient| *coefficient != 0.0).unwrap_or(0)
}

/// `binomial(n - 2, k - j) binomial(2, j) / binomial(n, k)`.
const fn product_shares() -> [[[f64; 3]; MAX_DEGREE + 1]; MAX_DEGREE + 1] {
    let mut shares = [[[0.0; 3]; MAX_DEGREE + 1]; MAX_DEGREE + 1];
    let mut n = 2;
    while n <= MAX_DEGREE {
        let mut k = 0;
        while k <= n {
            let pairs = (n * (n - 1)) as f64;
            let rest = n - k;
            shares[n][k][0] = (rest * rest.saturating_sub(1)) as f64 / pairs;
            shares[n][k][1] = (2 * k * rest) as f64 / pairs;
            shares[n][k][2] = (k * k.saturating_sub(1)) as f64 / pairs;
            k += 1;
        }
        n += 1;
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::tests::kernels;

    const POINTS: [f64; 7] = [0.0, 0.1, 0.3, 0.5, 0.625, 0.9, 1.0];

    fn polynomial(coefficients: &[f64]) -> Bernstein {
        let mut padded = [0.0; MAX_DEGREE + 1];
        padded[..coefficients.len()].copy_from_slice(coefficients);
        Bernstein { degree: coefficients.len() - 1, coefficients: padded }
    }

    /// `product (u - root)` over pairs of roots.
    fn with_roots(pairs: &[[f64; 2]]) -> Bernstein {
        let quadratic = |[a, b]: [f64; 2]| [a * b, a * b - 0.5 * (a + b), (1.0 - a) * (1.0 - b)];
        pairs.iter().fold(polynomial(&[1.0]), |product, pair| product.times_quadratic(quadratic(*pair)))
    }

    /// Where the sign changes, and from where on to what.
    fn changes(p: &Bernstein, rounding: f64) -> Vec<(f64, Sign)> {
        let mut found: Vec<(f64, Sign)> = Vec::new();
        let _ = p.walk_signs(rounding, &mut |u, sign| {
            if found.last().is_none_or(|(_, last)| *last != sign) {
                found.push((u, sign));
            }
            ControlFlow::Continue(())
        });
        found
    }

    fn check_changes(p: &Bernstein, expected: &[(f64, Sign)]) {
        let found = changes(p, 1e-17);
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for ((u, sign), (expected_u, expected_sign)) in found.iter().zip(expected) {
            assert!((u - expected_u).abs() < 1e-12 && sign == expected_sign, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn value_is_that_of_the_definition() {
        let coefficients = [0.3, -1.0, 2.0, 0.7, 5.0, -2.0, 1.5];
        for u in POINTS {
            let binomials = [1.0, 6.0, 15.0, 20.0, 15.0, 6.0, 1.0];
            let term = |k: usize| binomials[k] * u.powi(k as i32) * (1.0 - u).powi(6 - k as i32) * coefficients[k];
            let expected: f64 = (0..=6).map(term).sum();
            assert!((polynomial(&coefficients).value(u) - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn kernels_along_a_ray_are_composed() {
        let x = [0.2, 0.9, 0.4];
        for (name, kernel) in kernels() {
            let composed = Bernstein::of_kernel(kernel, x);
            assert_eq!(composed.degree, Bernstein::zero(kernel).degree);
            for u in POINTS {
                let expected = kernel.value(polynomial(&x).value(u));
                assert!((composed.value(u) - expected).abs() < 1e-15, "{name} {u}");
            }
            assert_eq!(composed.coefficients[0], kernel.value(x[0]), "{name}: neighbouring intervals must agree");
            assert_eq!(composed.coefficients[composed.degree], kernel.value(x[2]), "{name}: neighbouring intervals must agree");
        }
    }

    #[test]
    fn halves_are_the_polynomial_on_half_the_range() {
        let p = polynomial(&[0.3, -1.0, 2.0, 0.7, 5.0]);
        let (left, right) = p.halves();
        for u in POINTS {
            assert!((left.value(u) - p.value(0.5 * u)).abs() < 1e-15);
            assert!((right.value(u) - p.value(0.5 + 0.5 * u)).abs() < 1e-15);
        }
    }

    #[test]
    fn all_changes_of_sign_are_found_in_order() {
        use Sign::{Negative, Positive};
        check_changes(
            &with_roots(&[[0.2, 0.75], [0.5, 3.0]]),
            &[(0.0, Positive), (0.2, Negative), (0.5, Positive), (0.75, Negative)],
        );
        check_changes(
            &with_roots(&[[0.25, 0.5], [0.5001, 0.875], [0.9, -1.0], [2.0, 2.0]]),
            &[(0.0, Negative), (0.25, Positive), (0.5, Negative), (0.5001, Positive), (0.875, Negative), (0.9, Positive)],
        );
        check_changes(&with_roots(&[[-0.1, 1.1]]), &[(0.0, Negative)]);
    }

    #[test]
    fn roots_at_the_ends_and_where_halves_meet_count_once() {
        use Sign::{Negative, Positive};
        check_changes(&with_roots(&[[0.0, 0.5]]), &[(0.0, Negative), (0.5, Positive)]);
        check_changes(&with_roots(&[[0.5, 1.0]]), &[(0.0, Positive), (0.5, Negative)]);
        check_changes(
            &with_roots(&[[0.25, 0.5], [0.75, 1.0]]),
            &[(0.0, Positive), (0.25, Negative), (0.5, Positive), (0.75, Negative)],
        );
    }

    #[test]
    fn double_roots_are_passed_and_near_misses_told_apart() {
        use Sign::Positive;
        assert_eq!(changes(&with_roots(&[[0.3, 0.3]]), 1e-16), [(0.0, Positive)]);
        let mut below = with_roots(&[[0.3, 0.3]]);
        below.add_constant(-1e-14);
        assert_eq!(changes(&below, 1e-16).len(), 3);
        let mut above = with_roots(&[[0.3, 0.3]]);
        above.add_constant(1e-14);
        assert_eq!(changes(&above, 1e-16), [(0.0, Positive)]);
    }

    #[test]
    fn nothing_but_rounding_has_no_sign() {
        assert_eq!(changes(&polynomial(&[1e-17, -1e-17, 1e-17]), 1e-16), []);
    }

    #[test]
    fn the_walk_ends_where_it_is_told_to() {
        let mut calls = 0;
        let flow = with_roots(&[[0.2, 0.7]]).walk_signs(1e-16, &mut |_, sign| {
            calls += 1;
            if sign == Sign::Negative { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!((flow, calls), (ControlFlow::Break(()), 2));
    }
}
