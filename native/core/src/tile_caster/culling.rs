//! Which balls may be seen: all are projected once, and those that surely are outside the image or hidden are left out.
//!
//! The kernel spheres of a few balls from everywhere are drawn first; what lies behind these is left out at once, the rest is
//! drawn as well and kept.

use rayon::prelude::*;

use super::kernel_spheres::Cells;
use super::occlusion::{CELL, Occlusion, Pyramid};
use super::project::{DISTANCE_ERROR, Projected, Projector, Rectangles, lowest_bits, set_bits};
use super::view::View;
use crate::balls::Balls;
use crate::error::Result;
use crate::field::Field;
use crate::job::Job;
use crate::memory::{self, Spares};
use crate::simd::{LANES, Mask, Path, Simd, Task, Vector};

/// Balls that one thread takes at a time.
pub const CHUNK: usize = 4096;

/// Of so many groups of sixteen balls, one is drawn before all others; one number after the other.
const SAMPLES: [usize; 2] = [32, 4];

/// How often all chunks are gone through.
pub const PASSES: usize = SAMPLES.len() + 1;

/// A ball that may be seen, in camera space.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct SeenBall {
    /// x, y, planar depth.
    pub center: [f32; 3],
    /// Influence radius R.
    pub radius: f32,
    /// q.
    pub weight: f32,
    /// Which of the given balls it is.
    pub index: u32,
    /// First and last column of pixels that the influence sphere may cover.
    pub columns: [u16; 2],
    /// First and last row of pixels.
    pub rows: [u16; 2],
}

/// The balls of a chunk that may be seen.
#[derive(Default)]
pub struct Chunk {
    pub balls: Vec<SeenBall>,
    /// Distances before which no ray meets their influence spheres.
    pub fronts: Vec<f32>,
    /// The rectangles of cells (first and last column, first and last row) in which kernel spheres prove nothing.
    open: Vec<[u16; 4]>,
}

/// Memory for the chunks.
static BALLS: Spares<SeenBall> = Spares::new();
static FRONTS: Spares<f32> = Spares::new();

impl Chunk {
    /// Takes memory that was used before.
    fn begin(&mut self) {
        (self.balls, self.fronts) = (BALLS.take(), FRONTS.take());
    }

    /// Keeps the balls for which `is_kept`, given a ball and its front.
    #[inline(always)]
    pub fn retain(&mut self, mut is_kept: impl FnMut(&SeenBall, f32) -> bool) {
        let mut count = 0;
        for place in 0..self.balls.len() {
            let (ball, front) = (self.balls[place], self.fronts[place]);
            if is_kept(&ball, front) {
                (self.balls[count], self.fronts[count]) = (ball, front);
                count += 1;
            }
        }
        self.balls.truncate(count);
        self.fronts.truncate(count);
    }
}

impl Drop for Chunk {
    fn drop(&mut self) {
        BALLS.give(std::mem::take(&mut self.balls));
        FRONTS.give(std::mem::take(&mut self.fronts));
    }
}

/// What may be seen, and what is hidden.
pub struct Culled {
    /// By chunk of the given balls.
    pub chunks: Vec<Chunk>,
    pub occlusion: Occlusion,
}

impl Culled {
    /// Looks at all balls.
    ///
    /// # Errors
    /// `Cancelled`, `OutOfMemory`.
    pub fn new(path: Path, balls: &Balls<'_>, field: &Field, view: &View, job: &Job) -> Result<Self> {
        let search = Search { path, balls, projector: Projector::new(view), clip_start: view.clip[0] as f32, job };
        let cells = Cells::new(field, view)?;
        // What other balls hide meanwhile goes with how the threads run, and so must not count: the image would.
        let mut known = cells.occlusion()?;
        for step in SAMPLES {
            search.draw_sample(&cells, &known, step)?;
            known = cells.occlusion()?;
        }
        let mut known = Hidden::new(known)?;
        let mut chunks = search.keep(&known, Some(&cells))?;
        let mut occlusion = cells.occlusion()?;
        occlusion.open(open_of(&chunks));
        if known.cells.open(open_of(&chunks)) {
            // Some balls were left out behind what hides nothing.
            known = Hidden::new(occlusion)?;
            job.expect(search.chunk_count());
            chunks = search.keep(&known, None)?;
            occlusion = known.cells;
        }
        Ok(Self { chunks, occlusion })
    }
}

/// The rectangles of cells in which kernel spheres prove nothing.
fn open_of(chunks: &[Chunk]) -> impl Iterator<Item = [u16; 4]> {
    chunks.iter().flat_map(|chunk| chunk.open.iter().copied())
}

/// What all chunks share.
struct Search<'a> {
    path: Path,
    balls: &'a Balls<'a>,
    projector: Projector,
    clip_start: f32,
    job: &'a Job,
}

