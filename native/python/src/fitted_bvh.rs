//! The class `FittedBvh` of `meniscus_native`.

use meniscus_core::fitted_bvh::{FittedBvh as Bvh, Hierarchy, Node, Options, Rays};
use meniscus_core::job::Job;
use meniscus_core::memory;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{FluidArrays, Rows};
use crate::run::{python_error, run};

type Hits<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<i32>>);
type TreeArrays<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<u32>>, [f64; 3]);

/// Numbers of a node in an array.
const NODE_NUMBERS: usize = 8;

/// A tree over balls, in which any rays find the surface (Gourmel et al. 2010).
///
/// positions float32 (N, 3), radii and weights float32 (N,), world space; kernel: its coefficients, the constant first. `threads` 0: one for each core. `watch` is called with the share of the work that is done; what it
/// raises cancels.
#[pyclass(frozen)]
pub struct FittedBvh {
    /// The tree.
    pub bvh: Bvh,
}

#[pymethods]
impl FittedBvh {
    #[new]
    #[pyo3(signature = (positions, radii, weights, kernel, isovalue, *, overlapping=false, fits=true, tightens=true,
                        discards=true, proves=true, threads=0, watch=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn new(
        python: Python<'_>,
        positions: &Bound<'_, PyAny>,
        radii: &Bound<'_, PyAny>,
        weights: &Bound<'_, PyAny>,
        kernel: Vec<f64>,
        isovalue: f64,
        overlapping: bool,
        fits: bool,
        tightens: bool,
        discards: bool,
        proves: bool,
        threads: usize,
        watch: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let fluid = FluidArrays::borrow([positions, radii, weights], kernel, isovalue)?;
        let hierarchy = if overlapping { Hierarchy::Overlapping } else { Hierarchy::Fitted };
        let options = Options { hierarchy, fits, tightens, discards, proves };
        let fluid = fluid.plain();
        let build = |job: &Job| {
            let (balls, field) = fluid.checked()?;
            Bvh::build(&balls, &field, &options, job)
        };
        Ok(Self { bvh: run(python, threads, watch, build)? })
    }

    /// Where rays first cross the surface, either way: t float64 (N,), infinite where they do not; normals float32 (N, 3),
    /// unit, out of the fluid; balls int32 (N,), those with the greatest share of the field, -1 where there is none.
    ///
    /// origins and directions float64 (N, 3), world space; t_min and t_max float64 (N,), or (1,) for all.
    #[pyo3(signature = (origins, directions, t_min, t_max, *, threads=0, watch=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn first_hit<'py>(
        &self,
        python: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: &Bound<'py, PyAny>,
        t_max: &Bound<'py, PyAny>,
        threads: usize,
        watch: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Hits<'py>> {
        let arrays = RayArrays::borrow(origins, directions, t_min, t_max)?;
        let rays = arrays.rays()?;
        let hits = run(python, threads, watch, |job| self.bvh.first_hit(&rays, job))?;
        let normals = hits.normals.into_flattened().into_pyarray(python).reshape([hits.t.len(), 3])?;
        Ok((hits.t.into_pyarray(python), normals, hits.balls.into_pyarray(python)))
    }

    /// Whether rays cross the surface: bool (N,). Arguments as for `first_hit`.
    #[pyo3(signature = (origins, directions, t_min, t_max, *, threads=0, watch=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn any_hit<'py>(
        &self,
        python: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: &Bound<'py, PyAny>,
        t_max: &Bound<'py, PyAny>,
        threads: usize,
        watch: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let arrays = RayArrays::borrow(origins, directions, t_min, t_max)?;
        let rays = arrays.rays()?;
        Ok(run(python, threads, watch, |job| self.bvh.any_hit(&rays, job))?.into_pyarray(python))
    }

    /// Sums over rays of what finding their first hits takes: nodes traversed, leaves searched, balls in those leaves.
    /// Arguments as for `first_hit`.
    #[pyo3(signature = (origins, directions, t_min, t_max, *, threads=0, watch=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn count(
        &self,
        python: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: &Bound<'_, PyAny>,
        t_max: &Bound<'_, PyAny>,
        threads: usize,
        watch: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(u64, u64, u64)> {
        let arrays = RayArrays::borrow(origins, directions, t_min, t_max)?;
        let rays = arrays.rays()?;
        let counts = run(python, threads, watch, |job| self.bvh.count(&rays, job))?;
        Ok((counts.traversals, counts.searches, counts.balls))
    }

    /// The tree for a GPU: nodes float32 (M, 8), ids uint32 (K,), and where scene coordinates are 0 in world space. See
    /// docs/fitted_bvh.md.
    fn arrays<'py>(&self, python: Python<'py>) -> PyResult<TreeArrays<'py>> {
        let tree = self.bvh.tree();
        let mut nodes = memory::with_capacity(tree.nodes.len()).map_err(python_error)?;
        nodes.extend(tree.nodes.iter().map(Node::numbers));
        let nodes = nodes.into_flattened().into_pyarray(python).reshape([tree.nodes.len(), NODE_NUMBERS])?;
        Ok((nodes, PyArray1::from_slice(python, &tree.ids), self.bvh.origin()))
    }

    /// Bytes that it takes.
    #[getter]
    fn bytes(&self) -> usize {
        self.bvh.bytes()
    }
}

/// The arrays of N rays, borrowed.
struct RayArrays<'py> {
    origins: Rows<'py, f64, 3>,
    directions: Rows<'py, f64, 3>,
    t_min: Rows<'py, f64, 1>,
    t_max: Rows<'py, f64, 1>,
}

impl<'py> RayArrays<'py> {
    fn borrow(
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: &Bound<'py, PyAny>,
        t_max: &Bound<'py, PyAny>,
    ) -> PyResult<Self> {
        Ok(Self {
            origins: Rows::borrow("origins", origins)?,
            directions: Rows::borrow("directions", directions)?,
            t_min: Rows::borrow("t_min", t_min)?,
            t_max: Rows::borrow("t_max", t_max)?,
        })
    }

    fn rays(&self) -> PyResult<Rays<'_>> {
        let rays = Rays::new(self.origins.rows(), self.directions.rows(), self.t_min.numbers(), self.t_max.numbers());
        rays.map_err(python_error)
    }
}
