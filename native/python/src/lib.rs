//! `meniscus_native`: meniscus-core for Python. Arrays are borrowed, the GIL is released, and nothing aborts the process:
//! bad input is a ValueError, too little memory a MemoryError, a defect of ours a RuntimeError.

mod arrays;
mod clusters;
mod discs;
mod fitted_bvh;
mod glyphs;
mod neighbours;
mod oracle;
mod rasterizer;
mod run;
mod shading;
mod surface_particles;
mod tile_caster;
mod tracing;

use pyo3::prelude::*;

#[pymodule]
mod meniscus_native {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::clusters::find_clusters;
    #[pymodule_export]
    use super::discs::draw_discs;
    #[pymodule_export]
    use super::fitted_bvh::FittedBvh;
    #[pymodule_export]
    use super::glyphs::cast_glyphs;
    #[pymodule_export]
    use super::neighbours::find_neighbours;
    #[pymodule_export]
    use super::oracle::{oracle_cast, oracle_crossings};
    #[pymodule_export]
    use super::rasterizer::{displace, rasterize};
    #[pymodule_export]
    use super::shading::{label, place, shade_image, shade_points};
    #[pymodule_export]
    use super::surface_particles::SurfaceParticles;
    #[pymodule_export]
    use super::tile_caster::{TileCaster, simd_path, simd_paths};
    #[pymodule_export]
    use super::tracing::{Triangles, WorldImage, show_world, trace_image};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
