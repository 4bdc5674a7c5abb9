//! What follows from where the surface of an image lies: positions, how it faces the eye, and how it moves in the image.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::job::Job;
pub use crate::tile_caster::View;

/// Rows that a thread fills at a time.
const ROWS: usize = 8;

/// Pixels that a thread labels at a time.
const LABELS: usize = 1 << 14;

/// An image of a surface, row 0 at the bottom.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// Planar depth; `background` or more where there is nothing.
    pub depth: &'a [f32],
    /// What stands for no depth.
    pub background: f32,
    /// Unit, world space.
    pub normal: &'a [[f32; 3]],
    /// World space, units a second; empty for 0.
    pub velocity: &'a [[f32; 3]],
}

/// The camera one frame before and one after, and the seconds between frames.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// One frame before.
    pub previous: &'a View,
    /// One frame after.
    pub following: &'a View,
    /// From one frame to the next.
    pub seconds: f64,
}

/// Images to be filled; empty ones are left out. 0 where there is nothing.
#[derive(Debug)]
pub struct Places<'a> {
    /// World space.
    pub position: &'a mut [[f32; 3]],
    /// Cosine between normal and line of sight.
    pub facing: &'a mut [f32],
    /// Pixels: where the point was less where it is, then where it is less where it will be.
    pub vector: &'a mut [[f32; 4]],
    /// Length of the velocity.
    pub speed: &'a mut [f32],
}

/// Fills the images of a surface that a view sees.
///
/// # Errors
/// `InvalidInput` where sizes differ or a camera is unusable, `Cancelled`.
pub fn place(view: &View, surface: Surface<'_>, motion: Motion<'_>, places: Places<'_>, job: &Job) -> Result<()> {
    for camera in [view, motion.previous, motion.following] {
        camera.check()?;
    }
    let pixels = view.width * view.height;
    let fits = |count: usize| [0, pixels].contains(&count);
    let Places { position, facing, vector, speed } = places;
    let sizes_fit = [position.len(), facing.len(), vector.len(), speed.len(), surface.velocity.len()].into_iter().all(fits);
    if !sizes_fit || surface.depth.len() != pixels || surface.normal.len() != pixels {
        return Err(Error::InvalidInput("the images must have the size of the camera's".into()));
    }
    let chunk = ROWS * view.width;
    job.expect(4 * view.height.div_ceil(ROWS));
    let placing = Placing { view, surface, motion };
    // One image after the other: each is written in order.
    fill(position, chunk, job, |pixel| placing.position(pixel).map_or([0.0; 3], |point| point.map(|part| part as f32)))?;
    fill(facing, chunk, job, |pixel| placing.facing(pixel))?;
    fill(vector, chunk, job, |pixel| placing.vector(pixel))?;
    fill(speed, chunk, job, |pixel| {
        let [x, y, z] = surface.velocity.get(pixel).copied().unwrap_or_default();
        (x * x + y * y + z * z).sqrt()
    })
}

/// Gives each pixel the number of its ball from a table, or `background` where there is no ball.
///
/// # Errors
/// `InvalidInput` where sizes differ or a ball has no number, `Cancelled`.
pub fn label(ball: &[i32], table: &[f32], background: f32, image: &mut [f32], job: &Job) -> Result<()> {
    if ball.len() != image.len() {
        return Err(Error::InvalidInput("the images must have the same size".into()));
    }
    job.expect(image.len().div_ceil(LABELS));
    image.par_chunks_mut(LABELS).zip(ball.par_chunks(LABELS)).try_for_each(|(image, ball)| {
        for (target, ball) in image.iter_mut().zip(ball) {
            *target = match usize::try_from(*ball) {
                Ok(index) => *table.get(index).ok_or_else(|| Error::InvalidInput("a ball has no number".into()))?,
                Err(_) => background,
            };
        }
        job.advance(1)
    })
}

