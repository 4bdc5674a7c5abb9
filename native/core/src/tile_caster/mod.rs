//! The tile caster: what a camera sees of a fluid, fast and on any processor.
//!
//! Balls are projected; kernel spheres hide what lies behind them (Kanamori et al. 2008, section 5.2); the rest is binned to
//! tiles and sorted by where influence spheres begin; packets of sixteen rays walk to the surface. The image does not depend
//! on the number of threads.

mod bins;
mod culling;
mod image;
mod kernel_spheres;
mod occlusion;
mod packet;
mod polynomial;
mod project;
mod steps;
mod tile;
mod view;

use rayon::prelude::*;

use self::bins::Bins;
use self::culling::Culled;
pub use self::image::{Attribute, Image, NO_BALL};
use self::occlusion::CELL;
use self::packet::{ActiveBalls, Thresholds, Walk};
use self::polynomial::Polynomial;
use self::tile::{Blends, Entries, PacketPixels, PixelCenters, Rays, Surface};
pub use self::view::View;
use crate::balls::Balls;
use crate::error::{Error, Result};
use crate::field::Field;
use crate::job::Job;
use crate::simd::{Path, Simd, Task};

/// The strides that an image can be cast with, the coarsest first.
pub const STRIDES: [usize; 3] = [4, 2, 1];

/// A fluid as one view sees it, ready to be cast.
pub struct TileCaster {
    path: Path,
    view: View,
    field: Field,
    bins: Bins,
    centers: PixelCenters,
    thresholds: Thresholds,
    ball_count: usize,
}

impl TileCaster {
    /// Projects the balls and bins them to tiles.
    ///
    /// # Errors
    /// `InvalidInput` for an unusable view, `Cancelled`, `OutOfMemory`.
    pub fn new(path: Path, balls: &Balls<'_>, field: &Field, view: &View, job: &Job) -> Result<Self> {
        view.check()?;
        job.expect((culling::PASSES + bins::PASSES) * balls.len().div_ceil(culling::CHUNK));
        let thresholds = Thresholds::new(field, balls.greatest_weight());
        let bins = Bins::new(Culled::new(path, balls, field, view, job)?, view, job)?;
        Ok(Self {
            path,
            view: *view,
            field: *field,
            bins,
            centers: PixelCenters::new(view),
            thresholds,
            ball_count: balls.len(),
        })
    }

    /// Finds the surface at every `stride`-th pixel along both axes and fills the pixels between with it; with the strides
    /// of [`STRIDES`] one after the other an image appears from coarse to fine.
    ///
    /// # Errors
    /// `InvalidInput` for another stride or an image of another size, `Cancelled`, `OutOfMemory`.
    pub fn cast(&self, stride: usize, image: &Image<'_>, job: &Job) -> Result<()> {
        if !STRIDES.contains(&stride) {
            return Err(Error::InvalidInput(format!("the stride must be one of {STRIDES:?}, not {stride}")));
        }
        if image.size() != self.size() {
            return Err(Error::InvalidInput("the image must have the size of the camera's".into()));
        }
        let tiles = self.bins.columns * self.bins.rows;
        job.expect(tiles);
        (0..tiles).into_par_iter().try_for_each_init(Scratch::default, |scratch, tile| {
            job.advance(1)?;
            self.path.dispatch(TileTask { caster: self, tile, stride, image, scratch })
        })
    }

    /// Width and height of the image.
    pub fn size(&self) -> [usize; 2] {
        [self.view.width, self.view.height]
    }

    /// How many balls were given.
    pub fn ball_count(&self) -> usize {
        self.ball_count
    }

    /// How many balls may be seen.
    pub fn seen(&self) -> usize {
        self.bins.seen()
    }

    /// How many pairs of balls and tiles there are.
    pub fn tile_entries(&self) -> usize {
        self.bins.entry_count()
    }
}

/// What a thread keeps from tile to tile.
#[derive(Default)]
struct Scratch {
    entries: Entries,
    active: ActiveBalls,
    blends: Blends,
}

/// Casts the rays of a tile.
struct TileTask<'a> {
    caster: &'a TileCaster,
    tile: usize,
    stride: usize,
    image: &'a Image<'a>,
    scratch: &'a mut Scratch,
}

impl Task for TileTask<'_> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Result<()> {
        self.scratch.entries.fill(&self.caster.bins, self.tile)?;
        if self.scratch.entries.is_empty() {
            let bins = &self.caster.bins;
            self.image.put_background(bins.corner(self.tile), bins.side);
            return Ok(());
        }
        match polynomial::powers(&self.caster.field.kernel) {
            _ if !S::IS_SPECIALISED => self.cast::<S, 1, 4>(simd),
            (2, 3) => self.cast::<S, 2, 3>(simd),
            (3, 3) => self.cast::<S, 3, 3>(simd),
            (2.., _) => self.cast::<S, 2, 4>(simd),
            _ => self.cast::<S, 1, 4>(simd),
        }
        Ok(())
    }
}

impl TileTask<'_> {
    #[inline(always)]
    fn cast<S: Simd, const LOW: usize, const HIGH: usize>(&mut self, simd: S) {
        let caster = self.caster;
        let kernel = Polynomial::<S, LOW, HIGH>::new(simd, &caster.field.kernel);
        let [left, bottom] = caster.bins.corner(self.tile);
        let side = caster.bins.side;
        let end = [(left + side).min(caster.view.width), (bottom + side).min(caster.view.height)];
        for y in (bottom..end[1]).step_by(CELL * self.stride) {
            for x in (left..end[0]).step_by(CELL * self.stride) {
                let pixels = PacketPixels { x, y, stride: self.stride };
                let rays = Rays::new(simd, &caster.view, &caster.centers, &caster.bins.occlusion, pixels, end);
                let mut surface = Surface::new(self.image, &caster.view, pixels, rays.lanes, &mut self.scratch.blends);
                let mut walk = Walk {
                    simd,
                    kernel,
                    isovalue: caster.field.isovalue as f32,
                    thresholds: &caster.thresholds,
                    bins: &caster.bins,
                    entries: &mut self.scratch.entries,
                    rays: &rays,
                };
                walk.run(&mut self.scratch.active, &mut surface);
                surface.finish();
            }
        }
    }
}

#[cfg(test)]
mod tests;
