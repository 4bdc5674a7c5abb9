//! The balls that reach into a node while the tree is built: columns of numbers, sixteen of which are tested at once.

use crate::error::Result;
use crate::memory;
use crate::simd::{LANES, Mask, Simd, Vector};

use super::bounds::Bounds;
use super::density::Density;

const COLUMNS: usize = 6;

/// Parts of each edge of a box that is tested for lying within the fluid.
const QUARTERS: usize = 4;

/// Parts of a box that is halved on every axis.
pub const EIGHTHS: usize = 8;

/// How often the balls of a node are copied to nodes below it at a time, about; there is room for more where it is needed.
const ROOM_FOR_DESCENDANTS: usize = 3;

/// Keeps a ball that touches a box in spite of rounding.
const TOUCH: f32 = 1.0 + 8.0 * f32::EPSILON;

/// Balls of several nodes one after another, of which the last are dropped first: centres in scene coordinates, influence
/// radii, weights, and ids as bits of a float.
#[derive(Debug, Default)]
pub struct Members {
    columns: [Vec<f32>; COLUMNS],
    end: usize,
}

/// The balls of one node in [`Members`]. Behind the last there is room for a whole vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    start: usize,
    /// How many balls.
    pub count: usize,
}

/// One ball.
#[derive(Clone, Copy, Debug)]
pub struct Member {
    /// In scene coordinates.
    pub center: [f32; 3],
    /// R.
    pub radius: f32,
    /// q.
    pub weight: f32,
    /// Its number in the caller's arrays.
    pub id: u32,
}

/// Sixteen balls; the lanes behind the last of a span are not in `valid`.
#[derive(Clone, Copy)]
pub struct Sixteen<S: Simd> {
    pub center: [S::Vector; 3],
    pub radius: S::Vector,
    pub weight: S::Vector,
    pub valid: S::Mask,
}

/// A test of balls.
pub trait Test<S: Simd> {
    /// Which of the balls pass.
    fn passes(&self, balls: &Sixteen<S>) -> S::Mask;
}

// Closures that hold vector instructions are not always inlined, hence the loops.

/// Passes balls whose influence sphere touches a box.
#[derive(Clone, Copy)]
pub struct Touches<S: Simd>(pub BoxLanes<S>);

impl<S: Simd> Test<S> for Touches<S> {
    #[inline(always)]
    fn passes(&self, balls: &Sixteen<S>) -> S::Mask {
        let reach = balls.radius * balls.radius * self.0.touch;
        self.0.nearest_squared(&balls.center).le(reach)
    }
}

/// Passes balls whose centre is below a plane.
#[derive(Clone, Copy)]
pub struct CentreBelow<S: Simd> {
    pub axis: usize,
    pub plane: S::Vector,
}

impl<S: Simd> Test<S> for CentreBelow<S> {
    #[inline(always)]
    fn passes(&self, balls: &Sixteen<S>) -> S::Mask {
        balls.center[self.axis].lt(self.plane)
    }
}

/// Passes what another test does not.
#[derive(Clone, Copy)]
pub struct Fails<T>(pub T);

impl<S: Simd, T: Test<S>> Test<S> for &T {
    #[inline(always)]
    fn passes(&self, balls: &Sixteen<S>) -> S::Mask {
        (*self).passes(balls)
    }
}

impl<S: Simd, T: Test<S>> Test<S> for Fails<T> {
    #[inline(always)]
    fn passes(&self, balls: &Sixteen<S>) -> S::Mask {
        !self.0.passes(balls)
    }
}

/// Passes what two tests pass.
#[derive(Clone, Copy)]
pub struct And<A, B>(pub A, pub B);

impl<S: Simd, A: Test<S>, B: Test<S>> Test<S> for And<A, B> {
    #[inline(always)]
    fn passes(&self, balls: &Sixteen<S>) -> S::Mask {
        self.0.passes(balls) & self.1.passes(balls)
    }
}

/// A box in registers.
#[derive(Clone, Copy)]
pub struct BoxLanes<S: Simd> {
    low: [S::Vector; 3],
    high: [S::Vector; 3],
    zero: S::Vector,
    touch: S::Vector,
}

impl<S: Simd> BoxLanes<S> {
    #[inline(always)]
    pub fn new(simd: S, bounds: &Bounds) -> Self {
        Self {
            low: splat_point(simd, bounds.low),
            high: splat_point(simd, bounds.high),
            zero: simd.splat(0.0),
            touch: simd.splat(TOUCH),
        }
    }

