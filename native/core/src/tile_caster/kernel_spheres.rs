//! Draws kernel spheres into a coarse depth buffer of cells, sixteen at a time.

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

use super::occlusion::{CELL, Occlusion};
use super::project::{DISTANCE_ERROR, Projected, lowest_bits, set_bits, whole_numbers};
use super::view::View;
use crate::error::Result;
use crate::field::Field;
use crate::memory;
use crate::simd::{LANES, Lanes, Mask, Simd, Vector};

/// Share by which kernel spheres are made smaller, so that the density at the distance found is above the isovalue by more
/// than rounding can hide.
const SHRINK: f32 = 0.998;

/// Entries of the table of kernel radii.
const TABLE_SIZE: usize = 256;

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

/// For each cell, the nearest distance at which all its rays have surely met a kernel sphere that was drawn. Threads draw at
/// the same time; the order does not matter.
pub struct Cells<'a> {
    view: &'a View,
    kernel_radii: KernelRadii,
    pixel_size: [f32; 2],
    pixel_diagonal: f32,
    /// Bits of floats that are not negative.
    distances: Vec<AtomicU32>,
    columns: usize,
    rows: usize,
}

impl<'a> Cells<'a> {
    /// Cells of which nothing is known.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn new(field: &Field, view: &'a View) -> Result<Self> {
        let (columns, rows) = (view.width.div_ceil(CELL), view.height.div_ceil(CELL));
        let mut distances = memory::with_capacity(columns * rows)?;
        distances.resize_with(columns * rows, || AtomicU32::new(f32::INFINITY.to_bits()));
        let pixel_size = view.pixel_size().map(|size| size as f32);
        let pixel_diagonal = pixel_size[0].hypot(pixel_size[1]);
        Ok(Self { view, kernel_radii: KernelRadii::new(field), pixel_size, pixel_diagonal, distances, columns, rows })
    }

    /// What has been drawn.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn occlusion(&self) -> Result<Occlusion> {
        let mut distances = memory::with_capacity(self.distances.len())?;
        distances.extend(self.distances.iter().map(|distance| f32::from_bits(distance.load(Ordering::Relaxed))));
        Ok(Occlusion::new(distances, self.columns, self.rows))
    }

    /// Draws those of the balls in `lanes` whose kernel spheres are large enough to cover the pixels of a cell, and are not
    /// hidden by what is `known` of their middle cells.
    #[inline(always)]
    pub fn draw<S: Simd>(&self, simd: S, balls: &Projected, lanes: u16, known: &Occlusion) {
        let kernel_radius = simd.load(&balls.radius) * self.kernel_radii.shares(simd, &balls.weight);
        let depth = simd.load(&balls.center[2]);
        // World units for each unit of the window at the balls' depth.
        let unit = if self.view.is_perspective { depth } else { simd.splat(1.0) };
        // Between the centres of a cell's outermost pixels.
        let half_diagonal = simd.splat(0.5 * (CELL - 1) as f32 * self.pixel_diagonal);
        let covers = (half_diagonal * unit).lt(kernel_radius);
        let is_ahead = simd.splat(self.view.clip[0] as f32).lt(depth - kernel_radius);
        let drawn = (covers & is_ahead).bits() & lanes;
        if drawn == 0 {
            return;
        }
        let distance = simd.load(&balls.distance) * simd.splat(1.0 + DISTANCE_ERROR);
        let across = self.spans(simd, balls, 0, unit, kernel_radius);
        let up = self.spans(simd, balls, 1, unit, kernel_radius);
        let is_somewhere = across.first.lt(across.end) & up.first.lt(up.end);
        let is_before = (distance - kernel_radius).lt(known.distances_at(simd, across.cell, up.cell));
        let spheres = KernelSpheres {
            across: across.stored(),
            up: up.stored(),
            distance: distance.lanes(),
            radius: kernel_radius.lanes(),
        };
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
        if bits < self.distances[cell].load(Ordering::Relaxed) {
            self.distances[cell].fetch_min(bits, Ordering::Relaxed);
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
