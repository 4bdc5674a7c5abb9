//! Kernel-sphere occlusion culling (Kanamori et al. 2008, section 5.2) with a coarse depth buffer: for each cell of pixels, a
//! distance at which every one of its rays has surely met the surface. What begins farther away cannot be seen.

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use super::project::{DISTANCE_ERROR, Projected, Projector, lowest_bits};
use super::view::View;
use crate::balls::Balls;
use crate::error::Result;
use crate::field::Field;
use crate::job::Job;
use crate::memory;
use crate::simd::{LANES, Lanes, Mask, Path, Simd, Task, Vector};

/// Pixels of a cell's side; a packet of rays is a cell.
pub const CELL: usize = 4;

/// Balls that one thread takes at a time.
pub const CHUNK: usize = 4096;

/// Share by which kernel spheres are made smaller, so that the density at the distance found is above the isovalue by more
/// than rounding can hide.
const SHRINK: f32 = 0.998;

/// Of so many groups of sixteen balls, one is drawn before all others.
const SAMPLE: usize = 16;

/// Entries of the table of kernel radii.
const TABLE_SIZE: usize = 256;

/// Distances along rays (planar for parallel ones), one a cell, infinite where nothing is known.
pub struct Occlusion {
    distances: Vec<f32>,
    columns: usize,
    rows: usize,
}

impl Occlusion {
    /// Finds the distances.
    ///
    /// # Errors
    /// `Cancelled`, `OutOfMemory`.
    pub fn new(path: Path, balls: &Balls<'_>, field: &Field, view: &View, job: &Job) -> Result<Self> {
        let (columns, rows) = (view.width.div_ceil(CELL), view.height.div_ceil(CELL));
        let mut cells = memory::with_capacity(columns * rows)?;
        cells.resize_with(columns * rows, || AtomicU32::new(f32::INFINITY.to_bits()));
        let pixel_size = view.pixel_size().map(|size| size as f32);
        let pass = Pass {
            balls,
            view,
            projector: Projector::new(view),
            kernel_radii: KernelRadii::new(field),
            pixel_size,
            pixel_diagonal: pixel_size[0].hypot(pixel_size[1]),
            cells: &cells,
            known: Vec::new(),
            columns,
            rows,
        };
        // A few from everywhere first: what they hide need not be drawn. What the others hide meanwhile goes with how the
        // threads run, and so must not count: the image would.
        pass.draw_chunks(path, Some(SAMPLE), job)?;
        let known = cells.iter().map(|cell| f32::from_bits(cell.load(Ordering::Relaxed))).collect();
        let open = Pass { known, ..pass }.draw_chunks(path, None, job)?;
        let mut distances: Vec<f32> = cells.into_iter().map(|cell| f32::from_bits(cell.into_inner())).collect();
        for [x_min, x_max, y_min, y_max] in open.into_iter().flatten().map(|rectangle| rectangle.map(usize::from)) {
            for row in y_min..=y_max {
                distances[row * columns + x_min..=row * columns + x_max].fill(f32::INFINITY);
            }
        }
        Ok(Self { distances, columns, rows })
    }

    /// A distance behind which no pixel of a rectangle sees anything; it begins with a cell at `corner`.
    pub fn end(&self, corner: [usize; 2], size: [usize; 2]) -> f32 {
        let cells = |axis: usize, count: usize| corner[axis] / CELL..(corner[axis] + size[axis]).div_ceil(CELL).min(count);
        cells(1, self.rows)
            .flat_map(|row| &self.distances[row * self.columns..][cells(0, self.columns)])
            .fold(0.0, |greatest, distance| distance.max(greatest))
    }
}

/// Kernel radii as shares of influence radii by weight, never too large.
struct KernelRadii {
    isovalue: f32,
    table: [f32; TABLE_SIZE + 1],
}

impl KernelRadii {
    fn new(field: &Field) -> Self {
        // The share falls as the isovalue by the weight grows: an entry holds the least share of its part.
        let share = |part: usize| match (part + 1) as f64 / TABLE_SIZE as f64 {
            ratio if ratio <= 1.0 => field.kernel_radius_share(field.isovalue / ratio) as f32 * SHRINK,
            _ => 0.0,
        };
        Self { isovalue: field.isovalue as f32, table: std::array::from_fn(share) }
    }

