//! What follows from where the surface of an image lies: positions, how it faces the eye, and how it moves in the image.

use std::ops::Range;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::job::Job;
use crate::memory::with_capacity;
use crate::simd::{Path, Simd, Task};
pub use crate::tile_caster::View;

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
    /// World space: the ways to where things are one frame before and one after, beside those of the velocity; empty for 0.
    pub ways: [&'a [[f32; 3]]; 2],
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

impl<'a> Places<'a> {
    /// The same, row by row.
    fn rows(self, view: &View) -> Result<Vec<Places<'a>>> {
        let width = view.width;
        let mut rows = with_capacity(view.height)?;
        let mut position = self.position.chunks_mut(width);
        let mut facing = self.facing.chunks_mut(width);
        let mut vector = self.vector.chunks_mut(width);
        let mut speed = self.speed.chunks_mut(width);
        rows.extend((0..view.height).map(|_| Places {
            position: position.next().unwrap_or_default(),
            facing: facing.next().unwrap_or_default(),
            vector: vector.next().unwrap_or_default(),
            speed: speed.next().unwrap_or_default(),
        }));
        Ok(rows)
    }
}

/// Fills the images of a surface that a view sees.
///
/// # Errors
/// `InvalidInput` where sizes differ or a camera is unusable, `Cancelled`.
pub fn place(path: Path, view: &View, surface: Surface<'_>, motion: Motion<'_>, places: Places<'_>, job: &Job) -> Result<()> {
    for camera in [view, motion.previous, motion.following] {
        camera.check()?;
    }
    let pixels = view.width * view.height;
    let fits = |count: usize| [0, pixels].contains(&count);
    let Places { position, facing, vector, speed } = &places;
    let ways = surface.ways.map(<[_]>::len);
    let targets = [position.len(), facing.len(), vector.len(), speed.len()];
    let sizes_fit = targets.into_iter().chain(ways).chain([surface.velocity.len()]).all(fits);
    if !sizes_fit || surface.depth.len() != pixels || surface.normal.len() != pixels {
        return Err(Error::InvalidInput("the images must have the size of the camera's".into()));
    }
    let rows = places.rows(view)?;
    job.expect(view.height);
    rows.into_par_iter().enumerate().try_for_each(|(row, places)| {
        path.dispatch(RowTask { view, surface, motion: &motion, row, places });
        job.advance(1)
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

/// Pixels that are placed at a time: few enough for their numbers to stay in the nearest cache.
const BLOCK: usize = 64;

/// A number of each pixel of a block. Loops over these become vectors on every path.
type Numbers = [f64; BLOCK];

/// Places a row of an image.
struct RowTask<'a> {
    view: &'a View,
    surface: Surface<'a>,
    motion: &'a Motion<'a>,
    row: usize,
    places: Places<'a>,
}

impl Task for RowTask<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self, _: S) {
        for start in (0..self.view.width).step_by(BLOCK) {
            let part = start..(start + BLOCK).min(self.view.width);
            let block = Block::new(self.view, &self.surface, self.row, part.clone());
            let Places { position, facing, vector, speed } = &mut self.places;
            if !position.is_empty() {
                block.put_positions(&mut position[part.clone()]);
            }
            if !facing.is_empty() {
                block.put_facing(&mut facing[part.clone()]);
            }
            if !vector.is_empty() {
                block.put_vectors(self.motion, &mut vector[part.clone()]);
            }
            if !speed.is_empty() {
                block.put_speeds(&mut speed[part]);
            }
        }
    }
}

/// What is known of the pixels of a part of a row; the last ones may be beyond its end.
struct Block<'a> {
    view: &'a View,
    is_empty: bool,
    /// 1 where there is something, else 0.
    seen: [f32; BLOCK],
    depth: Numbers,
    /// Where in the window the pixels' centres lie.
    x: Numbers,
    y: f64,
    point: [Numbers; 3],
    normal: &'a [[f32; 3]],
    velocity: &'a [[f32; 3]],
    ways: [&'a [[f32; 3]]; 2],
}

