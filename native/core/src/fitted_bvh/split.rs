//! Where a node is divided: the surface area heuristic for metaballs (Gourmel et al. 2010, section 5.1.1).

use crate::simd::Simd;

use super::bounds::Bounds;
use super::construction::Cell;
use super::members::{Members, Span};

/// A plane across an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    pub axis: usize,
    pub at: f32,
}

/// Where a node is cut along an axis: at one of these shares of its edge.
const BINS: usize = 8;
const PLANES: usize = BINS - 1;

/// Nodes that more balls touch are cut in the middle of their longest edge: the choice matters little there (section 7).
const BINNED: usize = 512;

/// What one more leaf costs a ray that meets it, in pairs of balls: as measured, a little for speed in dense fluids and much
/// for memory everywhere.
const TRAVERSAL_COST: f32 = 1000.0;

/// What a leaf with so many balls costs a ray that meets it, in pairs of balls.
fn leaf_cost(count: u32) -> f32 {
    let count = count as f32;
    count * count
}

/// The best plane to cut the box of a node, none where it is best a leaf.
#[inline(always)]
pub fn plane_through<S: Simd>(simd: S, members: &Members, cell: &Cell) -> Option<Plane> {
    if cell.span.count > BINNED {
        return middle(&cell.bounds);
    }
    let mut best = None;
    let mut least = leaf_cost(cell.span.count as u32);
    let size = cell.bounds.size();
    let per_area = 1.0 / cell.bounds.half_area();
    for axis in 0..3 {
        // Half the areas of the parts grow with their lengths.
        let (u, v) = (size[(axis + 1) % 3], size[(axis + 2) % 3]);
        let (side, end) = (size[axis] * (u + v) * per_area, u * v * per_area);
        let planes = planes_across(&cell.bounds, axis);
        let counts = members.count_at_planes(simd, cell.span, axis, &planes);
        for (index, (at, counts)) in planes.into_iter().zip(counts).enumerate() {
            let share = (index + 1) as f32 / BINS as f32;
            let left = (share * side + end) * leaf_cost(counts[0]);
            let right = ((1.0 - share) * side + end) * leaf_cost(counts[1]);
            let cost = TRAVERSAL_COST + left + right;
            if cost < least && cell.bounds.low[axis] < at && at < cell.bounds.high[axis] {
                (best, least) = (Some(Plane { axis, at }), cost);
            }
        }
    }
    best
}

fn planes_across(bounds: &Bounds, axis: usize) -> [f32; PLANES] {
    let (low, step) = (bounds.low[axis], bounds.size()[axis] / BINS as f32);
    std::array::from_fn(|index| low + (index + 1) as f32 * step)
}

/// The middle of the longest edge, if it can be halved.
fn middle(bounds: &Bounds) -> Option<Plane> {
    let axis = bounds.longest_axis();
    let at = 0.5 * (bounds.low[axis] + bounds.high[axis]);
    (bounds.low[axis] < at && at < bounds.high[axis]).then_some(Plane { axis, at })
}

/// Balls whose centres lie between two planes.
#[derive(Clone, Copy)]
struct Bin {
    count: u32,
    bounds: Bounds,
}

impl Bin {
    const EMPTY: Self = Self { count: 0, bounds: Bounds::EMPTY };

    fn with(self, other: Self) -> Self {
        Self { count: self.count + other.count, bounds: self.bounds.union(&other.bounds) }
    }

    fn cost(&self) -> f32 {
        self.bounds.half_area() * leaf_cost(self.count)
    }
}

/// The best plane to part balls by their centres, none where they are best a leaf (Wald 2007, binning).
pub fn plane_between_centers(members: &Members, own: Span) -> Option<Plane> {
    let centers = (0..own.count).fold(Bounds::EMPTY, |bounds, index| {
        let center = members.get(own, index).center;
        bounds.union(&Bounds { low: center, high: center })
    });
    if own.count > BINNED {
        return middle(&centers);
    }
    let mut best = None;
    let mut least = f32::INFINITY;
    for axis in (0..3).filter(|axis| centers.size()[*axis] > 0.0) {
        let bins = bins_across(members, own, &centers, axis);
        let whole = bins.iter().fold(Bin::EMPTY, |sum, bin| sum.with(*bin));
        least = least.min(leaf_cost(whole.count));
        for (index, at) in planes_across(&centers, axis).into_iter().enumerate() {
            let [left, right] =
                [&bins[..=index], &bins[index + 1..]].map(|side| side.iter().fold(Bin::EMPTY, |sum, bin| sum.with(*bin)));
            let cost = TRAVERSAL_COST + (left.cost() + right.cost()) / whole.bounds.half_area();
            if cost < least && left.count > 0 && right.count > 0 {
                (best, least) = (Some(Plane { axis, at }), cost);
            }
        }
    }
    best
}

fn bins_across(members: &Members, own: Span, centers: &Bounds, axis: usize) -> [Bin; BINS] {
    let planes = planes_across(centers, axis);
    let mut bins = [Bin::EMPTY; BINS];
    for ball in (0..own.count).map(|index| members.get(own, index)) {
        let bin = planes.iter().filter(|plane| ball.center[axis] >= **plane).count();
        let bounds = Bounds { low: ball.center.map(|c| c - ball.radius), high: ball.center.map(|c| c + ball.radius) };
        bins[bin] = bins[bin].with(Bin { count: 1, bounds });
    }
    bins
}
