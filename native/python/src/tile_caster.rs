//! `TileCaster`: what a camera sees.

use meniscus_core::job::Job;
use meniscus_core::simd::Path;
use meniscus_core::tile_caster::{self, Attribute, Image, View};
use pyo3::prelude::*;

use crate::arrays::{FluidArrays, Pixels, Rows, check_rows};
use crate::run::{python_error, run};

/// A fluid as one view sees it: projected, culled and binned, ready to be cast.
///
/// positions (N, 3), radii (N,), weights (N,): float32, C-contiguous, world space.
/// kernel: coefficients of f(x), the constant first. isovalue: T.
/// camera_from_world: rows are the camera's right, up and forward directions. eye: world space.
/// window: left, right, bottom, top at depth 1 (perspective) or in world units. clip: planar depths.
/// threads: 0 for one a core. watch: called with the share done about every 20 ms; what it raises cancels.
#[pyclass(frozen)]
pub struct TileCaster(tile_caster::TileCaster);

#[pymethods]
impl TileCaster {
    #[new]
    #[pyo3(signature = (positions, radii, weights, kernel, isovalue, *, camera_from_world, eye, window, is_perspective,
                        width, height, clip, threads=0, watch=None))]
    #[allow(clippy::too_many_arguments, reason = "they are named in Python")]
    fn new(
        python: Python<'_>,
        positions: &Bound<'_, PyAny>,
        radii: &Bound<'_, PyAny>,
        weights: &Bound<'_, PyAny>,
        kernel: Vec<f64>,
        isovalue: f64,
        camera_from_world: [[f64; 3]; 3],
        eye: [f64; 3],
        window: [f64; 4],
        is_perspective: bool,
        width: usize,
        height: usize,
        clip: [f64; 2],
        threads: usize,
        watch: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let fluid = FluidArrays::borrow([positions, radii, weights], kernel, isovalue)?;
        let view = View { camera_from_world, eye, window, is_perspective, width, height, clip };
        let path = Path::chosen().map_err(python_error)?;
        let fluid = fluid.plain();
        let build = |job: &Job| {
            let (balls, field) = fluid.checked()?;
            tile_caster::TileCaster::new(path, &balls, &field, &view, job)
        };
        run(python, threads, watch, build).map(Self)
    }

    /// Cast every stride-th pixel (4, 2 or 1) along both axes and fill the pixels between.
    ///
    /// depth (height, width) float32: planar depth, background where there is nothing.
    /// normal (height, width, 3) float32: unit, world space, out of the fluid; 0 where there is nothing.
    /// ball (height, width) int32: index of the ball with the greatest share of the density; -1 where there is none.
    /// attributes: pairs of (N, 3) float32, a row for each ball, and its image (height, width, 3) float32.
    #[pyo3(signature = (depth, normal, *, background, stride=1, ball=None, attributes=vec![], threads=0, watch=None))]
    #[allow(clippy::too_many_arguments, reason = "they are named in Python")]
    fn cast(
        &self,
        python: Python<'_>,
        depth: &Bound<'_, PyAny>,
        normal: &Bound<'_, PyAny>,
        background: f32,
        stride: usize,
        ball: Option<&Bound<'_, PyAny>>,
        attributes: Vec<(Bound<'_, PyAny>, Bound<'_, PyAny>)>,
        threads: usize,
        watch: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let size = self.0.size();
        let mut depth = Pixels::<f32, 1>::borrow("depth", depth, size)?;
        let mut normal = Pixels::<f32, 3>::borrow("normal", normal, size)?;
        let mut ball = ball.map(|ball| Pixels::<i32, 1>::borrow("ball", ball, size)).transpose()?;
        let mut planes = Vec::new();
        for (source, target) in &attributes {
            let source = Rows::<f32, 3>::borrow("attributes", source)?;
            check_rows("attributes", source.rows().len(), self.0.ball_count()).map_err(python_error)?;
            planes.push((source, Pixels::<f32, 3>::borrow("attributes", target, size)?));
        }
        let ball = match &mut ball {
            Some(ball) => Some(ball.numbers().map_err(python_error)?),
            None => None,
        };
        let mut borrowed = Vec::new();
        for (source, target) in &mut planes {
            borrowed.push(Attribute::new(source.rows(), target.numbers().map_err(python_error)?));
        }
        let depth = depth.numbers().map_err(python_error)?;
        let normal = normal.numbers().map_err(python_error)?;
        let image = Image::new(size, background, depth, normal, ball, borrowed).map_err(python_error)?;
        run(python, threads, watch, |job| self.0.cast(stride, &image, job))
    }

    /// How many balls may be seen.
    #[getter]
    fn seen(&self) -> usize {
        self.0.seen()
    }

    /// How many pairs of balls and tiles of pixels there are.
    #[getter]
    fn tile_entries(&self) -> usize {
        self.0.tile_entries()
    }
}

/// The SIMD paths that this processor has, the fastest first.
#[pyfunction]
pub fn simd_paths() -> Vec<&'static str> {
    Path::available().into_iter().map(Path::name).collect()
}

/// The SIMD path that is taken, see the environment variable MENISCUS_SIMD.
#[pyfunction]
pub fn simd_path() -> PyResult<&'static str> {
    Path::chosen().map(Path::name).map_err(python_error)
}