impl<'a> Block<'a> {
    #[inline(always)]
    fn new(view: &'a View, surface: &Surface<'a>, row: usize, part: Range<usize>) -> Self {
        let pixels = row * view.width + part.start..row * view.width + part.end;
        let (mut seen, mut depth, mut x) = ([0.0; BLOCK], [1.0; BLOCK], [0.0; BLOCK]);
        for ((seen, depth), found) in seen.iter_mut().zip(&mut depth).zip(&surface.depth[pixels.clone()]) {
            let is_seen = *found < surface.background;
            *seen = if is_seen { 1.0 } else { 0.0 };
            *depth = if is_seen { f64::from(*found) } else { 1.0 };
        }
        let size = view.pixel_size();
        let first = part.start as f64;
        for (offset, x) in x.iter_mut().enumerate() {
            *x = view.window[0] + (first + f64::from(offset as i32) + 0.5) * size[0];
        }
        let y = view.window[2] + (row as f64 + 0.5) * size[1];
        let is_empty = seen.iter().all(|seen| *seen == 0.0);
        let part_of = |image: &'a [[f32; 3]]| if image.is_empty() { image } else { &image[pixels.clone()] };
        let (velocity, ways) = (part_of(surface.velocity), surface.ways.map(part_of));
        let (normal, point) = (&surface.normal[pixels.clone()], [[0.0; BLOCK]; 3]);
        let mut block = Self { view, is_empty, seen, depth, x, y, point, normal, velocity, ways };
        if !is_empty {
            block.find_points();
        }
        block
    }

    #[inline(always)]
    fn find_points(&mut self) {
        let [right, up, forward] = self.view.camera_from_world;
        for (axis, numbers) in self.point.iter_mut().enumerate() {
            let eye = self.view.eye[axis];
            for ((point, x), depth) in numbers.iter_mut().zip(&self.x).zip(&self.depth) {
                let scale = if self.view.is_perspective { *depth } else { 1.0 };
                *point = eye + x * scale * right[axis] + self.y * scale * up[axis] + depth * forward[axis];
            }
        }
    }

    #[inline(always)]
    fn put_positions(&self, target: &mut [[f32; 3]]) {
        if self.is_empty {
            return target.fill([0.0; 3]);
        }
        let mut positions = [[0.0; 3]; BLOCK];
        let [x, y, z] = &self.point;
        for (pixel, position) in positions.iter_mut().enumerate() {
            let is_seen = self.seen[pixel] > 0.0;
            *position = [x[pixel], y[pixel], z[pixel]].map(|number| if is_seen { number as f32 } else { 0.0 });
        }
        target.copy_from_slice(&positions[..target.len()]);
    }

    #[inline(always)]
    fn put_facing(&self, target: &mut [f32]) {
        if self.is_empty {
            return target.fill(0.0);
        }
        let [nx, ny, nz] = columns(self.normal);
        let rows = self.view.camera_from_world;
        let mut facing = [0.0; BLOCK];
        for (pixel, facing) in facing.iter_mut().enumerate() {
            let normal = [nx[pixel], ny[pixel], nz[pixel]];
            let [right, up, forward] = [dot(rows[0], normal), dot(rows[1], normal), dot(rows[2], normal)];
            let (x, y) = (self.x[pixel], self.y);
            let (along, length) = if self.view.is_perspective {
                (x * right + y * up + forward, (x * x + y * y + 1.0).sqrt())
            } else {
                (forward, 1.0)
            };
            *facing = if self.seen[pixel] > 0.0 { (along / length).abs() as f32 } else { 0.0 };
        }
        target.copy_from_slice(&facing[..target.len()]);
    }

