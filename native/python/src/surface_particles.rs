//! The class `SurfaceParticles` of `meniscus_native`.

use std::sync::{Mutex, MutexGuard, PoisonError};

use meniscus_core::surface_particles::{
    Level, Options, Particle, Report, SurfaceParticles as Particles, SurfacePoint, adapted_reach,
};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{FluidArrays, Rows};
use crate::run::{python_error, run};

type Vectors<'py> = Bound<'py, PyArray2<f32>>;
type HashLevel<'py> = (f64, Bound<'py, PyArray1<u32>>, Bound<'py, PyArray2<u32>>);
type Numbers<'py> = Bound<'py, PyArray1<f32>>;
type Arrays<'py> = (Vectors<'py>, Vectors<'py>, Vectors<'py>, Numbers<'py>, Numbers<'py>, Bound<'py, PyArray1<u32>>);

/// Points that live on the surface of a fluid and move with it (van Kooten, van den Bergen and Telea 2007).
#[pyclass(frozen)]
pub struct SurfaceParticles(Mutex<Particles>);

impl SurfaceParticles {
    pub fn locked(&self) -> MutexGuard<'_, Particles> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

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
            let mut particles = self.locked();
            match (seconds, points) {
                (Some(seconds), _) => particles.follow(&balls, velocities, field, seconds, job),
                (None, Some(points)) => particles.seed_at(points, &balls, velocities, field, job),
                (None, None) => particles.seed(&balls, velocities, field, job),
            }
        })?;
        Ok((lost, placed, dispersed))
    }

    /// Makes these balls those that particles are to be on, which are moved elsewhere. The arguments are those of `go`.
    #[pyo3(signature = (positions, radii, weights, kernel, isovalue, *, velocities=None, threads=0, watch=None))]
    #[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
    fn stand_on(
        &self,
        python: Python<'_>,
        positions: &Bound<'_, PyAny>,
        radii: &Bound<'_, PyAny>,
        weights: &Bound<'_, PyAny>,
        kernel: Vec<f64>,
        isovalue: f64,
        velocities: Option<&Bound<'_, PyAny>>,
        threads: usize,
        watch: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let fluid = FluidArrays::borrow([positions, radii, weights], kernel, isovalue)?;
        let fluid = fluid.plain();
        let velocities = velocities.map(|array| Rows::<f32, 3>::borrow("velocities", array)).transpose()?;
        let velocities = velocities.as_ref().map(Rows::rows);
        run(python, threads, watch, |_| {
            let (balls, field) = fluid.checked()?;
            self.locked().stand_on(&balls, velocities, field)
        })
    }

    /// The spatial hash of the present balls: for each octave of radii the side of its cells, where the entries of each bucket
    /// begin and the last ends, uint32 (B + 1,), and the entries, uint32 (E, 2): the ball and the tag of the cell.
    fn hash<'py>(&self, python: Python<'py>) -> PyResult<Vec<HashLevel<'py>>> {
        let arrays = |level: &Level| {
            let entries: Vec<u32> = level.entries.iter().flat_map(|entry| [entry.ball, entry.tag]).collect();
            let entries = entries.into_pyarray(python).reshape([level.entries.len(), 2])?;
            Ok((level.side, level.starts.clone().into_pyarray(python), entries))
        };
        self.locked().levels().iter().map(arrays).collect()
    }

    /// Takes particles that are on the present balls in place of its own, and fills the gaps between them.
    ///
    /// positions and normals float32 (M, 3), scales float32 (M,). Returns how many were placed; these are behind the others.
    #[pyo3(signature = (positions, normals, scales, *, reach, step, threads=0, watch=None))]
    #[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
    fn refill(
        &self,
        python: Python<'_>,
        positions: &Bound<'_, PyAny>,
        normals: &Bound<'_, PyAny>,
        scales: &Bound<'_, PyAny>,
        reach: f64,
        step: u32,
        threads: usize,
        watch: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<usize> {
        let positions = Rows::<f32, 3>::borrow("positions", positions)?;
        let normals = Rows::<f32, 3>::borrow("normals", normals)?;
        let scales = Rows::<f32, 1>::borrow("scales", scales)?;
        let (positions, normals, scales) = (positions.rows(), normals.rows(), scales.rows());
        run(python, threads, watch, |job| {
            let places = positions.iter().zip(normals).zip(scales).map(|((position, normal), [scale])| SurfacePoint {
                position: position.map(f64::from),
                normal: normal.map(f64::from),
                scale: f64::from(*scale),
            });
            self.locked().refill(places, reach, step, job)
        })
    }

    /// How far particles push one another, in influence radii.
    #[getter]
    fn reach(&self) -> f64 {
        self.locked().reach()
    }

    /// The reach of the next frame, of the present one and of how many others are within that on average.
    #[staticmethod]
    fn adapted_reach(company: f64, reach: f64) -> f64 {
        adapted_reach(company, reach)
    }

    /// How many there are.
    fn count(&self) -> usize {
        self.locked().particles().len()
    }

    /// The particles: positions, normals and velocities float32 (M, 3), scales and spacings float32 (M,), ids uint32 (M,).
    fn arrays<'py>(&self, python: Python<'py>) -> PyResult<Arrays<'py>> {
        let particles = self.locked();
        let particles = particles.particles();
        let vectors = |of: fn(&Particle) -> [f32; 3]| {
            let numbers: Vec<f32> = particles.iter().flat_map(of).collect();
            numbers.into_pyarray(python).reshape([particles.len(), 3])
        };
        let scales: Vec<f32> = particles.iter().map(|particle| particle.scale).collect();
        let spacings: Vec<f32> = particles.iter().map(|particle| particle.spacing).collect();
        let ids: Vec<u32> = particles.iter().map(|particle| particle.id).collect();
        Ok((
            vectors(|particle| particle.position)?,
            vectors(|particle| particle.normal)?,
            vectors(|particle| particle.velocity)?,
            scales.into_pyarray(python),
            spacings.into_pyarray(python),
            ids.into_pyarray(python),
        ))
    }
}