impl Search<'_> {
    /// Draws the kernel spheres of every `step`-th group of balls, as far as they are not behind what is `known`.
    fn draw_sample(&self, cells: &Cells<'_>, known: &Occlusion, step: usize) -> Result<()> {
        (0..self.chunk_count()).into_par_iter().try_for_each(|number| {
            self.job.advance(1)?;
            self.path.dispatch(SampleTask { search: self, cells, known, number, step });
            Ok(())
        })
    }

    /// Leaves out what is outside the image or `hidden`, and draws the kernel spheres of the rest.
    fn keep(&self, hidden: &Hidden, cells: Option<&Cells<'_>>) -> Result<Vec<Chunk>> {
        let count = self.chunk_count();
        let mut chunks = memory::with_capacity(count)?;
        chunks.resize_with(count, Chunk::default);
        chunks.par_iter_mut().enumerate().try_for_each(|(number, chunk)| {
            self.job.advance(1)?;
            self.path.dispatch(KeepTask { search: self, hidden, cells, number, chunk })
        })?;
        Ok(chunks)
    }

    fn chunk_count(&self) -> usize {
        self.balls.len().div_ceil(CHUNK)
    }

    /// The first balls of each group of sixteen of a chunk, of every `step`-th group, and how many there are.
    #[inline(always)]
    fn groups(&self, chunk: usize, step: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let end = self.balls.len().min((chunk + 1) * CHUNK);
        (chunk * CHUNK..end).step_by(step * LANES).map(move |first| (first, (end - first).min(LANES)))
    }

    /// A bit for each ball where kernel spheres hide nothing: it carves, or a ray may start in the fluid.
    #[inline(always)]
    fn opening<S: Simd>(&self, simd: S, balls: &Projected) -> u16 {
        let clip_start = simd.splat(self.clip_start * (1.0 + DISTANCE_ERROR));
        let straddles = (simd.load(&balls.center[2]) - simd.load(&balls.radius)).le(clip_start);
        let carves = simd.load(&balls.weight).lt(simd.splat(0.0));
        (straddles | carves).bits()
    }
}

/// Draws the kernel spheres of a few balls of a chunk.
struct SampleTask<'a> {
    search: &'a Search<'a>,
    cells: &'a Cells<'a>,
    known: &'a Occlusion,
    number: usize,
    step: usize,
}

impl Task for SampleTask<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Search { balls, projector, .. } = self.search;
        for (first, count) in self.search.groups(self.number, self.step) {
            let projected = projector.project(simd, balls, first);
            self.cells.draw(simd, &projected, lowest_bits(count), self.known);
        }
    }
}

/// Finds the balls of a chunk that may be seen, and draws their kernel spheres.
struct KeepTask<'a> {
    search: &'a Search<'a>,
    hidden: &'a Hidden,
    cells: Option<&'a Cells<'a>>,
    number: usize,
    chunk: &'a mut Chunk,
}

impl Task for KeepTask<'_> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Result<()> {
        let Search { balls, projector, .. } = self.search;
        let kept = self.chunk;
        kept.begin();
        for (first, count) in self.search.groups(self.number, 1) {
            let projected = projector.project(simd, balls, first);
            let (rectangles, seen) = projector.rectangles(simd, &projected, count);
            for lane in set_bits(seen & self.search.opening(simd, &projected)) {
                memory::reserve(&mut kept.open, 1)?;
                kept.open.push(rectangles.pixels(lane).map(|pixel| pixel / CELL as u16));
            }
            if seen == 0 {
                continue;
            }
            let front = projected.front(simd);
            let visible = seen & !self.hidden.pyramid.ends(simd, &rectangles, seen).le(front).bits();
            if visible == 0 {
                continue;
            }
            if let Some(cells) = self.cells {
                cells.draw(simd, &projected, visible, &self.hidden.cells);
            }
            memory::reserve(&mut kept.balls, LANES)?;
            memory::reserve(&mut kept.fronts, LANES)?;
            kept.balls.extend(set_bits(visible).map(|lane| seen_ball(&projected, &rectangles, first, lane)));
            let mut fronts = [0.0; LANES];
            front.compress(visible, &mut fronts);
            kept.fronts.extend_from_slice(&fronts[..visible.count_ones() as usize]);
        }
        Ok(())
    }
}

#[inline(always)]
fn seen_ball(balls: &Projected, rectangles: &Rectangles, first: usize, lane: usize) -> SeenBall {
    let [x_min, x_max, y_min, y_max] = rectangles.pixels(lane);
    SeenBall {
        center: balls.center.each_ref().map(|axis| axis.0[lane]),
        radius: balls.radius.0[lane],
        weight: balls.weight.0[lane],
        index: (first + lane) as u32,
        columns: [x_min, x_max],
        rows: [y_min, y_max],
    }
}

/// What is hidden.
struct Hidden {
    cells: Occlusion,
    pyramid: Pyramid,
}

impl Hidden {
    fn new(cells: Occlusion) -> Result<Self> {
        Ok(Self { pyramid: Pyramid::new(&cells)?, cells })
    }
}