fn fill<T: Send>(image: &mut [T], chunk: usize, job: &Job, value: impl Fn(usize) -> T + Sync) -> Result<()> {
    image.par_chunks_mut(chunk).enumerate().try_for_each(|(index, part)| {
        for (offset, target) in part.iter_mut().enumerate() {
            *target = value(index * chunk + offset);
        }
        job.advance(1)
    })
}

struct Placing<'a> {
    view: &'a View,
    surface: Surface<'a>,
    motion: Motion<'a>,
}

impl Placing<'_> {
    /// The planar depth and the place in the window of a pixel that sees something.
    #[inline(always)]
    fn seen(&self, pixel: usize) -> Option<(f64, [f64; 2])> {
        let depth = self.surface.depth[pixel];
        let place = || self.view.pixel_center(pixel % self.view.width, pixel / self.view.width);
        (depth < self.surface.background).then(|| (f64::from(depth), place()))
    }

    #[inline(always)]
    fn position(&self, pixel: usize) -> Option<[f64; 3]> {
        let (depth, [x, y]) = self.seen(pixel)?;
        let scale = if self.view.is_perspective { depth } else { 1.0 };
        let [right, up, forward] = self.view.camera_from_world;
        Some([0, 1, 2].map(|axis| self.view.eye[axis] + x * scale * right[axis] + y * scale * up[axis] + depth * forward[axis]))
    }

    #[inline(always)]
    fn facing(&self, pixel: usize) -> f32 {
        let Some((_, [x, y])) = self.seen(pixel) else { return 0.0 };
        let normal = self.surface.normal[pixel].map(f64::from);
        let [right, up, forward] = self.view.camera_from_world.map(|row| dot(row, normal));
        let (along, length) = if self.view.is_perspective {
            (x * right + y * up + forward, (x * x + y * y + 1.0).sqrt())
        } else {
            (forward, 1.0)
        };
        (along / length).abs() as f32
    }

    #[inline(always)]
    fn vector(&self, pixel: usize) -> [f32; 4] {
        let Some(here) = self.position(pixel) else { return [0.0; 4] };
        let velocity = self.surface.velocity.get(pixel).map_or([0.0; 3], |velocity| velocity.map(f64::from));
        let moved = |seconds: f64| [0, 1, 2].map(|axis| here[axis] + seconds * velocity[axis]);
        let now = pixels_of(self.view, here);
        let before = pixels_of(self.motion.previous, moved(-self.motion.seconds));
        let after = pixels_of(self.motion.following, moved(self.motion.seconds));
        let difference = |a: Option<[f64; 2]>, b: Option<[f64; 2]>| match (a, b) {
            (Some(a), Some(b)) => [(a[0] - b[0]) as f32, (a[1] - b[1]) as f32],
            // What passes the eye has no place in the other frame's image.
            _ => [0.0; 2],
        };
        let (past, future) = (difference(before, now), difference(now, after));
        [past[0], past[1], future[0], future[1]]
    }
}