    /// Squares of the distances of points to the nearest points of the box.
    #[inline(always)]
    pub fn nearest_squared(&self, points: &[S::Vector; 3]) -> S::Vector {
        let mut away = *points;
        for axis in 0..3 {
            away[axis] = (self.low[axis] - points[axis]).max(points[axis] - self.high[axis]).max(self.zero);
        }
        length_squared(away)
    }
}

#[inline(always)]
pub fn splat_point<S: Simd>(simd: S, point: [f32; 3]) -> [S::Vector; 3] {
    [simd.splat(point[0]), simd.splat(point[1]), simd.splat(point[2])]
}

#[inline(always)]
pub fn length_squared<V: Vector>([x, y, z]: [V; 3]) -> V {
    x.mul_add(x, y.mul_add(y, z * z))
}

impl Members {
    /// Balls and the span of all of them.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn new(balls: impl ExactSizeIterator<Item = Member>) -> Result<(Self, Span)> {
        let span = Span { start: 0, count: balls.len() };
        let mut members = Self::default();
        members.make_room(span.count)?;
        for (index, ball) in balls.enumerate() {
            let [x, y, z] = ball.center;
            let row = [x, y, z, ball.radius, ball.weight, f32::from_bits(ball.id)];
            for (column, value) in members.columns.iter_mut().zip(row) {
                column[index] = value;
            }
        }
        members.end = span.count;
        Ok((members, span))
    }

    /// Copies of the balls of a span, on their own.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn copied(&self, span: Span) -> Result<(Self, Span)> {
        let mut members = Self { end: span.count, ..Self::default() };
        for (target, source) in members.columns.iter_mut().zip(&self.columns) {
            memory::reserve(target, ROOM_FOR_DESCENDANTS * span.count + LANES)?;
            target.extend_from_slice(&source[span.start..][..span.count]);
            target.resize(span.count + LANES, 0.0);
        }
        Ok((members, Span { start: 0, ..span }))
    }

    /// Forgets all that comes behind a span.
    pub fn truncate(&mut self, span: Span) {
        self.end = span.start + span.count;
    }

    /// A ball of a span.
    pub fn get(&self, span: Span, index: usize) -> Member {
        let [x, y, z, radius, weight, id] = self.columns.each_ref().map(|column| column[span.start + index]);
        Member { center: [x, y, z], radius, weight, id: id.to_bits() }
    }

    /// The span of what was appended last in two parts, which follow each other.
    pub fn joined(first: Span, second: Span) -> Span {
        debug_assert_eq!(first.start + first.count, second.start);
        Span { start: first.start, count: first.count + second.count }
    }

    /// The first `count` balls of a span, and the others.
    pub fn split(span: Span, count: usize) -> [Span; 2] {
        [Span { start: span.start, count }, Span { start: span.start + count, count: span.count - count }]
    }

    /// Appends the balls of a span that pass a test.
    ///
    /// # Errors
    /// `OutOfMemory`.
    #[inline(always)]
    pub fn append_where<S: Simd, T: Test<S>>(&mut self, simd: S, source: Span, test: &T) -> Result<Span> {
        self.make_room(source.count)?;
        let start = self.end;
        for begin in (0..source.count).step_by(LANES) {
            let bits = (test.passes(&self.sixteen(simd, source, begin)) & valid(simd, source.count - begin)).bits();
            for column in &mut self.columns {
                let values = load(simd, column, source.start + begin);
                values.compress(bits, sixteen_at_mut(column, self.end));
            }
            self.end += bits.count_ones() as usize;
        }
        Ok(Span { start, count: self.end - start })
    }

    /// The balls `begin` to `begin + 15` of a span.
    #[inline(always)]
    pub fn sixteen<S: Simd>(&self, simd: S, span: Span, begin: usize) -> Sixteen<S> {
        let at = span.start + begin;
        let [x, y, z, radius, weight, _] = &self.columns;
        Sixteen {
            center: [load(simd, x, at), load(simd, y, at), load(simd, z, at)],
            radius: load(simd, radius, at),
            weight: load(simd, weight, at),
            valid: valid(simd, span.count - begin),
        }
    }

    /// The sum of the positive weights.
    #[inline(always)]
    pub fn positive_weight<S: Simd>(&self, simd: S, span: Span) -> f32 {
        let zero = simd.splat(0.0);
        let mut sum = zero;
        for begin in (0..span.count).step_by(LANES) {
            let balls = self.sixteen(simd, span, begin);
            sum = sum + balls.weight.max(zero).select(balls.valid, zero);
        }
        sum.reduce_sum()
    }

    /// The least box around spheres of `share` times the influence radii about the balls of positive weight; only they can
    /// make a surface.
    #[inline(always)]
    pub fn bounds<S: Simd>(&self, simd: S, span: Span, share: f32) -> Bounds {
        let (share, zero) = (simd.splat(share), simd.splat(0.0));
        let (infinity, minus_infinity) = (simd.splat(f32::INFINITY), simd.splat(f32::NEG_INFINITY));
        let mut low = [infinity; 3];
        let mut high = [minus_infinity; 3];
        for begin in (0..span.count).step_by(LANES) {
            let balls = self.sixteen(simd, span, begin);
            let counts = balls.valid & zero.lt(balls.weight);
            let radius = balls.radius * share;
            for axis in 0..3 {
                low[axis] = (balls.center[axis] - radius).select(counts, infinity).min(low[axis]);
                high[axis] = (balls.center[axis] + radius).select(counts, minus_infinity).max(high[axis]);
            }
        }
        let bounds = Bounds {
            low: [low[0].reduce_min(), low[1].reduce_min(), low[2].reduce_min()],
            high: [high[0].reduce_max(), high[1].reduce_max(), high[2].reduce_max()],
        };
        if bounds.is_empty() { Bounds::EMPTY } else { bounds.widened() }
    }

    /// Numbers that the field is not below and not above anywhere in each eighth of a box that no other balls touch. Bits of
    /// the number of an eighth say on which axes it is the upper half.
    #[inline(always)]
    pub fn density_ranges<S: Simd>(&self, simd: S, span: Span, bounds: &Bounds, density: &Density) -> [[f32; 2]; EIGHTHS] {
        let kernel = density.lanes(simd);
        let (zero, one) = (simd.splat(0.0), simd.splat(1.0));
        let (low, high) = (splat_point(simd, bounds.low), splat_point(simd, bounds.high));
        let middle = splat_point(simd, bounds.middle());
        let mut ranges = [[zero; 2]; EIGHTHS];
        for begin in (0..span.count).step_by(LANES) {
            let balls = self.sixteen(simd, span, begin);
            let inverse = one / (balls.radius * balls.radius);
            let adds = balls.weight.max(zero).select(balls.valid, zero);
            let carves = balls.weight.min(zero).select(balls.valid, zero);
            // Squares of the distances along each axis, in terms of R, to the nearest and farthest points of its halves.
            let (mut near, mut far) = ([[zero; 2]; 3], [[zero; 2]; 3]);
            for axis in 0..3 {
                let ends = [low[axis], middle[axis], high[axis]];
                for half in 0..2 {
                    let (below, above) = (ends[half] - balls.center[axis], balls.center[axis] - ends[half + 1]);
                    let (nearest, farthest) = (below.max(above).max(zero), below.min(above));
                    near[axis][half] = nearest * nearest * inverse;
                    far[axis][half] = farthest * farthest * inverse;
                }
            }
            for (eighth, [least, most]) in ranges.iter_mut().enumerate() {
                let halves = [eighth & 1, eighth >> 1 & 1, eighth >> 2];
                let nearest = near[0][halves[0]] + near[1][halves[1]] + near[2][halves[2]];
                let farthest = far[0][halves[0]] + far[1][halves[1]] + far[2][halves[2]];
                let at_most = kernel.value((one - nearest).max(zero));
                let at_least = kernel.value((one - farthest).max(zero));
                *most = adds.mul_add(at_most, carves.mul_add(at_least, *most));
                *least = adds.mul_add(at_least, carves.mul_add(at_most, *least));
            }
        }
        let mut numbers = [[0.0; 2]; EIGHTHS];
        for (numbers, range) in numbers.iter_mut().zip(ranges) {
            *numbers = [range[0].reduce_sum(), range[1].reduce_sum()];
        }
        numbers
    }

    /// Whether the field at a point is above a value.
    #[inline(always)]
    pub fn is_above_at<S: Simd>(&self, simd: S, span: Span, point: [f32; 3], density: &Density, value: f32) -> bool {
        let kernel = density.lanes(simd);
        let (zero, one) = (simd.splat(0.0), simd.splat(1.0));
        let point = splat_point(simd, point);
        let mut sum = zero;
        for begin in (0..span.count).step_by(LANES) {
            let balls = self.sixteen(simd, span, begin);
            let mut away = balls.center;
            for axis in 0..3 {
                away[axis] = point[axis] - balls.center[axis];
            }
            let x = one - length_squared(away) / (balls.radius * balls.radius);
            sum = balls.weight.select(balls.valid, zero).mul_add(kernel.value(x.max(zero)), sum);
        }
        sum.reduce_sum() > value
    }

    /// Whether the field is proven to be above the isovalue everywhere in a box that no other balls touch, by a bound from
    /// below in each of its sixty-four parts.
    #[inline(always)]
    pub fn is_fluid<S: Simd>(&self, simd: S, span: Span, bounds: &Bounds, density: &Density) -> bool {
        let kernel = density.lanes(simd);
        let (zero, one) = (simd.splat(0.0), simd.splat(1.0));
        let (low, size) = (bounds.low, bounds.size());
        let mut least = [[[zero; QUARTERS]; QUARTERS]; QUARTERS];
        for begin in (0..span.count).step_by(LANES) {
            let balls = self.sixteen(simd, span, begin);
            let inverse = one / (balls.radius * balls.radius);
            let weight = balls.weight.select(balls.valid, zero);
            // Squares of the distances along each axis, in terms of R, to the ends of its quarters.
            let (mut near, mut far) = ([[zero; QUARTERS]; 3], [[zero; QUARTERS]; 3]);
            for axis in 0..3 {
                for quarter in 0..QUARTERS {
                    let end = |index: usize| low[axis] + size[axis] * (index as f32 / QUARTERS as f32);
                    let below = simd.splat(end(quarter)) - balls.center[axis];
                    let above = balls.center[axis] - simd.splat(end(quarter + 1));
                    let (nearest, farthest) = (below.max(above).max(zero), below.min(above));
                    near[axis][quarter] = nearest * nearest * inverse;
                    far[axis][quarter] = farthest * farthest * inverse;
                }
            }
            let adds = weight.max(zero);
            let carves = weight.min(zero);
            let is_carved = carves.lt(zero).any();
            for x in 0..QUARTERS {
                for y in 0..QUARTERS {
                    let farthest = one - far[0][x] - far[1][y];
                    let nearest = one - near[0][x] - near[1][y];
                    for z in 0..QUARTERS {
                        let least = &mut least[x][y][z];
                        *least = adds.mul_add(kernel.value((farthest - far[2][z]).max(zero)), *least);
                        if is_carved {
                            *least = carves.mul_add(kernel.value((nearest - near[2][z]).max(zero)), *least);
                        }
                    }
                }
            }
        }
        least.as_flattened().as_flattened().iter().all(|least| density.is_above([least.reduce_sum(), f32::INFINITY]))
    }

    /// How many balls of a span begin below each plane across an axis, and how many end above it.
    #[inline(always)]
    pub fn count_at_planes<S: Simd, const N: usize>(
        &self,
        simd: S,
        span: Span,
        axis: usize,
        planes: &[f32; N],
    ) -> [[u32; 2]; N] {
        let mut counts = [[0; 2]; N];
        for begin in (0..span.count).step_by(LANES) {
            let balls = self.sixteen(simd, span, begin);
            let (low, high) = (balls.center[axis] - balls.radius, balls.center[axis] + balls.radius);
            for (counts, plane) in counts.iter_mut().zip(planes) {
                let plane = simd.splat(*plane);
                counts[0] += (low.lt(plane) & balls.valid).bits().count_ones();
                counts[1] += (plane.lt(high) & balls.valid).bits().count_ones();
            }
        }
        counts
    }

    /// Makes sure that `count` balls and a whole vector fit behind the last.
    fn make_room(&mut self, count: usize) -> Result<()> {
        let wanted = self.end + count + LANES;
        if self.columns[0].len() < wanted {
            for column in &mut self.columns {
                memory::reserve(column, wanted - column.len())?;
                column.resize(wanted, 0.0);
            }
        }
        Ok(())
    }
}

#[inline(always)]
fn valid<S: Simd>(simd: S, rest: usize) -> S::Mask {
    simd.mask(if rest >= LANES { u16::MAX } else { (1 << rest) - 1 })
}

#[inline(always)]
fn load<S: Simd>(simd: S, column: &[f32], at: usize) -> S::Vector {
    simd.load_unaligned(column[at..].first_chunk().expect("there is room for a vector behind every ball"))
}

#[inline(always)]
fn sixteen_at_mut(column: &mut [f32], at: usize) -> &mut [f32; LANES] {
    column[at..].first_chunk_mut().expect("there is room for a vector behind every ball")
}
