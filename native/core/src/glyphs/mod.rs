//! The glyph caster: what a camera sees of spheres and ellipsoids, each with a hard surface of its own.
//!
//! Mueller, Grottel and Ertl 2007 show such glyphs beside metaballs, from Klein and Ertl 2004 and Gumhold 2003, who cast a ray at
//! each pixel of a glyph's rectangle. So it is done here, in double precision: glyphs are binned to bands of rows; each band is
//! drawn by one thread, from front to back. The image does not depend on the number of threads.

mod band;
pub(crate) mod shape;

use rayon::prelude::*;

use self::band::{Band, Rows};
use self::shape::Shape;
use crate::bands::{BAND, Bins, CHUNK, Centers, Place, Placed};
use crate::error::{Error, Result};
use crate::job::Job;
use crate::simd::Path;
pub use crate::tile_caster::View;

/// What stands for no glyph.
pub const NO_GLYPH: i32 = -1;

/// How far glyphs reach.
#[derive(Clone, Copy, Debug)]
pub enum Extents<'a> {
    /// Spheres by their radii.
    Spheres(&'a [f32]),
    /// Ellipsoids by their three semi-axes, one vector after the other, world space, at right angles.
    Ellipsoids(&'a [[f32; 9]]),
}

/// Spheres or ellipsoids in world space.
#[derive(Clone, Copy, Debug)]
pub struct Glyphs<'a> {
    centers: &'a [[f32; 3]],
    extents: Extents<'a>,
}

impl<'a> Glyphs<'a> {
    /// Checks and borrows the arrays.
    ///
    /// # Errors
    /// `InvalidInput` where lengths differ, a number is not finite, or an extent is not greater than zero.
    pub fn new(centers: &'a [[f32; 3]], extents: Extents<'a>) -> Result<Self> {
        let (count, are_fit) = match extents {
            Extents::Spheres(radii) => (radii.len(), radii.par_iter().all(|radius| radius.is_finite() && *radius > 0.0)),
            Extents::Ellipsoids(axes) => (axes.len(), axes.par_iter().all(are_axes)),
        };
        if count != centers.len() || i32::try_from(count).is_err() {
            return Err(Error::InvalidInput("there must be as many extents as glyphs, and less than 2^31".into()));
        }
        if !are_fit || !centers.par_iter().flatten().all(|number| number.is_finite()) {
            return Err(Error::InvalidInput("centers and extents of glyphs must be finite, extents greater than zero".into()));
        }
        Ok(Self { centers, extents })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.centers.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.centers.is_empty()
    }

    /// A glyph in camera space.
    #[inline(always)]
    fn in_view(&self, glyph: usize, view: &View) -> Shape {
        let center = self.centers[glyph];
        let offset = [0, 1, 2].map(|axis| f64::from(center[axis]) - view.eye[axis]);
        let turned = |vector: [f64; 3]| view.camera_from_world.map(|row| dot(row, vector));
        let axes = match self.extents {
            // A sphere has the same extents in all spaces.
            Extents::Spheres(radii) => {
                let radius = f64::from(radii[glyph]);
                [[radius, 0.0, 0.0], [0.0, radius, 0.0], [0.0, 0.0, radius]]
            }
            Extents::Ellipsoids(axes) => {
                let numbers = axes[glyph].map(f64::from);
                [0, 3, 6].map(|first| turned([numbers[first], numbers[first + 1], numbers[first + 2]]))
            }
        };
        Shape { center: turned(offset), axes }
    }
}

impl Placed for Glyphs<'_> {
    fn count(&self) -> usize {
        self.len()
    }

    #[inline(always)]
    fn place(&self, index: usize, view: &View) -> Option<Place> {
        self.in_view(index, view).place(view)
    }
}

/// Whether these are three vectors with lengths.
fn are_axes(numbers: &[f32; 9]) -> bool {
    let lengths = numbers.as_chunks::<3>().0.iter().map(|axis| axis.iter().map(|part| f64::from(*part).powi(2)).sum::<f64>());
    lengths.into_iter().all(|length| length.is_finite() && length > 0.0)
}

/// An image to be written, row 0 at the bottom.
pub struct Image<'a> {
    /// Planar depth; `background` where there is nothing.
    pub depth: &'a mut [f32],
    /// Index of the glyph, `NO_GLYPH` where there is nothing.
    pub glyph: &'a mut [i32],
    /// Unit, world space, out of the glyph; 0 where there is nothing.
    pub normal: &'a mut [[f32; 3]],
    /// What stands for no depth.
    pub background: f32,
}

/// Writes what a camera sees of glyphs: on each ray the nearest point of a surface between the clip depths. A ray that starts in
/// a glyph sees it from within. Where two are equally far, the one that begins before the other is seen, of equals the first.
///
/// # Errors
/// `InvalidInput` for an unusable view or an image of another size, `Cancelled`, `OutOfMemory`.
pub fn cast(path: Path, glyphs: &Glyphs<'_>, view: &View, image: &mut Image<'_>, job: &Job) -> Result<()> {
    view.check()?;
    let pixels = view.width * view.height;
    if [image.depth.len(), image.glyph.len(), image.normal.len()] != [pixels; 3] {
        return Err(Error::InvalidInput("the image must have the size of the camera's".into()));
    }
    job.expect(glyphs.len().div_ceil(CHUNK) + view.height.div_ceil(BAND));
    let bins = Bins::new(path, glyphs, view, job)?;
    let centers = Centers::new(view)?;
    let (size, background) = (BAND * view.width, image.background);
    (image.depth.par_chunks_mut(size), image.glyph.par_chunks_mut(size), image.normal.par_chunks_mut(size))
        .into_par_iter()
        .enumerate()
        .try_for_each(|(number, (depth, glyph, normal))| {
            job.advance(1)?;
            let rows = Rows { depth, glyph, normal };
            path.dispatch(Band { glyphs, view, bins: &bins, centers: &centers, number, background, rows, job })
        })
}

/// Writes to each pixel of `target` the row of `source` that its glyph has; 0 where there is none.
///
/// # Errors
/// `InvalidInput` where the image has another size or a glyph has no row.
pub fn pick(glyph: &[i32], source: &[[f32; 3]], target: &mut [[f32; 3]]) -> Result<()> {
    check_pick(glyph, target.len(), source.len())?;
    target.par_iter_mut().zip(glyph).for_each(|(pixel, glyph)| {
        *pixel = usize::try_from(*glyph).map_or([0.0; 3], |glyph| source[glyph]);
    });
    Ok(())
}

/// Replaces each pixel's glyph by what that stands for.
///
/// # Errors
/// `InvalidInput` where a glyph stands for nothing.
pub fn rename(glyph: &mut [i32], names: &[i32]) -> Result<()> {
    check_pick(glyph, glyph.len(), names.len())?;
    glyph.par_iter_mut().for_each(|pixel| *pixel = usize::try_from(*pixel).map_or(NO_GLYPH, |glyph| names[glyph]));
    Ok(())
}

fn check_pick(glyph: &[i32], pixels: usize, rows: usize) -> Result<()> {
    if glyph.len() == pixels
        && glyph.par_iter().all(|glyph| usize::try_from(*glyph).is_ok_and(|glyph| glyph < rows) || *glyph < 0)
    {
        return Ok(());
    }
    Err(Error::InvalidInput("an attribute must have a row for each glyph, and its image the size of the camera's".into()))
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests;