/// Where a camera sees a point, in pixels from its lower left; none beside the eye or behind it.
#[inline(always)]
fn pixels_of(view: &View, point: [f64; 3]) -> Option<[f64; 2]> {
    let offset = [0, 1, 2].map(|axis| point[axis] - view.eye[axis]);
    let [x, y, depth] = view.camera_from_world.map(|row| dot(row, offset));
    let scale = if !view.is_perspective {
        1.0
    } else if depth > 0.0 {
        1.0 / depth
    } else {
        return None;
    };
    let [width, height] = view.pixel_size();
    Some([(x * scale - view.window[0]) / width, (y * scale - view.window[2]) / height])
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(is_perspective: bool, x: f64) -> View {
        View {
            camera_from_world: [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
            eye: [x, -5.0, 0.0],
            window: [-1.0, 1.0, -0.5, 0.5],
            is_perspective,
            width: 4,
            height: 2,
            clip: [0.1, 100.0],
        }
    }

    #[test]
    fn one_pixel_by_hand() {
        let (mut depth, normal, velocity) = (vec![1e10; 8], vec![[0.0, -1.0, 0.0]; 8], vec![[1.0, 0.0, 0.5]; 8]);
        depth[6] = 4.0;
        for is_perspective in [true, false] {
            let cameras = [view(is_perspective, 0.0), view(is_perspective, -0.1), view(is_perspective, 0.3)];
            let surface = Surface { depth: &depth, background: 1e10, normal: &normal, velocity: &velocity };
            let (mut position, mut facing, mut vector, mut speed) = ([[9.0; 3]; 8], [9.0; 8], [[9.0; 4]; 8], [9.0; 8]);
            let places = Places { position: &mut position, facing: &mut facing, vector: &mut vector, speed: &mut speed };
            let motion = Motion { previous: &cameras[1], following: &cameras[2], seconds: 0.5 };
            place(&cameras[0], surface, motion, places, &Job::default()).unwrap();
            // The pixel's centre is (0.25, 0.25) in the window, a pixel is 0.5 wide.
            let scale = if is_perspective { 4.0 } else { 1.0 };
            assert_eq!(position[6], [0.25 * scale, -1.0, 0.25 * scale]);
            let cosine: f32 = if is_perspective { 1.0 / (1.0f32 + 2.0 * 0.0625).sqrt() } else { 1.0 };
            assert!((facing[6] - cosine).abs() < 1e-6);
            let expected = [(-0.5 + 0.1), -0.25, -(0.5 - 0.3), -0.25].map(|moved| (moved / f64::from(scale) / 0.5) as f32);
            assert!(vector[6].iter().zip(expected).all(|(a, e)| (a - e).abs() < 1e-6), "{:?} {expected:?}", vector[6]);
            assert_eq!((position[0], facing[0], vector[0]), ([0.0; 3], 0.0, [0.0; 4]));
            assert_eq!(speed[6], 1.25f32.sqrt());
        }
    }

    #[test]
    fn what_passes_the_eye_has_no_motion_there() {
        let (depth, normal, velocity) = (vec![4.0; 8], vec![[0.0; 3]; 8], vec![[0.0, 20.0, 0.0]; 8]);
        let camera = view(true, 0.0);
        let surface = Surface { depth: &depth, background: 1e10, normal: &normal, velocity: &velocity };
        let mut vector = [[9.0; 4]; 8];
        let places = Places { position: &mut [], facing: &mut [], vector: &mut vector, speed: &mut [] };
        let motion = Motion { previous: &camera, following: &camera, seconds: 0.5 };
        place(&camera, surface, motion, places, &Job::default()).unwrap();
        assert_eq!(vector[0][..2], [0.0; 2]);
        assert!(vector[0][2] != 0.0);
    }

    #[test]
    fn labels_are_those_of_the_table() {
        let mut image = [9.0; 4];
        label(&[1, -1, 0, 1], &[5.0, 7.0], -3.0, &mut image, &Job::default()).unwrap();
        assert_eq!(image, [7.0, -3.0, 5.0, 7.0]);
        assert!(label(&[2], &[5.0, 7.0], 0.0, &mut [0.0], &Job::default()).is_err());
        assert!(label(&[0], &[5.0], 0.0, &mut [], &Job::default()).is_err());
    }

    #[test]
    fn sizes_must_fit() {
        let camera = view(true, 0.0);
        let surface = Surface { depth: &[1.0; 8], background: 1e10, normal: &[[0.0; 3]; 8], velocity: &[] };
        let motion = Motion { previous: &camera, following: &camera, seconds: 0.5 };
        let places = Places { position: &mut [], facing: &mut [0.0; 7], vector: &mut [], speed: &mut [] };
        assert!(place(&camera, surface, motion, places, &Job::default()).is_err());
    }
}
