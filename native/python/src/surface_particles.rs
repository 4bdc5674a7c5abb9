//! The class `SurfaceParticles` of `meniscus_native`.

use std::sync::{Mutex, PoisonError};

use meniscus_core::surface_particles::{Options, Particle, Report, SurfaceParticles as Particles};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{FluidArrays, Rows};
use crate::run::{python_error, run};

type Vectors<'py> = Bound<'py, PyArray2<f32>>;
type Arrays<'py> = (Vectors<'py>, Vectors<'py>, Vectors<'py>, Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<u32>>);

/// Points that live on the surface of a fluid and move with it (van Kooten, van den Bergen and Telea 2007).
#[pyclass(frozen)]
pub struct SurfaceParticles(Mutex<Particles>);

#[pymethods]
impl SurfaceParticles {
    #[new]
    #[pyo3(signature = (*, count, cell_share, steps, disperses, fills_gaps, seed))]
    fn new(count: usize, cell_share: f64, steps: usize, disperses: bool, fills_gaps: bool, seed: u32) -> PyResult<Self> {
        let options = Options { count, cell_share, steps, disperses, fills_gaps, seed };
        Ok(Self(Mutex::new(Particles::new(options).map_err(python_error)?)))
    }

    /// Goes to the balls of another frame: follows those of the frame before for so many seconds, or begins anew all over the
    /// surface, at given points (M, 3) where there are any.
    ///
    /// positions float32 (N, 3), radii and weights float32 (N,), velocities float32 (N, 3) or None, units a second; kernel: its
    /// coefficients, the constant first. `threads` 0: one for each core. `watch` is called with the share of the work that is done;
    /// what it raises cancels. Returns how many particles were lost, placed and dispersed.
    #[pyo3(signature = (positions, radii, weights, kernel, isovalue, *, velocities=None, seconds=None, points=None, threads=0,
                        watch=None))]
    #[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
    fn go(
        &self,
        python: Python<'_>,
        positions: &Bound<'_, PyAny>,
        radii: &Bound<'_, PyAny>,
        weights: &Bound<'_, PyAny>,
        kernel: Vec<f64>,
        isovalue: f64,
        velocities: Option<&Bound<'_, PyAny>>,
        seconds: Option<f64>,
        points: Option<&Bound<'_, PyAny>>,
        threads: usize,
        watch: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(usize, usize, usize)> {
        let fluid = FluidArrays::borrow([positions, radii, weights], kernel, isovalue)?;
        let fluid = fluid.plain();
        let velocities = velocities.map(|array| Rows::<f32, 3>::borrow("velocities", array)).transpose()?;
        let velocities = velocities.as_ref().map(Rows::rows);
        let points = points.map(|array| Rows::<f32, 3>::borrow("points", array)).transpose()?;
        let points = points.as_ref().map(Rows::rows);
        let Report { lost, placed, dispersed } = run(python, threads, watch, |job| {
            let (balls, field) = fluid.checked()?;
            let mut particles = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            match (seconds, points) {
                (Some(seconds), _) => particles.follow(&balls, velocities, field, seconds, job),
                (None, Some(points)) => particles.seed_at(points, &balls, velocities, field, job),
                (None, None) => particles.seed(&balls, velocities, field, job),
            }
        })?;
        Ok((lost, placed, dispersed))
    }

    /// How many there are.
    fn count(&self) -> usize {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).particles().len()
    }

    /// The particles: positions, normals and velocities float32 (M, 3), spacings float32 (M,), ids uint32 (M,).
    fn arrays<'py>(&self, python: Python<'py>) -> PyResult<Arrays<'py>> {
        let particles = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let particles = particles.particles();
        let vectors = |of: fn(&Particle) -> [f32; 3]| {
            let numbers: Vec<f32> = particles.iter().flat_map(of).collect();
            numbers.into_pyarray(python).reshape([particles.len(), 3])
        };
        let spacings: Vec<f32> = particles.iter().map(|particle| particle.spacing).collect();
        let ids: Vec<u32> = particles.iter().map(|particle| particle.id).collect();
        Ok((
            vectors(|particle| particle.position)?,
            vectors(|particle| particle.normal)?,
            vectors(|particle| particle.velocity)?,
            spacings.into_pyarray(python),
            ids.into_pyarray(python),
        ))
    }
}
