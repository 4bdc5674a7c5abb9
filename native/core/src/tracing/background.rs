//! The world as a camera sees it, where there is nothing else.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::job::Job;
use crate::tile_caster::View;

use super::world::World;
use crate::vectors::{plus, unit};

/// Fills an image, row 0 at the bottom, with what comes from afar; it is opaque.
///
/// # Errors
/// `InvalidInput` for an unusable view or an image of another size, `Cancelled`.
pub fn show_world(view: &View, world: &World<'_>, rgba: &mut [[f32; 4]], job: &Job) -> Result<()> {
    view.check()?;
    if rgba.len() != view.width * view.height {
        return Err(Error::InvalidInput("the image must have the size of the camera's".into()));
    }
    job.expect(view.height);
    rgba.par_chunks_mut(view.width).enumerate().try_for_each(|(row, pixels)| {
        for (column, pixel) in pixels.iter_mut().enumerate() {
            let [r, g, b] = world.radiance(direction(view, column, row));
            *pixel = [r, g, b, 1.0];
        }
        job.advance(1)
    })
}

/// Unit, into the image.
fn direction(view: &View, column: usize, row: usize) -> [f64; 3] {
    let [right, up, forward] = view.camera_from_world;
    if !view.is_perspective {
        return forward;
    }
    let [x, y] = view.pixel_center(column, row);
    unit(plus(plus(forward, x, right), y, up))
}

#[cfg(test)]
mod tests {
    use super::super::world::WorldImage;
    use super::*;

    #[test]
    fn the_world_is_seen_where_pixels_look() {
        let pixels = (0..64 * 32).map(|index| [(index % 64) as f32, (index / 64) as f32, 7.0]).collect();
        let image = WorldImage::new(pixels, 64, 32).unwrap();
        let upright = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let world = World { color: [0.0; 3], image: Some((&image, upright)) };
        // Along x; to the right lies -y.
        let mut view = View {
            camera_from_world: [[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
            eye: [0.0; 3],
            window: [-1.5, 1.5, -1.5, 1.5],
            is_perspective: true,
            width: 3,
            height: 3,
            clip: [0.1, 10.0],
        };
        let mut rgba = vec![[0.0; 4]; 9];
        show_world(&view, &world, &mut rgba, &Job::default()).unwrap();
        // 45 degrees are an eighth of the width, a quarter of the height.
        let close =
            |pixel: [f32; 4], expected: [f32; 4]| assert!(pixel.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4));
        close(rgba[4], [31.5, 15.5, 7.0, 1.0]);
        close(rgba[5], [39.5, 15.5, 7.0, 1.0]);
        close(rgba[7], [31.5, 23.5, 7.0, 1.0]);
        view.is_perspective = false;
        show_world(&view, &world, &mut rgba, &Job::default()).unwrap();
        close(rgba[8], [31.5, 15.5, 7.0, 1.0]);
        assert!(show_world(&view, &world, &mut rgba[1..], &Job::default()).is_err());
    }
}
