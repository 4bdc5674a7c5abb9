//! Casts rays at the isosurface of a sum of density kernels, without Python.
//!
//! `balls`, `kernel` and `field` are what is cast at; `job` and `memory` let long work be cancelled and big arrays fail
//! with an error instead of an abort. Everything else is a way to find the surface.

pub mod balls;
mod bands;
mod cells;
pub mod clusters;
pub mod error;
pub mod field;
pub mod fitted_bvh;
pub mod glyphs;
pub mod job;
pub mod kernel;
pub mod memory;
pub mod neighbours;
pub mod oracle;
pub mod placing;
pub mod rasterizer;
pub mod shading;
pub mod simd;
pub mod surface_particles;
pub mod tile_caster;
pub mod tracing;
mod vectors;
