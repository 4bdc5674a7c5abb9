//! How far what is seen of triangles moves with their vertices.

use rayon::prelude::*;

use super::triangle::Edges;
use super::{Triangles, View};
use crate::bands::Centers;
use crate::error::{Error, Result};
use crate::job::Job;

/// Writes the ways, world space, from the points that a camera sees of triangles to where they are while the vertices are
/// elsewhere; 0 where no triangle is seen.
///
/// # Errors
/// `InvalidInput` for an unusable view, an image of another size, other vertices than those of the triangles, or a triangle
/// that does not exist; `Cancelled`, `OutOfMemory`.
pub fn displace(
    triangles: &Triangles<'_>,
    elsewhere: &[[f32; 3]],
    view: &View,
    triangle: &[i32],
    displacement: &mut [[f32; 3]],
    job: &Job,
) -> Result<()> {
    view.check()?;
    if [triangle.len(), displacement.len()] != [view.width * view.height; 2] {
        return Err(Error::InvalidInput("the images must have the size of the camera's".into()));
    }
    if elsewhere.len() != triangles.vertices.len() {
        return Err(Error::InvalidInput("there must be as many vertices elsewhere as here".into()));
    }
    job.expect(view.height);
    let centers = Centers::new(view)?;
    let rows = displacement.par_chunks_mut(view.width).zip(triangle.par_chunks(view.width)).zip(&centers.rows);
    rows.try_for_each(|((displacement, triangle), y)| {
        let mut last = None;
        for ((target, index), x) in displacement.iter_mut().zip(triangle).zip(&centers.columns) {
            let Ok(index) = usize::try_from(*index) else {
                *target = [0.0; 3];
                continue;
            };
            let moved = match last {
                Some((of, moved)) if of == index => moved,
                _ => Moved::new(triangles, elsewhere, index, view)?,
            };
            last = Some((index, moved));
            *target = moved.displacement([*x, *y]);
        }
        job.advance(1)
    })
}

/// A triangle that moves.
#[derive(Clone, Copy)]
struct Moved {
    edges: Edges,
    /// Of the corners, world space.
    ways: [[f64; 3]; 3],
}

impl Moved {
    #[inline(always)]
    fn new(triangles: &Triangles<'_>, elsewhere: &[[f32; 3]], index: usize, view: &View) -> Result<Self> {
        let corners = triangles.corners.get(index).ok_or_else(|| Error::InvalidInput("a triangle does not exist".into()))?;
        let ways = corners.map(|corner| {
            // `Triangles::new` has seen that it exists.
            let (here, there) = (triangles.vertices[corner as usize], elsewhere[corner as usize]);
            [0, 1, 2].map(|axis| f64::from(there[axis]) - f64::from(here[axis]))
        });
        Ok(Self { edges: Edges::new(&triangles.in_view(index, view), view.is_perspective), ways })
    }

    /// Of the point that the ray of a place in the window meets.
    #[inline(always)]
    fn displacement(&self, place: [f64; 2]) -> [f32; 3] {
        let [a, b, c] = self.edges.values(place);
        let [from_a, from_b, from_c] = &self.ways;
        let way = [0, 1, 2].map(|axis| (a * from_a[axis] + b * from_b[axis] + c * from_c[axis]) / (a + b + c));
        if way.iter().all(|part| part.is_finite()) { way.map(|part| part as f32) } else { [0.0; 3] }
    }
}
