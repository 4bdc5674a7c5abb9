//! Triangles as a camera sees them, for Python.

use meniscus_core::rasterizer::{self, Image, Triangles, View};
use meniscus_core::simd::Path;
use pyo3::prelude::*;

use crate::arrays::{Pixels, ReadPixels, Rows};
use crate::run::{python_error, run};

/// Writes what a camera sees of triangles.
///
/// vertices (V, 3) float32, world space; triangles (T, 3) int32, their corners; normals (T, 9) float32, those of the three
/// corners. The camera is that of `TileCaster`. depth (height, width) float32: planar, background where there is nothing;
/// triangle (height, width) int32: index, -1 where there is nothing; normal (height, width, 3) float32: unit, world space,
/// towards the eye. All are C-contiguous and borrowed.
#[pyfunction]
#[pyo3(signature = (vertices, triangles, normals, depth, triangle, normal, *, background, camera_from_world, eye, window,
                    is_perspective, width, height, clip, threads=0, watch=None))]
#[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
pub fn rasterize(
    python: Python<'_>,
    vertices: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
    normals: &Bound<'_, PyAny>,
    depth: &Bound<'_, PyAny>,
    triangle: &Bound<'_, PyAny>,
    normal: &Bound<'_, PyAny>,
    background: f32,
    camera_from_world: [[f64; 3]; 3],
    eye: [f64; 3],
    window: [f64; 4],
    is_perspective: bool,
    width: usize,
    height: usize,
    clip: [f64; 2],
    threads: usize,
    watch: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let view = View { camera_from_world, eye, window, is_perspective, width, height, clip };
    let (vertices, corners) = (Rows::borrow("vertices", vertices)?, Rows::borrow("triangles", triangles)?);
    let normals = Rows::borrow("normals", normals)?;
    let size = [width, height];
    let mut depth = Pixels::<f32, 1>::borrow("depth", depth, size)?;
    let mut triangle = Pixels::<i32, 1>::borrow("triangle", triangle, size)?;
    let mut normal = Pixels::<f32, 3>::borrow("normal", normal, size)?;
    let image = Image {
        depth: depth.numbers().map_err(python_error)?,
        triangle: triangle.numbers().map_err(python_error)?,
        normal: normal.numbers().map_err(python_error)?.as_chunks_mut().0,
        background,
    };
    let (vertices, corners, normals) = (vertices.rows(), corners.rows(), normals.rows());
    let path = Path::chosen().map_err(python_error)?;
    run(python, threads, watch, |job| {
        rasterizer::rasterize(path, &Triangles::new(vertices, corners, normals)?, &view, image, job)
    })
}

/// Writes how far what a camera sees of triangles is from where it is while their vertices are elsewhere.
///
/// The triangles, their normals and the camera are those of `rasterize`, and triangle (height, width) int32 is what that
/// wrote. elsewhere (V, 3) float32: the vertices, world space. displacement (height, width, 3) float32: to be written, world
/// space, 0 where there is nothing.
#[pyfunction]
#[pyo3(signature = (vertices, triangles, normals, elsewhere, triangle, displacement, *, camera_from_world, eye, window,
                    is_perspective, width, height, clip, threads=0, watch=None))]
#[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
pub fn displace(
    python: Python<'_>,
    vertices: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
    normals: &Bound<'_, PyAny>,
    elsewhere: &Bound<'_, PyAny>,
    triangle: &Bound<'_, PyAny>,
    displacement: &Bound<'_, PyAny>,
    camera_from_world: [[f64; 3]; 3],
    eye: [f64; 3],
    window: [f64; 4],
    is_perspective: bool,
    width: usize,
    height: usize,
    clip: [f64; 2],
    threads: usize,
    watch: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let view = View { camera_from_world, eye, window, is_perspective, width, height, clip };
    let (vertices, corners) = (Rows::borrow("vertices", vertices)?, Rows::borrow("triangles", triangles)?);
    let (normals, elsewhere) = (Rows::borrow("normals", normals)?, Rows::borrow("elsewhere", elsewhere)?);
    let size = [width, height];
    let triangle = ReadPixels::<i32, 1>::borrow("triangle", triangle, size)?;
    let mut displacement = Pixels::<f32, 3>::borrow("displacement", displacement, size)?;
    let displacement = displacement.numbers().map_err(python_error)?.as_chunks_mut().0;
    let (vertices, corners, normals) = (vertices.rows(), corners.rows(), normals.rows());
    let (elsewhere, triangle) = (elsewhere.rows(), triangle.numbers());
    run(python, threads, watch, |job| {
        rasterizer::displace(&Triangles::new(vertices, corners, normals)?, elsewhere, &view, triangle, displacement, job)
    })
}