    #[inline(always)]
    fn put_vectors(&self, motion: &Motion<'_>, target: &mut [[f32; 4]]) {
        let nothing_moves = self.velocity.is_empty() && self.ways.iter().all(|way| way.is_empty());
        let stands_still = nothing_moves && *self.view == *motion.previous && *self.view == *motion.following;
        if self.is_empty || stands_still {
            return target.fill([0.0; 4]);
        }
        let velocity = columns(self.velocity);
        let now = Place::of(self.view, &self.point);
        let past = self.at(&velocity, -motion.seconds, self.ways[0]);
        let future = self.at(&velocity, motion.seconds, self.ways[1]);
        let (before, after) = (Place::of(motion.previous, &past), Place::of(motion.following, &future));
        let mut vectors = [[0.0; 4]; BLOCK];
        let (past, future) = (difference(&self.seen, &before, &now), difference(&self.seen, &now, &after));
        for (pixel, vector) in vectors.iter_mut().enumerate() {
            *vector = [past[0][pixel], past[1][pixel], future[0][pixel], future[1][pixel]];
        }
        target.copy_from_slice(&vectors[..target.len()]);
    }

    /// Where the points are after so many seconds and a way beside; no way for 0.
    #[inline(always)]
    fn at(&self, velocity: &[Numbers; 3], seconds: f64, way: &[[f32; 3]]) -> [Numbers; 3] {
        let points = moved(&self.point, velocity, seconds);
        if way.is_empty() { points } else { moved(&points, &columns(way), 1.0) }
    }

    #[inline(always)]
    fn put_speeds(&self, target: &mut [f32]) {
        target.fill(0.0);
        for (speed, [x, y, z]) in target.iter_mut().zip(self.velocity) {
            *speed = (x * x + y * y + z * z).sqrt();
        }
    }
}

/// Where a camera sees the points of a block.
struct Place {
    /// From the image's lower left.
    pixel: [Numbers; 2],
    /// Planar, 1 for a camera of parallel rays; the place means nothing where this is not above 0.
    depth: Numbers,
}

impl Place {
    #[inline(always)]
    fn of(view: &View, points: &[Numbers; 3]) -> Self {
        let mut place = Self { pixel: [[0.0; BLOCK]; 2], depth: [1.0; BLOCK] };
        let [width, height] = view.pixel_size();
        let [right, up, forward] = view.camera_from_world;
        for (pixel, place_depth) in place.depth.iter_mut().enumerate() {
            let offset = [0, 1, 2].map(|axis| points[axis][pixel] - view.eye[axis]);
            let depth = if view.is_perspective { dot(forward, offset) } else { 1.0 };
            let scale = if view.is_perspective { 1.0 / depth } else { 1.0 };
            place.pixel[0][pixel] = (dot(right, offset) * scale - view.window[0]) / width;
            place.pixel[1][pixel] = (dot(up, offset) * scale - view.window[2]) / height;
            *place_depth = depth;
        }
        place
    }
}

/// From one place to the other in the image, 0 where nothing is seen or there is no place: what passes the eye has none.
#[inline(always)]
fn difference(seen: &[f32; BLOCK], a: &Place, b: &Place) -> [[f32; BLOCK]; 2] {
    let mut differences = [[0.0; BLOCK]; 2];
    for (axis, numbers) in differences.iter_mut().enumerate() {
        for (pixel, number) in numbers.iter_mut().enumerate() {
            let moved = (a.pixel[axis][pixel] - b.pixel[axis][pixel]) as f32;
            let is_there = (seen[pixel] > 0.0) & (a.depth[pixel] > 0.0) & (b.depth[pixel] > 0.0);
            *number = if is_there { moved } else { 0.0 };
        }
    }
    differences
}

/// Points after so many seconds.
#[inline(always)]
fn moved(points: &[Numbers; 3], velocity: &[Numbers; 3], seconds: f64) -> [Numbers; 3] {
    let mut moved = [[0.0; BLOCK]; 3];
    for (axis, numbers) in moved.iter_mut().enumerate() {
        for (pixel, number) in numbers.iter_mut().enumerate() {
            *number = points[axis][pixel] + seconds * velocity[axis][pixel];
        }
    }
    moved
}

