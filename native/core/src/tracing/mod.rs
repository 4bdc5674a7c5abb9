//! Light beyond the first surface: shadows, reflections, refraction, ambient occlusion. `docs/light.md` has the formulas.
//!
//! Where a method has found the surface of an image, light is followed back from the eye in generations: rays meet surfaces,
//! which are shaded sixteen at a time and send further rays. The surfaces are those of the shading module.

mod background;
mod lights;
mod paths;
pub(crate) mod random;
#[cfg(test)]
mod tests;
mod triangles;
mod world;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::fitted_bvh::FittedBvh;
use crate::job::Job;
use crate::shading::{Light, Material};
use crate::simd::{Path, Simd, Task};
pub use crate::tile_caster::View;

pub use self::background::show_world;
use self::paths::Tracer;
pub use self::triangles::{NO_TRIANGLE, Triangles};
pub use self::world::{World, WorldImage};

/// Rows that a thread traces at a time, and columns of them that are traced together.
const ROWS: usize = 8;
const COLUMNS: usize = 32;

/// A fluid in which rays find their way.
#[derive(Clone, Copy, Debug)]
pub struct Fluid<'a> {
    /// Its surface.
    pub bvh: &'a FittedBvh,
    /// The influence radii of its balls.
    pub radii: &'a [f32],
    /// Their base colours; empty where the materials have them.
    pub colors: &'a [[f32; 3]],
    /// The materials of its balls; empty where all have the first.
    pub materials: &'a [i32],
}

/// Meshes in which rays find their way.
#[derive(Clone, Copy, Debug)]
pub struct Meshes<'a> {
    /// Their triangles.
    pub triangles: &'a Triangles,
    /// Of their corners, unit.
    pub normals: &'a [[f32; 9]],
    /// Of each triangle.
    pub materials: &'a [i32],
}

/// All that light meets.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// The fluid.
    pub fluid: Fluid<'a>,
    /// Everything else.
    pub meshes: Meshes<'a>,
    /// Those of the fluid first, in whatever order is referred to.
    pub materials: &'a [Material],
    /// In world space.
    pub lights: &'a [Light],
    /// What is farther away than everything.
    pub world: World<'a>,
}

impl Scene<'_> {
    /// Checks numbers and indices.
    ///
    /// # Errors
    /// `InvalidInput` where one is unusable.
    fn check(&self) -> Result<()> {
        let Fluid { radii, colors, materials, .. } = self.fluid;
        let fits = |count: usize| [0, radii.len()].contains(&count);
        if !(fits(colors.len()) && fits(materials.len())) {
            return Err(Error::InvalidInput("colours and materials of a fluid must be as many as its balls".into()));
        }
        let triangles = self.meshes.triangles.len();
        if self.meshes.normals.len() != triangles || self.meshes.materials.len() != triangles {
            return Err(Error::InvalidInput("normals and materials of meshes must be as many as their triangles".into()));
        }
        if self.materials.is_empty() {
            return Err(Error::InvalidInput("there must be at least one material".into()));
        }
        let is_there = |index: &i32| usize::try_from(*index).is_ok_and(|index| index < self.materials.len());
        if !(materials.par_iter().all(is_there) && self.meshes.materials.par_iter().all(is_there)) {
            return Err(Error::InvalidInput("a material does not exist".into()));
        }
        if let Some(wrong) = self.materials.iter().find(|material| !(material.ior > 0.0 && material.ior.is_finite())) {
            return Err(Error::InvalidInput(format!(
                "The index of refraction of a material must be greater than 0, not {}: 1 does not refract",
                wrong.ior
            )));
        }
        Ok(())
    }
}

/// How far light is followed.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// How many mirrors it may meet.
    pub reflections: u32,
    /// How many surfaces it may pass.
    pub refractions: u32,
    /// Whether what stands before a light hides it.
    pub shadows: bool,
    /// How many rays ask how much of the world is seen; 0 for all of it.
    pub occlusion_rays: u32,
    /// How far they go.
    pub occlusion_distance: f64,
    /// How many samples the image is the mean of.
    pub samples: u32,
    /// How many such images there were before this one.
    pub image: u32,
    /// Whether what is seen of the world straight through surfaces is left out, and makes the image transparent.
    pub is_film_clear: bool,
}

