//! The connected parts of a fluid, for Python.

use meniscus_core::clusters;
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::arrays::FluidArrays;
use crate::run::run;

type Column<'py, T> = Bound<'py, PyArray1<T>>;

/// Finds which balls are one liquid.
///
/// positions (N, 3), radii (N,) and weights (N,) are float32, C-contiguous and borrowed; kernel holds the coefficients of the
/// density kernel, the constant first. threads: 0 for one a core. watch is called with the share that is done; what it raises
/// cancels the work.
///
/// Returns labels (N,) int32, -1 where a ball's centre is not in the fluid, and sizes (C,) uint32.
#[pyfunction]
#[pyo3(signature = (positions, radii, weights, kernel, isovalue, *, threads=0, watch=None))]
#[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
pub fn find_clusters<'py>(
    python: Python<'py>,
    positions: &Bound<'py, PyAny>,
    radii: &Bound<'py, PyAny>,
    weights: &Bound<'py, PyAny>,
    kernel: Vec<f64>,
    isovalue: f64,
    threads: usize,
    watch: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Column<'py, i32>, Column<'py, u32>)> {
    let fluid = FluidArrays::borrow([positions, radii, weights], kernel, isovalue)?;
    let fluid = fluid.plain();
    let found = run(python, threads, watch, |job| {
        let (balls, field) = fluid.checked()?;
        clusters::clusters(&balls, &field, job)
    })?;
    Ok((found.labels.into_pyarray(python), found.sizes.into_pyarray(python)))
}