    /// 0 where a ball of such a weight has no surface alone.
    #[inline(always)]
    fn shares<S: Simd>(&self, simd: S, weights: &Lanes) -> S::Vector {
        let (zero, size, weight) = (simd.splat(0.0), simd.splat(TABLE_SIZE as f32), simd.load(weights));
        let part = (simd.splat(self.isovalue) / weight * size).select(zero.lt(weight), size).min(size);
        let parts = whole_numbers(simd, part.floor());
        let mut shares = Lanes::splat(0.0);
        for (share, part) in shares.0.iter_mut().zip(parts) {
            *share = self.table[part.min(TABLE_SIZE)];
        }
        simd.load(&shares)
    }
}

/// What all chunks share.
struct Pass<'a> {
    balls: &'a Balls<'a>,
    view: &'a View,
    projector: Projector,
    kernel_radii: KernelRadii,
    pixel_size: [f32; 2],
    pixel_diagonal: f32,
    cells: &'a [AtomicU32],
    /// What the cells held before the pass began; empty for the first.
    known: Vec<f32>,
    columns: usize,
    rows: usize,
}

/// Draws the kernel spheres of a chunk; gives the rectangles of cells in which kernel spheres prove nothing.
struct ChunkTask<'a> {
    pass: &'a Pass<'a>,
    chunk: usize,
    /// Of so many groups of sixteen balls, one is drawn.
    step: usize,
}

impl Task for ChunkTask<'_> {
    type Output = Vec<[u16; 4]>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec<[u16; 4]> {
        let pass = self.pass;
        let mut open = Vec::new();
        let end = pass.balls.len().min((self.chunk + 1) * CHUNK);
        for first in (self.chunk * CHUNK..end).step_by(self.step * LANES) {
            let weights = pass.weights(first);
            let projected = pass.projector.project(simd, pass.balls, first);
            let count = (end - first).min(LANES);
            pass.draw(simd, &projected, &weights, lowest_bits(count));
            pass.find_open(simd, &projected, &weights, count, &mut open);
        }
        open
    }
}

/// The numbers of the bits that are set, the lowest first.
#[inline(always)]
pub fn set_bits(bits: u16) -> impl Iterator<Item = usize> {
    let mut rest = bits;
    std::iter::from_fn(move || {
        let lane = (rest != 0).then(|| rest.trailing_zeros() as usize)?;
        rest &= rest - 1;
        Some(lane)
    })
}

/// Whole numbers from 0 to 2^23 - 1 as integers.
#[inline(always)]
pub fn whole_numbers<S: Simd>(simd: S, numbers: S::Vector) -> [usize; LANES] {
    // Above 2^23 the last bits of a float are the whole number.
    let shifted = (numbers + simd.splat((1 << 23) as f32)).lanes();
    shifted.0.map(|number| (number.to_bits() & ((1 << 23) - 1)) as usize)
}

