//! The rasterizer: what a camera sees of triangles, exactly where the rays through the centres of its pixels meet them.
//!
//! Edge functions of three coordinates (Olano and Greer 1997) need no clipping at the eye. Those of an edge that two triangles
//! share are each other's negatives to the last bit, so that no ray passes between them. Triangles are binned to bands of
//! rows; each band is drawn by one thread, in the order of the triangles. The image does not depend on the number of threads
//! or the instructions of the processor.

mod band;
mod displacement;
mod triangle;

use rayon::prelude::*;

use self::band::{Band, Rows};
pub use self::displacement::displace;
use self::triangle::Corners;
use crate::bands::{BAND, Bins, CHUNK, Centers, Place, Placed};
use crate::error::{Error, Result};
use crate::job::Job;
use crate::simd::Path;
pub use crate::tile_caster::View;

/// What stands for no triangle.
pub const NO_TRIANGLE: i32 = -1;

/// Triangles in world space.
#[derive(Clone, Copy, Debug)]
pub struct Triangles<'a> {
    vertices: &'a [[f32; 3]],
    corners: &'a [[i32; 3]],
    normals: &'a [[f32; 9]],
}

impl<'a> Triangles<'a> {
    /// Vertices, the three that each triangle has, and the normals there, corner after corner.
    ///
    /// # Errors
    /// `InvalidInput` where a vertex does not exist or the numbers of triangles and of normals differ.
    pub fn new(vertices: &'a [[f32; 3]], corners: &'a [[i32; 3]], normals: &'a [[f32; 9]]) -> Result<Self> {
        let exists = |index: &i32| usize::try_from(*index).is_ok_and(|index| index < vertices.len());
        if !corners.par_iter().all(|triangle| triangle.iter().all(exists)) {
            return Err(Error::InvalidInput("a triangle has a vertex that does not exist".into()));
        }
        if normals.len() != corners.len() || i32::try_from(corners.len()).is_err() {
            return Err(Error::InvalidInput("there must be as many normals as triangles, and less than 2^31".into()));
        }
        Ok(Self { vertices, corners, normals })
    }

    /// The corners of a triangle in camera space.
    #[inline(always)]
    fn in_view(&self, triangle: usize, view: &View) -> Corners {
        self.corners[triangle].map(|index| {
            // `new` has seen that it exists.
            let vertex = self.vertices[index as usize];
            let offset = [0, 1, 2].map(|axis| f64::from(vertex[axis]) - view.eye[axis]);
            view.camera_from_world.map(|row| row[0] * offset[0] + row[1] * offset[1] + row[2] * offset[2])
        })
    }
}

impl Placed for Triangles<'_> {
    fn count(&self) -> usize {
        self.corners.len()
    }

    #[inline(always)]
    fn place(&self, index: usize, view: &View) -> Option<Place> {
        triangle::place(&self.in_view(index, view), view)
    }
}

/// An image to be written, row 0 at the bottom.
pub struct Image<'a> {
    /// Planar depth; `background` where there is nothing.
    pub depth: &'a mut [f32],
    /// Index of the triangle, `NO_TRIANGLE` where there is nothing.
    pub triangle: &'a mut [i32],
    /// Unit, world space, towards the eye; 0 where there is nothing.
    pub normal: &'a mut [[f32; 3]],
    /// What stands for no depth.
    pub background: f32,
}

/// Writes what a camera sees of triangles; where two are equally far, the first one.
///
/// # Errors
/// `InvalidInput` for an unusable view or an image of another size, `Cancelled`, `OutOfMemory`.
pub fn rasterize(path: Path, triangles: &Triangles<'_>, view: &View, image: Image<'_>, job: &Job) -> Result<()> {
    view.check()?;
    let pixels = view.width * view.height;
    if [image.depth.len(), image.triangle.len(), image.normal.len()] != [pixels; 3] {
        return Err(Error::InvalidInput("the image must have the size of the camera's".into()));
    }
    job.expect(triangles.corners.len().div_ceil(CHUNK) + view.height.div_ceil(BAND));
    let bins = Bins::new(path, triangles, view, job)?;
    let centers = Centers::new(view)?;
    let (size, background) = (BAND * view.width, image.background);
    (image.depth.par_chunks_mut(size), image.triangle.par_chunks_mut(size), image.normal.par_chunks_mut(size))
        .into_par_iter()
        .enumerate()
        .try_for_each(|(number, (depth, triangle, normal))| {
            job.advance(1)?;
            let rows = Rows { depth, triangle, normal };
            path.dispatch(Band { triangles, view, bins: &bins, centers: &centers, number, background, rows, job })
        })
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests;
