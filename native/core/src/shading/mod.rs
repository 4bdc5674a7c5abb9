//! Materials in the light of a scene: a Principled BSDF whose rays end at the first surface, sixteen points at a time.
//!
//! Each light shines by its own formula, without shadows; the world sends the same light from everywhere. What lies behind a
//! surface that lets light pass is laid under it.

pub(crate) mod material;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

pub use self::material::{Light, LightKind, Material};
use self::material::{Shaded, Triple};
use crate::error::{Error, Result};
use crate::job::Job;
use crate::simd::{LANES, Lanes, Path, Simd, Task, Vector};
pub use crate::tile_caster::View;

/// How light what is seen through a surface is taken to be, where nothing is known of it.
const GREY_BEHIND: f32 = 0.25;

/// Points that a thread shades at a time.
const CHUNK: usize = 4096;

/// Materials and their light. Lights are in the space of what is shaded.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    materials: &'a [Material],
    lights: &'a [Light],
    world: [f32; 3],
}

impl<'a> Scene<'a> {
    /// Materials, lights, and the radiance that the world sends from everywhere.
    ///
    /// # Errors
    /// `InvalidInput` where there is no material.
    pub fn new(materials: &'a [Material], lights: &'a [Light], world: [f32; 3]) -> Result<Self> {
        if materials.is_empty() {
            return Err(Error::InvalidInput("there must be at least one material".into()));
        }
        Ok(Self { materials, lights, world })
    }
}

/// An image of a surface to be shaded, row 0 at the bottom.
#[derive(Debug)]
pub struct Image<'a> {
    /// Planar depth.
    pub depth: &'a [f32],
    /// Unit, world space.
    pub normal: &'a [[f32; 3]],
    /// Base colours.
    pub color: &'a [[f32; 3]],
    /// Index of the material; negative where there is nothing to shade.
    pub material: &'a [i32],
    /// Factor of the light; empty for 1.
    pub contrast: &'a [f32],
    /// Premultiplied: what is behind, then what is seen.
    pub rgba: &'a mut [[f32; 4]],
    /// The one colour of all that is behind, whatever `rgba` holds.
    pub behind: Option<[f32; 4]>,
}

/// Points to be shaded: positions, unit normals, and unit directions to the eye, which the normals face.
#[derive(Clone, Copy, Debug)]
pub struct Points<'a> {
    /// In the space of the lights.
    pub position: &'a [[f32; 3]],
    /// The same.
    pub normal: &'a [[f32; 3]],
    /// The same.
    pub to_eye: &'a [[f32; 3]],
    /// Base colours.
    pub color: &'a [[f32; 3]],
    /// Index of the material.
    pub material: &'a [i32],
}

/// Lays the light of a surface over what is behind it, in all pixels of a view that have a material.
///
/// # Errors
/// `InvalidInput` where sizes differ, or a material does not exist; `Cancelled`.
pub fn shade_image(path: Path, view: &View, scene: &Scene<'_>, image: Image<'_>, job: &Job) -> Result<()> {
    view.check()?;
    let pixels = view.width * view.height;
    let sizes = [image.depth.len(), image.normal.len(), image.color.len(), image.material.len(), image.rgba.len()];
    if sizes != [pixels; 5] || ![0, pixels].contains(&image.contrast.len()) {
        return Err(Error::InvalidInput("the images must have the size of the camera's".into()));
    }
    check_materials(scene, image.material)?;
    job.expect(view.height);
    let Image { depth, normal, color, material, contrast, rgba, behind } = image;
    rgba.par_chunks_mut(view.width).enumerate().try_for_each(|(row, rgba)| {
        let line = row * view.width..(row + 1) * view.width;
        path.dispatch(RowTask {
            view,
            scene,
            row,
            depth: &depth[line.clone()],
            normal: &normal[line.clone()],
            color: &color[line.clone()],
            material: &material[line.clone()],
            contrast: if contrast.is_empty() { contrast } else { &contrast[line] },
            rgba,
            behind,
        });
        job.advance(1)
    })
}

