//! Draws surface particles as discs that bend as the surface does (van Kooten, van den Bergen and Telea 2007, section 7.6;
//! there discs are flat, and only their normals bend).
//!
//! - A disc ([`disc`]) is what of a quadric lies within a radius of its particle, as far as it does not turn away much. A ray
//!   meets it at the first point, between the clip depths, where it comes from outside; where a ray starts inside the fluid,
//!   where it comes from inside.
//! - The nearest disc of a pixel says how far its front is. Pictures of the discs alone blend all that are met at most
//!   [`disc::BLEND_BEHIND`] of their radii behind it ([`band`]): distance and normal are the means, weighted by
//!   `(1 - |x|^2 / r^2)^2` of the distance x from the particle and the radius r.
//! - Exact pictures go from the front along the ray to the surface, by steps of Newton's method. Where that leads nowhere, the
//!   disc hangs over the surface, mostly at silhouettes: then the next disc beyond is the front, until one leads there or there
//!   is none. It is not the blend from which they start: that may lie behind a thin part that a ray grazes.
//! - Colours, velocities and balls are those of the fluid at the point.
//!
//! All of it in double precision. The image does not depend on the number of threads. The discs and their blend are those of
//! gpu_shaders/methods/surface_particles.

mod band;
mod disc;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use self::band::Band;
use self::disc::{Disc, Shown, TURNED, TURNED_TO_EDGE};
use super::SurfaceParticles;
use super::fluid::Fluid;
use crate::bands::{BAND, Bins, CHUNK, Centers};
use crate::error::{Error, Result};
use crate::job::Job;
use crate::simd::Path;
use crate::tile_caster::Image;
pub use crate::tile_caster::View;

impl SurfaceParticles {
    /// Draws what a camera sees of the particles; `is_exact` moves what the discs show onto the surface. Attributes have a row
    /// for each ball.
    ///
    /// # Errors
    /// `InvalidInput` for an unusable view or an image of another size, `Cancelled`, `OutOfMemory`.
    pub fn draw(&self, path: Path, view: &View, is_exact: bool, image: &Image<'_>, job: &Job) -> Result<()> {
        view.check()?;
        let Some(fluid) = self.fluid.as_ref() else {
            return Err(Error::InvalidInput("surface particles must be seeded before they are drawn".into()));
        };
        if image.size() != [view.width, view.height]
            || image.attributes().iter().any(|attribute| attribute.rows() != fluid.len())
        {
            return Err(Error::InvalidInput(
                "the image must have the size of the camera's, and attributes a row for each ball".into(),
            ));
        }
        job.expect(self.particles.len().div_ceil(CHUNK) + view.height.div_ceil(BAND));
        let turned = if is_exact { TURNED_TO_EDGE } else { TURNED };
        let discs = self.particles.par_iter().filter_map(|particle| Disc::new(fluid, particle, self.reach, turned));
        let discs: Vec<Disc> = discs.collect();
        let can_start_inside = reaches_clip_start(fluid, view);
        let bins = Bins::new(path, &Shown { discs: &discs, can_start_inside }, view, job)?;
        let centers = Centers::new(view)?;
        (0..view.height.div_ceil(BAND)).into_par_iter().try_for_each(|number| {
            job.advance(1)?;
            let band = Band { fluid, view, bins: &bins, centers: &centers, discs: &discs, number, can_start_inside, is_exact };
            path.dispatch(band.drawn_into(image))
        })
    }
}

/// Whether a ball reaches before the near clip plane, so that rays may start inside the fluid.
fn reaches_clip_start(fluid: &Fluid, view: &View) -> bool {
    let forward = view.camera_from_world[2];
    (0..fluid.len()).into_par_iter().any(|ball| {
        let (center, radius, _) = fluid.ball(ball);
        let depth: f64 = (0..3).map(|axis| forward[axis] * (center[axis] - view.eye[axis])).sum();
        depth - radius <= view.clip[0]
    })
}
