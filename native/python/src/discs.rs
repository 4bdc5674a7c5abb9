//! Surface particles as a camera sees them, for Python.

use meniscus_core::simd::Path;
use meniscus_core::tile_caster::{Attribute, Image, View};
use pyo3::prelude::*;

use crate::arrays::{Pixels, Rows};
use crate::run::{python_error, run};
use crate::surface_particles::SurfaceParticles;

/// Writes what a camera sees of the discs of surface particles, which have been seeded.
///
/// is_exact: whether what the discs show is moved onto the surface. The camera is that of `TileCaster`. depth (height, width)
/// float32: planar, background where there is nothing; normal (height, width, 3) float32: unit, world space, out of the fluid;
/// ball (height, width) int32: index of the ball with the greatest share of the density, -1 where there is none. attributes:
/// pairs of (N, 3) float32, a row for each ball, and its image (height, width, 3) float32, 0 where there is nothing.
#[pyfunction]
#[pyo3(signature = (particles, depth, normal, *, background, is_exact, camera_from_world, eye, window, is_perspective, width,
                    height, clip, ball=None, attributes=vec![], threads=0, watch=None))]
#[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
pub fn draw_discs(
    python: Python<'_>,
    particles: &Bound<'_, SurfaceParticles>,
    depth: &Bound<'_, PyAny>,
    normal: &Bound<'_, PyAny>,
    background: f32,
    is_exact: bool,
    camera_from_world: [[f64; 3]; 3],
    eye: [f64; 3],
    window: [f64; 4],
    is_perspective: bool,
    width: usize,
    height: usize,
    clip: [f64; 2],
    ball: Option<&Bound<'_, PyAny>>,
    attributes: Vec<(Bound<'_, PyAny>, Bound<'_, PyAny>)>,
    threads: usize,
    watch: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let view = View { camera_from_world, eye, window, is_perspective, width, height, clip };
    let size = [width, height];
    let mut depth = Pixels::<f32, 1>::borrow("depth", depth, size)?;
    let mut normal = Pixels::<f32, 3>::borrow("normal", normal, size)?;
    let mut ball = ball.map(|ball| Pixels::<i32, 1>::borrow("ball", ball, size)).transpose()?;
    let mut planes = Vec::new();
    for (source, target) in &attributes {
        planes.push((Rows::<f32, 3>::borrow("attributes", source)?, Pixels::<f32, 3>::borrow("attributes", target, size)?));
    }
    let ball = ball.as_mut().map(Pixels::numbers).transpose().map_err(python_error)?;
    let mut borrowed = Vec::new();
    for (source, target) in &mut planes {
        borrowed.push(Attribute::new(source.rows(), target.numbers().map_err(python_error)?));
    }
    let (depth, normal) = (depth.numbers().map_err(python_error)?, normal.numbers().map_err(python_error)?);
    let image = Image::new(size, background, depth, normal, ball, borrowed).map_err(python_error)?;
    let path = Path::chosen().map_err(python_error)?;
    let particles = particles.get();
    run(python, threads, watch, |job| particles.locked().draw(path, &view, is_exact, &image, job))
}