/// The coordinates of up to a block of vectors, 0 for those that lack.
#[inline(always)]
fn columns(vectors: &[[f32; 3]]) -> [Numbers; 3] {
    let mut padded = [[0.0; 3]; BLOCK];
    padded[..vectors.len()].copy_from_slice(vectors);
    let mut columns = [[0.0; BLOCK]; 3];
    for (pixel, vector) in padded.iter().enumerate() {
        for axis in 0..3 {
            columns[axis][pixel] = f64::from(vector[axis]);
        }
    }
    columns
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
            let surface = Surface { depth: &depth, background: 1e10, normal: &normal, velocity: &velocity, ways: [&[], &[]] };
            let (mut position, mut facing, mut vector, mut speed) = ([[9.0; 3]; 8], [9.0; 8], [[9.0; 4]; 8], [9.0; 8]);
            let places = Places { position: &mut position, facing: &mut facing, vector: &mut vector, speed: &mut speed };
            let motion = Motion { previous: &cameras[1], following: &cameras[2], seconds: 0.5 };
            place(Path::Portable, &cameras[0], surface, motion, places, &Job::default()).unwrap();
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
    fn ways_are_added_to_what_the_velocity_says() {
        let (depth, normal, velocity) = (vec![4.0; 8], vec![[0.0; 3]; 8], vec![[1.0, 0.0, 0.0]; 8]);
        let (back, on) = (vec![[0.25, 0.0, -1.0]; 8], vec![[0.0, 0.0, 2.0]; 8]);
        let camera = view(false, 0.0);
        let motion = Motion { previous: &camera, following: &camera, seconds: 0.5 };
        let mut vector = [[9.0; 4]; 8];
        // A pixel is 0.5 wide.
        for (ways, expected) in [
            ([&back[..], &on[..]], [-0.5, -2.0, -1.0, -4.0]),
            ([&[], &on], [-1.0, 0.0, -1.0, -4.0]),
            ([&back, &[]], [-0.5, -2.0, -1.0, 0.0]),
        ] {
            let surface = Surface { depth: &depth, background: 1e10, normal: &normal, velocity: &velocity, ways };
            let places = Places { position: &mut [], facing: &mut [], vector: &mut vector, speed: &mut [] };
            place(Path::Portable, &camera, surface, motion, places, &Job::default()).unwrap();
            assert_eq!(vector, [expected; 8]);
        }
        let surface = Surface { depth: &depth, background: 1e10, normal: &normal, velocity: &[], ways: [&back, &[]] };
        let places = Places { position: &mut [], facing: &mut [], vector: &mut vector, speed: &mut [] };
        place(Path::Portable, &camera, surface, motion, places, &Job::default()).unwrap();
        assert_eq!(vector, [[0.5, -2.0, 0.0, 0.0]; 8]);
    }

    #[test]
    fn what_passes_the_eye_has_no_motion_there() {
        let (depth, normal, velocity) = (vec![4.0; 8], vec![[0.0; 3]; 8], vec![[0.0, 20.0, 0.0]; 8]);
        let camera = view(true, 0.0);
        let surface = Surface { depth: &depth, background: 1e10, normal: &normal, velocity: &velocity, ways: [&[], &[]] };
        let mut vector = [[9.0; 4]; 8];
        let places = Places { position: &mut [], facing: &mut [], vector: &mut vector, speed: &mut [] };
        let motion = Motion { previous: &camera, following: &camera, seconds: 0.5 };
        place(Path::Portable, &camera, surface, motion, places, &Job::default()).unwrap();
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
        let surface = Surface { depth: &[1.0; 8], background: 1e10, normal: &[[0.0; 3]; 8], velocity: &[], ways: [&[], &[]] };
        let motion = Motion { previous: &camera, following: &camera, seconds: 0.5 };
        let places = Places { position: &mut [], facing: &mut [0.0; 7], vector: &mut [], speed: &mut [] };
        assert!(place(Path::Portable, &camera, surface, motion, places, &Job::default()).is_err());
    }
}
