//! The density field whose isosurface is the fluid.

use crate::error::{Error, Result};
use crate::kernel::Kernel;

/// The surface is where `sum_i q_i f(x_i) = isovalue`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// f.
    pub kernel: Kernel,
    /// T, finite and greater than 0.
    pub isovalue: f64,
}

impl Field {
    /// The field of a kernel and an isovalue.
    ///
    /// # Errors
    /// `InvalidInput` where the isovalue is not a positive number.
    pub fn new(kernel: Kernel, isovalue: f64) -> Result<Self> {
        if !(isovalue.is_finite() && isovalue > 0.0) {
            return Err(Error::InvalidInput(format!("the isovalue must be a positive number, not {isovalue}")));
        }
        Ok(Self { kernel, isovalue })
    }

    /// Radius of a ball's kernel sphere, the surface that it would have alone, as a share of its influence radius; 0 where
    /// it has none (Kanamori et al. 2008, section 5.2).
    pub fn kernel_radius_share(&self, weight: f64) -> f64 {
        if weight <= 0.0 {
            return 0.0;
        }
        self.kernel.inverse(self.isovalue / weight).map_or(0.0, |x| (1.0 - x).max(0.0).sqrt())
    }
}
