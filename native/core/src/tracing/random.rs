//! Points that fill a square evenly, however many of them are taken: Sobol's sequence, scrambled as Owen does it, anew for each
//! pixel and each use (Burley 2020). Each number follows from its seed and its index alone, so a picture is the same for any
//! number of threads.

use std::f64::consts::TAU;

/// Mixes the bits of a number, each of which changes half of the others (Wellons 2018).
#[inline(always)]
pub fn mixed(number: u32) -> u32 {
    let number = (number ^ number >> 16).wrapping_mul(0x7feb_352d);
    let number = (number ^ number >> 15).wrapping_mul(0x846c_a68b);
    number ^ number >> 16
}

/// The seed of a further use.
#[inline(always)]
pub fn branch(seed: u32, use_number: u32) -> u32 {
    mixed(seed ^ use_number.wrapping_mul(0x9e37_79b9))
}

/// A point of the unit square; the coordinates are less than 1.
#[inline(always)]
pub fn square(seed: u32, index: u32) -> [f64; 2] {
    // Indices of an aligned block stay one.
    let index = scrambled(index.reverse_bits(), seed).reverse_bits();
    [fraction(index, branch(seed, 1)), fraction(sobol(index).reverse_bits(), branch(seed, 2))]
}

/// Scrambles the digits of a binary fraction, the last of which comes first, and gives its value.
#[inline(always)]
fn fraction(reversed: u32, seed: u32) -> f64 {
    f64::from(scrambled(reversed, seed).reverse_bits()) / 4_294_967_296.0
}

/// The second coordinate of Sobol's sequence, as bits of a fraction.
#[inline(always)]
fn sobol(index: u32) -> u32 {
    let (mut rest, mut direction, mut bits) = (index, 1u32 << 31, 0);
    while rest != 0 {
        if rest & 1 == 1 {
            bits ^= direction;
        }
        rest >>= 1;
        direction ^= direction >> 1;
    }
    bits
}

/// Permutes numbers such that each bit depends on itself and on lower ones (Laine and Karras 2011, constants by Burley 2020).
#[inline(always)]
fn scrambled(number: u32, seed: u32) -> u32 {
    let mut number = number.wrapping_add(seed);
    for factor in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        number ^= number.wrapping_mul(factor);
    }
    number
}

/// A direction that follows from a number, any as likely as any other.
pub fn any_direction(number: u32) -> [f64; 3] {
    let fraction = |number: u32| f64::from(mixed(number)) / f64::from(u32::MAX);
    let z = 2.0 * fraction(number) - 1.0;
    let (sine, cosine) = (TAU * fraction(number ^ 0x55aa_55aa)).sin_cos();
    let radius = (1.0 - z * z).max(0.0).sqrt();
    [radius * cosine, radius * sine, z]
}

/// A direction about z, by the cosine of the angle to it.
#[inline(always)]
pub fn by_cosine([u, v]: [f64; 2]) -> [f64; 3] {
    let (sine, cosine) = (TAU * v).sin_cos();
    let radius = u.sqrt();
    [radius * cosine, radius * sine, (1.0 - u).sqrt()]
}

/// A direction about z, evenly over a cone of which `1 - cosine` is given.
#[inline(always)]
pub fn in_cone([u, v]: [f64; 2], one_less_cosine: f64) -> [f64; 3] {
    let low = u * one_less_cosine;
    let radius = (low * (2.0 - low)).max(0.0).sqrt();
    let (sine, cosine) = (TAU * v).sin_cos();
    [radius * cosine, radius * sine, 1.0 - low]
}

/// The normal of a facet of Trowbridge and Reitz's distribution, as an eye in the direction `to_eye` about z sees them (Dupuy
/// and Benyoub 2023).
#[inline(always)]
pub fn facet([x, y, z]: [f64; 3], alpha: f64, [u, v]: [f64; 2]) -> [f64; 3] {
    let eye = crate::vectors::unit([alpha * x, alpha * y, z]);
    let (sine, cosine) = (TAU * u).sin_cos();
    let height = (1.0 - v) * (1.0 + eye[2]) - eye[2];
    let radius = (1.0 - height * height).max(0.0).sqrt();
    crate::vectors::unit([alpha * (radius * cosine + eye[0]), alpha * (radius * sine + eye[1]), (height + eye[2]).max(1e-9)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_in_every_cell_of_a_grid() {
        for seed in [0, 1, 12345] {
            // Of any 2^k points in a row from a multiple of 2^k, one lies in each cell of every elementary grid.
            for columns in [1, 4, 16, 64] {
                let mut seen = [0; 64];
                for index in 64..128 {
                    let [u, v] = square(seed, index);
                    let rows = 64 / columns;
                    seen[(u * columns as f64) as usize * rows + (v * rows as f64) as usize] += 1;
                }
                assert_eq!(seen, [1; 64], "seed {seed}, {columns} columns");
            }
        }
    }

    #[test]
    fn seeds_are_independent() {
        let correlation: f64 = (0..4096).map(|seed| (square(seed, 0)[0] - 0.5) * (square(seed + 1, 0)[0] - 0.5)).sum();
        assert!((correlation / 4096.0 * 12.0).abs() < 0.06, "{correlation}");
        let mean: f64 = (0..4096).map(|seed| square(mixed(seed), 0)[1]).sum();
        assert!((mean / 4096.0 - 0.5).abs() < 0.02);
    }

    #[test]
    fn directions_have_their_densities() {
        let mut cosines = [0.0; 3];
        for index in 0..1024 {
            let point = square(7, index);
            cosines[0] += by_cosine(point)[2] / 1024.0;
            cosines[1] += in_cone(point, 0.5)[2] / 1024.0;
            // At alpha 1 all facets of a hemisphere are seen from above, by the cosine.
            cosines[2] += facet([0.0, 0.0, 1.0], 1.0, point)[2] / 1024.0;
        }
        for (cosine, expected) in cosines.into_iter().zip([2.0 / 3.0, 0.75, 2.0 / 3.0]) {
            assert!((cosine - expected).abs() < 1e-3, "{cosine}, not {expected}");
        }
    }
}
