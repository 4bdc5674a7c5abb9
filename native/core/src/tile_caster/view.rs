//! The camera, and the rays of its pixels.

use crate::error::{Error, Result};

/// The largest image side; pixels are numbered with 16 bits.
pub const MAX_SIDE: usize = u16::MAX as usize;

/// A camera without a render region: to render a part of an image, crop its window.
///
/// Camera space has x to the right, y up and the planar depth as third coordinate, in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Rows: the camera's right, up and forward directions in world space, unit.
    pub camera_from_world: [[f64; 3]; 3],
    /// World space.
    pub eye: [f64; 3],
    /// Left, right, bottom and top of the image: at depth 1 (perspective) or in world units (orthographic).
    pub window: [f64; 4],
    /// Whether rays start in one point, else they are parallel.
    pub is_perspective: bool,
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
    /// Planar depths between which the surface is looked for.
    pub clip: [f64; 2],
}

impl View {
    /// Checks the numbers.
    ///
    /// # Errors
    /// `InvalidInput` where one is unusable.
    pub fn check(&self) -> Result<()> {
        let [left, right, bottom, top] = self.window;
        let numbers = self.camera_from_world.iter().flatten().chain(&self.eye).chain(&self.window).chain(&self.clip);
        let problem = if !numbers.into_iter().all(|number| number.is_finite()) {
            "has a number that is not finite"
        } else if left >= right || bottom >= top {
            "shows an empty rectangle"
        } else if self.clip[0] < 0.0 || self.clip[0] >= self.clip[1] {
            "must have a clip start of at least 0 and less than its clip end"
        } else if !(1..=MAX_SIDE).contains(&self.width) || !(1..=MAX_SIDE).contains(&self.height) {
            "must have from 1 to 65535 pixels a side"
        } else {
            return Ok(());
        };
        Err(Error::InvalidInput(format!("the camera {problem}")))
    }

    /// Width and height of a pixel in units of the window.
    pub fn pixel_size(&self) -> [f64; 2] {
        let [left, right, bottom, top] = self.window;
        [(right - left) / self.width as f64, (top - bottom) / self.height as f64]
    }

    /// Where in the window the centre of a pixel lies.
    pub fn pixel_center(&self, column: usize, row: usize) -> [f64; 2] {
        let size = self.pixel_size();
        [self.window[0] + (column as f64 + 0.5) * size[0], self.window[2] + (row as f64 + 0.5) * size[1]]
    }
}