/// The radiance of points, without what is behind them.
///
/// # Errors
/// `InvalidInput` where numbers of points differ, or a material does not exist; `Cancelled`.
pub fn shade_points(path: Path, scene: &Scene<'_>, points: Points<'_>, radiance: &mut [[f32; 3]], job: &Job) -> Result<()> {
    let count = radiance.len();
    let sizes = [points.position.len(), points.normal.len(), points.to_eye.len(), points.color.len(), points.material.len()];
    if sizes != [count; 5] {
        return Err(Error::InvalidInput("there must be as many of each for the points".into()));
    }
    check_materials(scene, points.material)?;
    job.expect(count.div_ceil(CHUNK));
    radiance.par_chunks_mut(CHUNK).enumerate().try_for_each(|(chunk, radiance)| {
        path.dispatch(PointsTask { scene, points: &points, start: chunk * CHUNK, radiance });
        job.advance(1)
    })
}

fn check_materials(scene: &Scene<'_>, material: &[i32]) -> Result<()> {
    let count = i32::try_from(scene.materials.len()).unwrap_or(i32::MAX);
    if material.par_iter().any(|index| *index >= count) {
        return Err(Error::InvalidInput("a material does not exist".into()));
    }
    Ok(())
}

/// Shades a row of an image.
struct RowTask<'a> {
    view: &'a View,
    scene: &'a Scene<'a>,
    row: usize,
    depth: &'a [f32],
    normal: &'a [[f32; 3]],
    color: &'a [[f32; 3]],
    material: &'a [i32],
    contrast: &'a [f32],
    rgba: &'a mut [[f32; 4]],
    behind: Option<[f32; 4]>,
}

impl Task for RowTask<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        for start in (0..self.depth.len()).step_by(LANES) {
            let count = LANES.min(self.depth.len() - start);
            let material = &self.material[start..start + count];
            if let Some(behind) = self.behind
                && material.iter().any(|index| *index < 0)
            {
                self.rgba[start..start + count].fill(behind);
            }
            if material.iter().any(|index| *index >= 0) {
                self.shade(simd, start, count);
            }
        }
    }
}

