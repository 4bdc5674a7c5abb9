//! Kernel-sphere occlusion culling (Kanamori et al. 2008, section 5.2) with a coarse depth buffer: for each cell of pixels, a
//! distance at which every one of its rays has surely met the surface. What begins farther away cannot be seen.

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

    /// 0 where a ball of this weight has no surface alone.
    #[inline(always)]
    fn share(&self, weight: f32) -> f32 {
        let part = self.isovalue / weight * TABLE_SIZE as f32;
        if weight > 0.0 && part < TABLE_SIZE as f32 { self.table[part as usize] } else { 0.0 }
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
        let kernel_radii = Lanes(std::array::from_fn(|lane| balls.radius.0[lane] * self.kernel_radii.share(weights.0[lane])));
        let (kernel_radius, depth) = (simd.load(&kernel_radii), simd.load(&balls.center[2]));
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
        let spheres = KernelSpheres {
            middle: std::array::from_fn(|axis| {
                let from_edge = simd.load(&balls.center[axis]) / unit - simd.splat(self.view.window[2 * axis] as f32);
                (from_edge / simd.splat(self.pixel_size[axis])).lanes()
            }),
            pixel: self.pixel_size.map(|size| (unit * simd.splat(size)).lanes()),
            distance: distance.lanes(),
            front: (distance - kernel_radius).lanes(),
            radius: kernel_radii,
        };
        for lane in set_bits(drawn & self.not_hidden(simd, &spheres)) {
            self.draw_one(&spheres, lane);
        }
    }

    /// A bit for each kernel sphere that begins before what is known of its middle cell; the others would change little.
    #[inline(always)]
    fn not_hidden<S: Simd>(&self, simd: S, spheres: &KernelSpheres) -> u16 {
        let cell = |axis: usize, count: usize| {
            let place = simd.load(&spheres.middle[axis]) * simd.splat(1.0 / CELL as f32);
            place.max(simd.splat(0.0)).min(simd.splat((count - 1) as f32)).floor()
        };
        let cells = whole_numbers(simd, cell(1, self.rows).mul_add(simd.splat(self.columns as f32), cell(0, self.columns)));
        let known = Lanes(cells.map(|cell| self.known.get(cell).copied().unwrap_or(f32::INFINITY)));
        simd.load(&spheres.front).lt(simd.load(&known)).bits()
    }

    /// Lowers the distances of the cells whose every ray meets the kernel sphere.
    ///
    /// A ray that passes the centre at the perpendicular distance p meets the sphere at `tc - sqrt(r^2 - p^2)` and
    /// `tc <= |c|`. In the plane of the centre's depth a pixel is at least p away from the centre.
    #[inline(always)]
    fn draw_one(&self, spheres: &KernelSpheres, lane: usize) {
        let (radius, distance) = (spheres.radius.0[lane], spheres.distance.0[lane]);
        let [across, up] = [(0, self.columns), (1, self.rows)]
            .map(|(axis, count)| Span::new(spheres.middle[axis].0[lane], radius, spheres.pixel[axis].0[lane], count));
        for row in up.first..=up.last {
            let rest_2 = radius * radius - up.farthest_2(row);
            for column in across.first..=across.last {
                let half_chord_2 = rest_2 - across.farthest_2(column);
                if half_chord_2 > 0.0 {
                    self.lower(row * self.columns + column, distance - half_chord_2.sqrt());
                }
            }
        }
    }

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
    /// x and y of the centres, pixels.
    middle: [Lanes; 2],
    /// Width and height of a pixel at the centres' depth, world units.
    pixel: [Lanes; 2],
    /// Of the centres, along rays.
    distance: Lanes,
    /// Distance before which no ray meets them.
    front: Lanes,
    radius: Lanes,
}

/// The cells along an axis that a kernel sphere may cover.
struct Span {
    /// The centre, pixels.
    middle: f32,
    /// World units of a pixel at the centre's depth.
    size: f32,
    first: usize,
    last: usize,
}

impl Span {
    fn new(middle: f32, kernel_radius: f32, size: f32, count: usize) -> Self {
        let cell = |pixel: f32| ((pixel / CELL as f32).max(0.0) as usize).min(count - 1);
        let radius = kernel_radius / size;
        Self { middle, size, first: cell(middle - radius), last: cell(middle + radius) }
    }

    /// Squared distance from the centre to the farthest pixel centre of a cell, world units.
    fn farthest_2(&self, cell: usize) -> f32 {
        let first = (cell * CELL) as f32 + 0.5;
        let farthest = (self.middle - first).abs().max((self.middle - first - (CELL - 1) as f32).abs()) * self.size;
        farthest * farthest
    }
}