impl Pass<'_> {
    /// Draws all balls, or a group of sixteen of every `sample` groups.
    fn draw_chunks(&self, path: Path, sample: Option<usize>, job: &Job) -> Result<Vec<Vec<[u16; 4]>>> {
        let draw = |chunk| {
            job.advance(1)?;
            Ok(path.dispatch(ChunkTask { pass: self, chunk, step: sample.unwrap_or(1) }))
        };
        (0..self.balls.len().div_ceil(CHUNK)).into_par_iter().map(draw).collect()
    }

    #[inline(always)]
    fn weights(&self, first: usize) -> Lanes {
        let last = self.balls.len() - 1;
        Lanes(std::array::from_fn(|lane| self.balls.weights()[(first + lane).min(last)]))
    }

    /// Draws those kernel spheres that are large enough to cover the pixels of a cell, and not hidden by others.
    #[inline(always)]
    fn draw<S: Simd>(&self, simd: S, balls: &Projected, weights: &Lanes, counted: u16) {
        let kernel_radius = simd.load(&balls.radius) * self.kernel_radii.shares(simd, weights);
        let depth = simd.load(&balls.center[2]);
        // World units for each unit of the window at the balls' depth.
        let unit = if self.view.is_perspective { depth } else { simd.splat(1.0) };
        // Between the centres of a cell's outermost pixels.
        let half_diagonal = simd.splat(0.5 * (CELL - 1) as f32 * self.pixel_diagonal);
        let covers = (half_diagonal * unit).lt(kernel_radius);
        let is_ahead = simd.splat(self.view.clip[0] as f32).lt(depth - kernel_radius);
        let drawn = (covers & is_ahead).bits() & counted;
        if drawn == 0 {
            return;
        }
        let distance = simd.load(&balls.distance) * simd.splat(1.0 + DISTANCE_ERROR);
        let across = self.spans(simd, balls, 0, unit, kernel_radius);
        let up = self.spans(simd, balls, 1, unit, kernel_radius);
        let is_somewhere = across.first.lt(across.end) & up.first.lt(up.end);
        let spheres = KernelSpheres {
            across: across.stored(),
            up: up.stored(),
            distance: distance.lanes(),
            radius: kernel_radius.lanes(),
        };
        let is_before = (distance - kernel_radius).lt(self.known_at(simd, across.cell, up.cell));
        for lane in set_bits(drawn & (is_somewhere & is_before).bits()) {
            self.draw_one(simd, &spheres, lane);
        }
    }

    /// The cells along an axis that kernel spheres may cover.
    #[inline(always)]
    fn spans<S: Simd>(
        &self,
        simd: S,
        balls: &Projected,
        axis: usize,
        unit: S::Vector,
        kernel_radius: S::Vector,
    ) -> Spans<S::Vector> {
        let (zero, half, per_cell) = (simd.splat(0.0), simd.splat(0.5), simd.splat(1.0 / CELL as f32));
        let count = simd.splat([self.columns, self.rows][axis] as f32);
        let pixel = unit * simd.splat(self.pixel_size[axis]);
        let from_edge = simd.load(&balls.center[axis]) - simd.splat(self.view.window[2 * axis] as f32) * unit;
        let (middle, radius) = (from_edge / pixel, kernel_radius / pixel);
        Spans {
            middle,
            pixel,
            cell: (middle * per_cell).floor().max(zero).min(count - simd.splat(1.0)),
            // Where this is whole, a cell is left out, which only hides less.
            first: ((middle - radius - half) * per_cell + simd.splat(1.0)).floor().max(zero),
            end: ((middle + radius + half) * per_cell).floor().max(zero).min(count),
        }
    }

    /// What is known of cells; kernel spheres that begin behind what is known of their middle cell would change little.
    #[inline(always)]
    fn known_at<S: Simd>(&self, simd: S, column: S::Vector, row: S::Vector) -> S::Vector {
        let mut known = Lanes::splat(f32::INFINITY);
        if !self.known.is_empty() {
            let cells = whole_numbers(simd, row.mul_add(simd.splat(self.columns as f32), column));
            for (known, cell) in known.0.iter_mut().zip(cells) {
                *known = self.known.get(cell).copied().unwrap_or(f32::INFINITY);
            }
        }
        simd.load(&known)
    }

    /// Lowers the distances of the cells whose every ray meets the kernel sphere.
    ///
    /// A ray that passes the centre at the perpendicular distance p meets the sphere at `tc - sqrt(r^2 - p^2)` and
    /// `tc <= |c|`. In the plane of the centre's depth a pixel is at least p away from the centre.
    #[inline(always)]
    fn draw_one<S: Simd>(&self, simd: S, spheres: &KernelSpheres, lane: usize) {
        let (radius, distance) = (spheres.radius.0[lane], simd.splat(spheres.distance.0[lane]));
        let (across, up) = (spheres.across.span(lane), spheres.up.span(lane));
        for row in up.cells.clone() {
            let rest_2 = simd.splat(radius * radius) - up.farthest_2(simd, simd.splat(row as f32));
            for first in across.cells.clone().step_by(LANES) {
                let half_chord_2 = rest_2 - across.farthest_2(simd, simd.splat(first as f32) + simd.load(&COUNTING));
                let distances = (distance - half_chord_2.sqrt()).lanes();
                let covered = simd.splat(0.0).lt(half_chord_2).bits() & lowest_bits(across.cells.end - first);
                for column in set_bits(covered) {
                    self.lower(row * self.columns + first + column, distances.0[column]);
                }
            }
        }
    }

    #[inline(always)]
    fn lower(&self, cell: usize, distance: f32) {
        // The kernel sphere lies before the eye, so the distance is positive, and positive floats are ordered as their
        // bits. Reading first spares the costly write where another sphere is nearer.
        let bits = distance.max(0.0).to_bits();
        if bits < self.cells[cell].load(Ordering::Relaxed) {
            self.cells[cell].fetch_min(bits, Ordering::Relaxed);
        }
    }

    /// Kernel spheres hide nothing where a ball carves, and where a ray may start inside the fluid.
    #[inline(always)]
    fn find_open<S: Simd>(&self, simd: S, balls: &Projected, weights: &Lanes, count: usize, open: &mut Vec<[u16; 4]>) {
        let clip_start = simd.splat(self.view.clip[0] as f32 * (1.0 + DISTANCE_ERROR));
        let straddles = (simd.load(&balls.center[2]) - simd.load(&balls.radius)).le(clip_start);
        let carves = simd.load(weights).lt(simd.splat(0.0));
        let opening = (straddles | carves).bits();
        if opening == 0 {
            return;
        }
        let (rectangles, seen) = self.projector.rectangles(simd, balls, count);
        for lane in set_bits(opening & seen) {
            let corners = [&rectangles.x_min, &rectangles.x_max, &rectangles.y_min, &rectangles.y_max];
            open.push(corners.map(|corner| corner.0[lane] as u16 / CELL as u16));
        }
    }
}