impl RowTask<'_> {
    #[inline(always)]
    fn shade<S: Simd>(&mut self, simd: S, start: usize, count: usize) {
        let part = start..start + count;
        let material = self.material_lanes(start, count);
        let [position, to_eye] = self.geometry(simd, start, count);
        let normal = self.normals(simd, start, count, to_eye);
        let base = material::triples(simd, &self.color[part.clone()]);
        let shaded = material::shade(simd, self.scene, &material, position, normal, to_eye, base);
        let contrast = if self.contrast.is_empty() { simd.splat(1.0) } else { material::numbers(simd, &self.contrast[part]) };
        self.lay_over(simd, start, count, &shaded, contrast);
    }

    /// The materials of sixteen pixels; any for those without.
    #[inline(always)]
    fn material_lanes(&self, start: usize, count: usize) -> [usize; LANES] {
        let mut lanes = [0; LANES];
        for (lane, index) in lanes.iter_mut().zip(&self.material[start..start + count]) {
            *lane = usize::try_from(*index).unwrap_or(0);
        }
        lanes
    }

    /// Positions, and directions to the eye: view space, z to the eye.
    #[inline(always)]
    fn geometry<S: Simd>(&self, simd: S, start: usize, count: usize) -> [Triple<S>; 2] {
        let (mut columns, size) = (Lanes::splat(0.0), self.view.pixel_size());
        for (lane, x) in columns.0.iter_mut().enumerate() {
            *x = (self.view.window[0] + (start as f64 + f64::from(lane as i32) + 0.5) * size[0]) as f32;
        }
        let (x, y) = (simd.load(&columns), simd.splat(self.view.pixel_center(0, self.row)[1] as f32));
        let depth = material::numbers(simd, &self.depth[start..start + count]);
        let (zero, one) = (simd.splat(0.0), simd.splat(1.0));
        if self.view.is_perspective {
            let scale = one / (x * x + y * y + one).sqrt();
            [Triple([x * depth, y * depth, zero - depth]), Triple([zero - x * scale, zero - y * scale, scale])]
        } else {
            [Triple([x, y, zero - depth]), Triple([zero, zero, one])]
        }
    }

    /// Normals that face the eye: view space.
    #[inline(always)]
    fn normals<S: Simd>(&self, simd: S, start: usize, count: usize, to_eye: Triple<S>) -> Triple<S> {
        let world = material::triples(simd, &self.normal[start..start + count]);
        let [right, up, forward] = self.view.camera_from_world.map(|row| row.map(|number| number as f32));
        let [right, up, forward] = [
            Triple::splat(simd, right).dot(world),
            Triple::splat(simd, up).dot(world),
            Triple::splat(simd, forward).dot(world),
        ];
        let zero = simd.splat(0.0);
        let mut normal = Triple([right, up, zero - forward]);
        let away = normal.dot(to_eye).lt(zero);
        for axis in &mut normal.0 {
            *axis = (zero - *axis).select(away, *axis);
        }
        normal
    }

    /// An image has one alpha for all channels, so that what is unknown is dimmed as a whole and its tint is a grey's.
    #[inline(always)]
    fn lay_over<S: Simd>(&mut self, simd: S, start: usize, count: usize, shaded: &Shaded<S>, contrast: S::Vector) {
        let (zero, one) = (simd.splat(0.0), simd.splat(1.0));
        let [r, g, b] = shaded.transmittance.0;
        let dimmed = (r + g + b) * simd.splat(1.0 / 3.0);
        let behind = self.behind(simd, start, count);
        let open = one - behind[3];
        let mut channels = [Lanes::splat(0.0); 4];
        for (axis, lanes) in channels.iter_mut().take(3).enumerate() {
            let passes = shaded.transmittance.0[axis];
            let tint = (passes - dimmed) * simd.splat(GREY_BEHIND) * open;
            let through = passes.mul_add(behind[axis], tint);
            shaded.radiance.0[axis].mul_add(contrast, through).max(zero).store(lanes);
        }
        (one - dimmed * open).store(&mut channels[3]);
        let mut pixels = [[0.0; 4]; LANES];
        for (lane, pixel) in pixels.iter_mut().enumerate() {
            *pixel = [0, 1, 2, 3].map(|axis| channels[axis].0[lane]);
        }
        let (material, rgba) = (&self.material[start..start + count], &mut self.rgba[start..start + count]);
        if material.iter().all(|index| *index >= 0) {
            return rgba.copy_from_slice(&pixels[..count]);
        }
        for ((target, index), pixel) in rgba.iter_mut().zip(material).zip(pixels) {
            if *index >= 0 {
                *target = pixel;
            }
        }
    }

    /// The channels of what is behind.
    #[inline(always)]
    fn behind<S: Simd>(&self, simd: S, start: usize, count: usize) -> [S::Vector; 4] {
        let (mut pixels, mut channels) = ([[0.0; 4]; LANES], [Lanes::splat(0.0); 4]);
        if let Some([r, g, b, a]) = self.behind {
            return [simd.splat(r), simd.splat(g), simd.splat(b), simd.splat(a)];
        }
        pixels[..count].copy_from_slice(&self.rgba[start..start + count]);
        for (lane, pixel) in pixels.iter().enumerate() {
            for (channel, number) in channels.iter_mut().zip(pixel) {
                channel.0[lane] = *number;
            }
        }
        let [r, g, b, a] = &channels;
        [simd.load(r), simd.load(g), simd.load(b), simd.load(a)]
    }
}

/// Shades a chunk of points.
struct PointsTask<'a> {
    scene: &'a Scene<'a>,
    points: &'a Points<'a>,
    start: usize,
    radiance: &'a mut [[f32; 3]],
}

impl Task for PointsTask<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for (block, radiance) in self.radiance.chunks_mut(LANES).enumerate() {
            let start = self.start + block * LANES;
            let part = start..start + radiance.len();
            let mut material = [0; LANES];
            for (lane, index) in material.iter_mut().zip(&self.points.material[part.clone()]) {
                *lane = usize::try_from(*index).unwrap_or(0);
            }
            let position = material::triples(simd, &self.points.position[part.clone()]);
            let normal = material::triples(simd, &self.points.normal[part.clone()]);
            let to_eye = material::triples(simd, &self.points.to_eye[part.clone()]);
            let base = material::triples(simd, &self.points.color[part]);
            let shaded = material::shade(simd, self.scene, &material, position, normal, to_eye, base);
            let [r, g, b] = shaded.radiance.0;
            let channels = [r.lanes(), g.lanes(), b.lanes()];
            for (lane, point) in radiance.iter_mut().enumerate() {
                *point = [0, 1, 2].map(|axis| channels[axis].0[lane]);
            }
        }
    }
}
