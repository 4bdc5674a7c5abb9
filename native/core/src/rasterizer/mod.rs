//! The rasterizer: what a camera sees of triangles, exactly where the rays through the centres of its pixels meet them.
//!
//! Edge functions of three coordinates (Olano and Greer 1997) need no clipping at the eye. Those of an edge that two triangles
//! share are each other's negatives to the last bit, so that no ray passes between them.

mod triangle;

use rayon::prelude::*;

use self::triangle::{Corners, Edges};
use crate::error::{Error, Result};
use crate::job::Job;
use crate::memory;
pub use crate::tile_caster::View;

/// What stands for no triangle.
pub const NO_TRIANGLE: i32 = -1;

/// Rows of pixels that a thread fills at a time.
const BAND: usize = 16;

/// Triangles that a thread places at a time.
const CHUNK: usize = 4096;

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
pub fn rasterize(triangles: &Triangles<'_>, view: &View, image: Image<'_>, job: &Job) -> Result<()> {
    view.check()?;
    let pixels = view.width * view.height;
    if [image.depth.len(), image.triangle.len(), image.normal.len()] != [pixels; 3] {
        return Err(Error::InvalidInput("the image must have the size of the camera's".into()));
    }
    let bands = view.height.div_ceil(BAND);
    job.expect(triangles.corners.len().div_ceil(CHUNK) + bands);
    let places = placed(triangles, view, job)?;
    let raster = Raster { triangles, view, places: &places, background: image.background };
    let size = BAND * view.width;
    (image.depth.par_chunks_mut(size), image.triangle.par_chunks_mut(size), image.normal.par_chunks_mut(size))
        .into_par_iter()
        .enumerate()
        .try_for_each(|(band, (depth, triangle, normal))| {
            job.advance(1)?;
            raster.fill(band * BAND, depth, triangle, normal);
            Ok(())
        })
}

/// The pixels that a triangle may cover: columns and rows, first and behind the last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Place {
    columns: [u16; 2],
    rows: [u16; 2],
}

/// Where each triangle lies; none for those that are not seen.
fn placed(triangles: &Triangles<'_>, view: &View, job: &Job) -> Result<Vec<Place>> {
    let mut places = memory::filled(Place::default(), triangles.corners.len())?;
    places.par_chunks_mut(CHUNK).enumerate().try_for_each(|(chunk, places)| {
        job.advance(1)?;
        for (index, place) in places.iter_mut().enumerate() {
            *place = triangle::place(&triangles.in_view(chunk * CHUNK + index, view), view);
        }
        Ok(())
    })?;
    Ok(places)
}

struct Raster<'a> {
    triangles: &'a Triangles<'a>,
    view: &'a View,
    places: &'a [Place],
    background: f32,
}

impl Raster<'_> {
    /// Fills a band of rows that begins at `first_row`.
    fn fill(&self, first_row: usize, depth: &mut [f32], triangle: &mut [i32], normal: &mut [[f32; 3]]) {
        depth.fill(self.background);
        triangle.fill(NO_TRIANGLE);
        let end = first_row + depth.len() / self.view.width;
        for (index, place) in self.places.iter().enumerate() {
            let rows = first_row.max(place.rows[0].into())..end.min(place.rows[1].into());
            if !rows.is_empty() {
                let edges = Edges::new(&self.triangles.in_view(index, self.view), self.view.is_perspective);
                for row in rows {
                    let start = (row - first_row) * self.view.width;
                    let line = start..start + self.view.width;
                    self.fill_row(&edges, index as i32, row, &mut depth[line.clone()], &mut triangle[line]);
                }
            }
        }
        for (offset, (found, normal)) in triangle.iter().zip(normal).enumerate() {
            let (row, column) = (first_row + offset / self.view.width, offset % self.view.width);
            *normal = usize::try_from(*found).map_or([0.0; 3], |index| self.normal(index, column, row));
        }
    }

    #[inline(always)]
    fn fill_row(&self, edges: &Edges, index: i32, row: usize, depth: &mut [f32], triangle: &mut [i32]) {
        let [first, end] = self.places[index as usize].columns.map(usize::from);
        for column in first..end {
            let Some(found) = edges.depth(self.view.pixel_center(column, row)) else { continue };
            // What would round to the background is none.
            if found >= self.view.clip[0] && found <= self.view.clip[1] && (found as f32) < depth[column] {
                depth[column] = found as f32;
                triangle[column] = index;
            }
        }
    }

    /// The normal of a triangle in a pixel that sees it.
    fn normal(&self, index: usize, column: usize, row: usize) -> [f32; 3] {
        let corners = self.triangles.in_view(index, self.view);
        let center = self.view.pixel_center(column, row);
        let shares = Edges::new(&corners, self.view.is_perspective).shares(center);
        let at_corners = &self.triangles.normals[index];
        let sum = [0, 1, 2].map(|axis| (0..3).map(|corner| shares[corner] * f64::from(at_corners[3 * corner + axis])).sum());
        let length = dot(sum, sum).sqrt();
        if length.is_nan() || length <= 0.0 {
            return [0.0; 3];
        }
        // The side of the triangle that is seen decides, as a smooth normal may already point away from the eye.
        let facing = triangle::facing(&corners, center, self.view);
        let geometric = self.view.camera_from_world;
        let world = [0, 1, 2].map(|axis| (0..3).map(|row| geometric[row][axis] * facing[row]).sum());
        let sign = if dot(world, sum) < 0.0 { -1.0 } else { 1.0 };
        sum.map(|part| (sign * part / length) as f32)
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests;
