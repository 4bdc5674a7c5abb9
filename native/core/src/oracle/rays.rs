//! The rays that are cast.

use crate::error::{Error, Result};

/// Rays, borrowed from their owner: finite origins in world space, and directions that are finite and not 0.
#[derive(Clone, Copy, Debug)]
pub struct Rays<'a> {
    origins: &'a [[f64; 3]],
    directions: &'a [[f64; 3]],
}

impl<'a> Rays<'a> {
    /// Checks and borrows the arrays. Directions need not be unit.
    ///
    /// # Errors
    /// `InvalidInput` where lengths differ, a number is not finite, or a direction is 0.
    pub fn new(origins: &'a [[f64; 3]], directions: &'a [[f64; 3]]) -> Result<Self> {
        let fail = |sentence: String| Err(Error::InvalidInput(sentence));
        if origins.len() != directions.len() {
            return fail(format!(
                "there must be one direction for each of the {} origins, not {}",
                origins.len(),
                directions.len()
            ));
        }
        if let Some(ray) = origins.iter().position(|origin| !is_finite(origin)) {
            return fail(format!("all origins must be finite; that of ray {ray} is {:?}", origins[ray]));
        }
        if let Some(ray) = directions.iter().position(|direction| !is_finite(direction) || *direction == [0.0; 3]) {
            let wrong = directions[ray];
            return fail(format!(
                "all directions must be finite, and no direction may be zero; that of ray {ray} is {wrong:?}"
            ));
        }
        Ok(Self { origins, directions })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.origins.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.origins.is_empty()
    }

    /// The ray with its direction made unit.
    pub(super) fn unit(&self, index: usize) -> Ray {
        // `new` has seen that it is not 0.
        Ray { origin: self.origins[index], direction: unit(self.directions[index]).unwrap_or_default() }
    }
}

/// A ray with a unit direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub origin: [f64; 3],
    pub direction: [f64; 3],
}

impl Ray {
    /// How a point lies to the ray: the distance along the ray to where it is nearest, and the vector from there to the point.
    pub fn nearest(&self, point: [f64; 3]) -> (f64, [f64; 3]) {
        // Subtracted first, so that nothing is lost far from the world's origin.
        let to_point: [f64; 3] = std::array::from_fn(|axis| point[axis] - self.origin[axis]);
        let along = dot(to_point, self.direction);
        (along, std::array::from_fn(|axis| to_point[axis] - along * self.direction[axis]))
    }
}

/// The vector at length 1; None where it is 0.
pub(crate) fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    // Squares of very small and very large numbers leave the range of a double.
    let largest = vector.iter().fold(0.0f64, |largest, number| largest.max(number.abs()));
    if largest == 0.0 {
        return None;
    }
    let scaled = vector.map(|number| number / largest);
    let length = dot(scaled, scaled).sqrt();
    Some(scaled.map(|number| number / length))
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn is_finite(vector: &[f64; 3]) -> bool {
    vector.iter().all(|number| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_of_any_length_become_unit() {
        for scale in [5e-324, 1e-200, 1.0, 1e200, f64::MAX] {
            let (origins, directions) = ([[0.0; 3]], [[0.0, -scale, 0.0]]);
            let rays = Rays::new(&origins, &directions).expect("rays");
            assert_eq!(rays.unit(0).direction, [0.0, -1.0, 0.0], "{scale}");
        }
        let slanted = unit([3e-200, 0.0, 4e-200]).expect("not 0");
        assert!((slanted[0] - 0.6).abs() < 1e-15 && (slanted[2] - 0.8).abs() < 1e-15);
    }

    #[test]
    fn unusable_rays_are_named() {
        let sentence =
            |origins: &[[f64; 3]], directions: &[[f64; 3]]| Rays::new(origins, directions).expect_err("unusable").to_string();
        let (fine, zero, nan) = ([1.0, 0.0, 0.0], [0.0; 3], [0.0, f64::NAN, 0.0]);
        assert!(sentence(&[fine; 2], &[fine]).contains("one direction for each of the 2 origins, not 1"));
        assert!(sentence(&[fine; 2], &[fine, zero]).contains("no direction may be zero; that of ray 1"));
        assert!(sentence(&[fine; 2], &[nan, fine]).contains("directions must be finite"));
        assert!(sentence(&[fine, nan], &[fine; 2]).contains("origins must be finite; that of ray 1"));
        assert!(sentence(&[fine], &[[f64::INFINITY, 0.0, 0.0]]).contains("directions must be finite"));
    }
}