impl Settings {
    /// Checks the numbers.
    ///
    /// # Errors
    /// `InvalidInput` where one is unusable.
    fn check(&self) -> Result<()> {
        let limits = [
            ("reflections", self.reflections, 0..=64),
            ("refractions", self.refractions, 0..=64),
            ("occlusion rays", self.occlusion_rays, 0..=4096),
            ("samples", self.samples, 1..=65536),
        ];
        for (name, number, range) in limits {
            if !range.contains(&number) {
                return Err(Error::InvalidInput(format!(
                    "the number of {name} must be from {} to {}, not {number}",
                    range.start(),
                    range.end()
                )));
            }
        }
        if self.occlusion_distance > 0.0 {
            return Ok(());
        }
        Err(Error::InvalidInput(format!("the distance of occlusion must be greater than 0, not {}", self.occlusion_distance)))
    }
}

/// An image of surfaces that were found, row 0 at the bottom.
#[derive(Debug)]
pub struct Image<'a> {
    /// Planar depth.
    pub depth: &'a [f32],
    /// Unit, world space.
    pub normal: &'a [[f32; 3]],
    /// Base colours.
    pub color: &'a [[f32; 3]],
    /// Indices of the materials; negative where nothing is traced.
    pub material: &'a [i32],
    /// The balls that count most; negative where a mesh is seen.
    pub ball: &'a [i32],
    /// Factors of the light; empty for 1.
    pub contrast: &'a [f32],
    /// What is seen, premultiplied; stays as it is where nothing is traced.
    pub rgba: &'a mut [[f32; 4]],
}

/// Traces the light of an image.
///
/// # Errors
/// `InvalidInput` where sizes differ, something does not exist, or a number is unusable; `Cancelled`.
pub fn trace_image(path: Path, view: &View, scene: &Scene<'_>, settings: &Settings, image: Image<'_>, job: &Job) -> Result<()> {
    view.check()?;
    scene.check()?;
    settings.check()?;
    let Image { depth, normal, color, material, ball, contrast, rgba } = image;
    let pixels = view.width * view.height;
    let sizes = [depth.len(), normal.len(), color.len(), material.len(), ball.len(), rgba.len()];
    if sizes != [pixels; 6] || ![0, pixels].contains(&contrast.len()) {
        return Err(Error::InvalidInput("the images must have the size of the camera's".into()));
    }
    let is_usable = |indices: &[i32], count: usize| indices.par_iter().all(|index| *index < 0 || (*index as usize) < count);
    if !is_usable(material, scene.materials.len()) || !is_usable(ball, scene.fluid.radii.len()) {
        return Err(Error::InvalidInput("a material or a ball does not exist".into()));
    }
    let surfaces = Surfaces { view, depth, normal, color, material, ball };
    job.expect(view.height);
    rgba.par_chunks_mut(view.width * ROWS).enumerate().try_for_each(|(band, rgba)| {
        let rows = rgba.len() / view.width;
        let contrast = if contrast.is_empty() { contrast } else { &contrast[band * ROWS * view.width..][..rgba.len()] };
        path.dispatch(BandTask { surfaces: &surfaces, scene, settings, first_row: band * ROWS, contrast, rgba, job })?;
        job.advance(rows)
    })
}

/// What is seen in the pixels of an image.
struct Surfaces<'a> {
    view: &'a View,
    depth: &'a [f32],
    normal: &'a [[f32; 3]],
    color: &'a [[f32; 3]],
    material: &'a [i32],
    ball: &'a [i32],
}

/// Traces a few rows of an image.
struct BandTask<'a> {
    surfaces: &'a Surfaces<'a>,
    scene: &'a Scene<'a>,
    settings: &'a Settings,
    first_row: usize,
    contrast: &'a [f32],
    rgba: &'a mut [[f32; 4]],
    job: &'a Job,
}

impl Task for BandTask<'_> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Result<()> {
        let width = self.surfaces.view.width;
        let mut tracer = Tracer::new(simd, self.scene, self.settings);
        for first_column in (0..width).step_by(COLUMNS) {
            tracer.pixels.clear();
            for row in 0..self.rgba.len() / width {
                let columns = first_column..(first_column + COLUMNS).min(width);
                tracer.pixels.extend(columns.map(|column| ((self.first_row + row) * width + column) as u32));
            }
            tracer.pixels.retain(|pixel| self.surfaces.material[*pixel as usize] >= 0);
            if tracer.pixels.is_empty() {
                continue;
            }
            tracer.trace(self.surfaces, self.job)?;
            for (index, pixel) in tracer.pixels.iter().enumerate() {
                let local = *pixel as usize - self.first_row * width;
                let contrast = if self.contrast.is_empty() { 1.0 } else { self.contrast[local] };
                let ([r, g, b], alpha) = tracer.seen(index);
                self.rgba[local] = [contrast * r, contrast * g, contrast * b, alpha];
            }
        }
        Ok(())
    }
}
