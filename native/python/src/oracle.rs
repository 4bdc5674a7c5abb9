//! The exact caster for Python.

use meniscus_core::job::Job;
use meniscus_core::oracle::{Rays, cast, crossings};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{FluidArrays, Rows};
use crate::run::{python_error, run};

type Column<'py, T> = Bound<'py, PyArray1<T>>;

/// Finds where rays first cross the isosurface, in either direction.
///
/// positions (N, 3), radii (N,) and weights (N,) are float32; origins and directions (M, 3) are float64. All are C-contiguous
/// and borrowed. kernel holds the coefficients of the density kernel, the constant first. threads: 0 for one a core. watch is
/// called with the share that is done; what it raises cancels the work.
///
/// Returns t (M,) float64, the distance along the unit ray, inf where it does not cross, and normals (M, 3) float64: unit,
/// out of the fluid, 0 where the ray does not cross. Raises ValueError where an argument is unusable.
#[pyfunction]
#[pyo3(signature = (positions, radii, weights, kernel, isovalue, origins, directions, threads=0, watch=None))]
#[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
pub fn oracle_cast<'py>(
    python: Python<'py>,
    positions: &Bound<'py, PyAny>,
    radii: &Bound<'py, PyAny>,
    weights: &Bound<'py, PyAny>,
    kernel: Vec<f64>,
    isovalue: f64,
    origins: &Bound<'py, PyAny>,
    directions: &Bound<'py, PyAny>,
    threads: usize,
    watch: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Column<'py, f64>, Bound<'py, PyArray2<f64>>)> {
    let fluid = FluidArrays::borrow([positions, radii, weights], kernel, isovalue)?;
    let (origins, directions) = (Rows::borrow("origins", origins)?, Rows::borrow("directions", directions)?);
    let fluid = fluid.plain();
    let rays = Rays::new(origins.rows(), directions.rows()).map_err(python_error)?;
    let first = run(python, threads, watch, |job: &Job| {
        let (balls, field) = fluid.checked()?;
        cast(balls, field, rays, job)
    })?;
    let normals = first.normals.into_flattened().into_pyarray(python).reshape([rays.len(), 3])?;
    Ok((first.t.into_pyarray(python), normals))
}

/// Finds all crossings of rays with the isosurface.
///
/// The arguments are those of `oracle_cast`. Returns rays (K,) int64, the index of the ray; t (K,) float64, the distance along
/// the unit ray; is_entering (K,) bool, whether the ray goes into the fluid: in order of ray and distance.
#[pyfunction]
#[pyo3(signature = (positions, radii, weights, kernel, isovalue, origins, directions, threads=0, watch=None))]
#[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
pub fn oracle_crossings<'py>(
    python: Python<'py>,
    positions: &Bound<'py, PyAny>,
    radii: &Bound<'py, PyAny>,
    weights: &Bound<'py, PyAny>,
    kernel: Vec<f64>,
    isovalue: f64,
    origins: &Bound<'py, PyAny>,
    directions: &Bound<'py, PyAny>,
    threads: usize,
    watch: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Column<'py, i64>, Column<'py, f64>, Column<'py, bool>)> {
    let fluid = FluidArrays::borrow([positions, radii, weights], kernel, isovalue)?;
    let (origins, directions) = (Rows::borrow("origins", origins)?, Rows::borrow("directions", directions)?);
    let fluid = fluid.plain();
    let rays = Rays::new(origins.rows(), directions.rows()).map_err(python_error)?;
    let all = run(python, threads, watch, |job: &Job| {
        let (balls, field) = fluid.checked()?;
        crossings(balls, field, rays, job)
    })?;
    Ok((all.rays.into_pyarray(python), all.t.into_pyarray(python), all.is_entering.into_pyarray(python)))
}