/// Sixteen kernel spheres in the image.
struct KernelSpheres {
    across: Spans<Lanes>,
    up: Spans<Lanes>,
    /// Of the centres, along rays.
    distance: Lanes,
    radius: Lanes,
}

/// What sixteen kernel spheres cover along an axis.
struct Spans<T> {
    /// The centres, pixels.
    middle: T,
    /// World units of a pixel at the centres' depth.
    pixel: T,
    /// The cells of the centres.
    cell: T,
    /// The first cell whose outermost pixel centres may both be covered, and the one behind the last.
    first: T,
    end: T,
}

impl<V: Vector> Spans<V> {
    #[inline(always)]
    fn stored(&self) -> Spans<Lanes> {
        let Self { middle, pixel, cell, first, end } = self;
        Spans { middle: middle.lanes(), pixel: pixel.lanes(), cell: cell.lanes(), first: first.lanes(), end: end.lanes() }
    }
}

impl Spans<Lanes> {
    #[inline(always)]
    fn span(&self, lane: usize) -> Span {
        let cells = self.first.0[lane] as usize..self.end.0[lane] as usize;
        Span { middle: self.middle.0[lane], size: self.pixel.0[lane], cells }
    }
}

/// 0, 1, 2 ...
const COUNTING: Lanes = {
    let mut lanes = Lanes([0.0; LANES]);
    let mut lane = 0;
    while lane < LANES {
        lanes.0[lane] = lane as f32;
        lane += 1;
    }
    lanes
};

/// What one of them covers along an axis.
struct Span {
    middle: f32,
    size: f32,
    cells: Range<usize>,
}

impl Span {
    /// Squared distances from the centre to the farthest pixel centres of cells, world units.
    #[inline(always)]
    fn farthest_2<S: Simd>(&self, simd: S, cells: S::Vector) -> S::Vector {
        let (side, half_side) = (simd.splat(CELL as f32), simd.splat(0.5 * CELL as f32));
        let to_middle = cells.mul_add(side, half_side) - simd.splat(self.middle);
        let to_farthest = to_middle.max(simd.splat(0.0) - to_middle) + simd.splat(0.5 * (CELL - 1) as f32);
        let farthest = to_farthest * simd.splat(self.size);
        farthest * farthest
    }
}
