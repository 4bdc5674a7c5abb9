//! Which balls' influence spheres overlap, for Python.

use meniscus_core::balls::Balls;
use meniscus_core::neighbours;
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::arrays::Rows;
use crate::run::{python_error, run};

type Column<'py> = Bound<'py, PyArray1<u32>>;

/// Finds for each ball those whose influence spheres overlap its own.
///
/// positions (N, 3) and radii (N,) are float32, C-contiguous and borrowed. most: how many neighbours there may be, each pair
/// counted twice; ValueError where there are more. threads: 0 for one a core. watch is called with the share that is done; what
/// it raises cancels the work.
///
/// Returns order (N,), the balls in an order of space; starts (N + 1,), where the list of each begins; places (E,), the lists one
/// after the other, as places in that order; all uint32. And an origin from which every position is a float32 exactly.
#[pyfunction]
#[pyo3(signature = (positions, radii, *, most, threads=0, watch=None))]
pub fn find_neighbours<'py>(
    python: Python<'py>,
    positions: &Bound<'py, PyAny>,
    radii: &Bound<'py, PyAny>,
    most: u32,
    threads: usize,
    watch: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Column<'py>, Column<'py>, Column<'py>, [f64; 3])> {
    let positions = Rows::<f32, 3>::borrow("positions", positions)?;
    let radii = Rows::<f32, 1>::borrow("radii", radii)?;
    let (centers, reaches) = (positions.rows(), radii.numbers());
    let balls = Balls::new(centers, reaches, reaches).map_err(python_error)?;
    let found = run(python, threads, watch, |job| neighbours::neighbours(&balls, most, job))?;
    let [order, starts, places] = [found.order, found.starts, found.places].map(|column| column.into_pyarray(python));
    Ok((order, starts, places, balls.exact_origin()))
}
