//! The surface on a ray within a leaf.
//!
//! The paper looks at the projections of the centres onto the ray, which misses grazing hits (Gourmel et al. 2010,
//! section 3). Here the ray is walked by steps that cannot pass the surface, so that a miss is proven.

use crate::simd::{LANES, Mask, Simd, Vector};

use super::density::{Density, KernelLanes};
use super::hierarchy::Packet;
use super::members::{length_squared, splat_point};
use super::ray::Segment;

/// The field is on the surface where it is as close to the isovalue, relatively: some roundings of a sum.
const CLOSE: f32 = 1e-6;

/// A stretch of a ray is halved where half its length is more than twice the radius of the smallest ball on it; the square
/// of that ratio. Small balls would make for small steps on all of it.
const LONG: f32 = 4.0;

/// Balls that a ray meets in a leaf, as columns; each is `x(t) = peak - (t - middle)^2 / R^2`.
#[derive(Debug, Default)]
pub struct Met {
    peak: Vec<f32>,
    middle: Vec<f32>,
    inverse_square: Vec<f32>,
    weight: Vec<f32>,
    count: usize,
}

impl Met {
    /// Room for the balls of any leaf of up to `count`.
    pub fn with_room(count: usize) -> Self {
        let column = || vec![0.0; count + LANES];
        Self { peak: column(), middle: column(), inverse_square: column(), weight: column(), count: 0 }
    }

    #[inline(always)]
    fn push<S: Simd>(&mut self, bits: u16, [peak, middle, inverse_square, weight]: [S::Vector; 4]) {
        peak.compress(bits, chunk_mut(&mut self.peak, self.count));
        middle.compress(bits, chunk_mut(&mut self.middle, self.count));
        inverse_square.compress(bits, chunk_mut(&mut self.inverse_square, self.count));
        weight.compress(bits, chunk_mut(&mut self.weight, self.count));
        self.count += bits.count_ones() as usize;
    }
}

#[inline(always)]
fn chunk(column: &[f32], at: usize) -> &[f32; LANES] {
    column[at..].first_chunk().expect("there is room for a vector behind every ball")
}

#[inline(always)]
fn chunk_mut(column: &mut [f32], at: usize) -> &mut [f32; LANES] {
    column[at..].first_chunk_mut().expect("there is room for a vector behind every ball")
}

/// A point as the sum of two floats a coordinate, so that differences to centres nearby are exact.
#[derive(Clone, Copy)]
struct Point<S: Simd> {
    coarse: [S::Vector; 3],
    fine: [S::Vector; 3],
}

impl<S: Simd> Point<S> {
    #[inline(always)]
    fn new(simd: S, point: [f64; 3]) -> Self {
        let coarse = point.map(|c| c as f32);
        let fine = std::array::from_fn(|axis| (point[axis] - f64::from(coarse[axis])) as f32);
        Self { coarse: splat_point(simd, coarse), fine: splat_point(simd, fine) }
    }

    /// From here to the centres of a packet.
    #[inline(always)]
    fn to_centers(self, simd: S, packet: &Packet) -> [S::Vector; 3] {
        let mut away = self.coarse;
        for (axis, away) in away.iter_mut().enumerate() {
            *away = simd.load(&packet.center[axis]) - self.coarse[axis] - self.fine[axis];
        }
        away
    }
}

/// The field is surely on one side of the isovalue where it is as far from it, relatively, as it is said to be computed.
const SURELY_OFF: f32 = 1e-5;

/// Of the radius of a ball: how far distances to it are off at most, and how far a ray is lifted off the surface at most where
/// the field is level.
const DISTANCE_OFF: f32 = 1e-6;
const MOST_LIFT: f32 = 1e-3;

/// A point of the surface.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Unit, out of the fluid.
    pub normal: [f32; 3],
    /// Index of the ball with the greatest share of the field, among those of the leaf.
    pub ball: usize,
    /// So far from the surface the field is surely on one side of the isovalue.
    pub lift: f32,
}

/// What leaves are searched with.
pub struct Searcher<'a, S: Simd> {
    simd: S,
    density: &'a Density,
    kernel: KernelLanes<S>,
    has_kinks: bool,
}

/// What is asked of a leaf.
#[derive(Clone, Copy, Debug)]
pub struct Search {
    /// Whether the segment begins within the fluid.
    pub inside: bool,
    /// Whether any crossing will do; else it is the first.
    pub any: bool,
}

/// What bounds the field of the balls that a ray meets.
struct Bound {
    /// The field is not greater.
    most: f32,
    /// Its second derivative towards the isovalue is not greater.
    bend: f32,
    /// `1 / R^2` of the smallest ball.
    inverse_square: f32,
}

/// The field and its slope at a distance.
struct Value {
    field: f32,
    slope: f32,
    /// Where the slope jumps next.
    next_kink: f32,
}

impl<'a, S: Simd> Searcher<'a, S> {
    #[inline(always)]
    pub fn new(simd: S, density: &'a Density) -> Self {
        Self { simd, density, kernel: density.lanes(simd), has_kinks: density.has_kinks() }
    }

    /// Where a segment crosses the surface in an interval, either way.
    #[inline(always)]
    pub fn crossing(
        &self,
        packets: &[Packet],
        segment: &Segment,
        interval: [f64; 2],
        search: Search,
        met: &mut Met,
    ) -> Option<f64> {
        let [mut begin, end] = interval;
        let mut length = end - begin;
        loop {
            let next = if begin + length < end { begin + length } else { end };
            let middle = 0.5 * (begin + next);
            let half = (0.5 * (next - begin)) as f32;
            let bound = self.gather(packets, segment, middle, half, search.inside, met);
            if search.inside || bound.most >= self.density.isovalue * (1.0 - CLOSE) {
                if half * half * bound.inverse_square > LONG {
                    length *= 0.5;
                    continue;
                }
                if search.any && !search.inside && self.is_fluid_at_projections(met, half) {
                    return Some(middle);
                }
                if let Some(local) = self.walk(met, half, bound.bend, search.inside) {
                    return Some((middle + f64::from(local)).clamp(begin, next));
                }
            }
            if next == end {
                return None;
            }
            (begin, length) = (next, 2.0 * length);
        }
    }

    /// Collects the balls that the segment meets within `half` of `middle`.
    #[inline(always)]
    fn gather(&self, packets: &[Packet], segment: &Segment, middle: f64, half: f32, inside: bool, met: &mut Met) -> Bound {
        let simd = self.simd;
        let point = Point::new(simd, segment.at(middle));
        let direction = splat_point(simd, segment.direction.map(|d| d as f32));
        let (zero, one, two) = (simd.splat(0.0), simd.splat(1.0), simd.splat(2.0));
        let (begin, end) = (simd.splat(-half), simd.splat(half));
        let (mut most, mut bend, mut sharpest) = (zero, zero, zero);
        met.count = 0;
        for packet in packets {
            let mut off = point.to_centers(simd, packet);
            let inverse_square = simd.load(&packet.inverse_square);
            let weight = simd.load(&packet.weight);
            let along = off[0].mul_add(direction[0], off[1].mul_add(direction[1], off[2] * direction[2]));
            for axis in 0..3 {
                off[axis] = along.neg_mul_add(direction[axis], off[axis]);
            }
            let peak = length_squared(off).neg_mul_add(inverse_square, one);
            let to_nearest = along.max(begin).min(end) - along;
            let nearest = (to_nearest * to_nearest).neg_mul_add(inverse_square, peak);
            let meets = zero.lt(nearest);
            let bits = meets.bits();
            if bits == 0 {
                continue;
            }
            let adds = weight.max(zero).select(meets, zero);
            let carves = (zero - weight).max(zero).select(meets, zero);
            most = adds.mul_add(self.kernel.value(nearest.max(zero)), most);
            let (rises, falls) = if inside { (carves, adds) } else { (adds, carves) };
            let bends = rises.mul_add(self.kernel.rise(peak), falls * self.kernel.slope(peak));
            bend = (bends * inverse_square).mul_add(two, bend).select(meets, bend);
            sharpest = inverse_square.select(meets, zero).max(sharpest);
            met.push::<S>(bits, [peak, along, inverse_square, weight]);
        }
        chunk_mut(&mut met.weight, met.count).fill(0.0);
        Bound { most: most.reduce_sum(), bend: bend.reduce_sum(), inverse_square: sharpest.reduce_max() }
    }

    /// Whether the field is above the isovalue where the projections of the centres onto the ray are on average, each weighted
    /// by what it adds there: if the ray meets the fluid, then most likely in this place (section 3).
    #[inline(always)]
    fn is_fluid_at_projections(&self, met: &Met, half: f32) -> bool {
        let simd = self.simd;
        let (mut moments, mut shares) = (simd.splat(0.0), simd.splat(0.0));
        for begin in (0..met.count).step_by(LANES) {
            let peak = simd.load_unaligned(chunk(&met.peak, begin));
            let share = simd.load_unaligned(chunk(&met.weight, begin)) * self.kernel.value(peak);
            moments = share.mul_add(simd.load_unaligned(chunk(&met.middle, begin)), moments);
            shares = shares + share;
        }
        let average = moments.reduce_sum() / shares.reduce_sum();
        self.value(met, average.clamp(-half, half)).field >= self.density.isovalue
    }

    /// Where the field first crosses the isovalue in [-half, half]. With `g` the distance to the isovalue, `s` the slope
    /// towards it and `M` a bound of the second derivative, it is not before `2 g / (s + sqrt(s^2 + 2 M g))`.
    #[inline(always)]
    fn walk(&self, met: &Met, half: f32, bend: f32, inside: bool) -> Option<f32> {
        let sign = if inside { -1.0 } else { 1.0 };
        let isovalue = self.density.isovalue;
        let mut at = -half;
        loop {
            let value = self.value(met, at);
            let gap = sign * (isovalue - value.field);
            let slope = sign * value.slope;
            if gap <= 0.0 {
                return Some(at);
            }
            let root = (slope * slope + 2.0 * bend * gap).sqrt();
            // Not a number where nothing bends the field towards the isovalue.
            let step = if slope > 0.0 { 2.0 * gap / (slope + root) } else { (root - slope) / bend };
            let next = (at + step).min(value.next_kink.max(at.next_up()));
            if next.is_nan() || next > half {
                return None;
            }
            if gap <= CLOSE * isovalue || next == at {
                return Some(next);
            }
            at = next;
        }
    }

    #[inline(always)]
    fn value(&self, met: &Met, at: f32) -> Value {
        let simd = self.simd;
        let (zero, here, minus_two) = (simd.splat(0.0), simd.splat(at), simd.splat(-2.0));
        let (mut field, mut slope) = (zero, zero);
        let mut next_kink = simd.splat(f32::INFINITY);
        for begin in (0..met.count).step_by(LANES) {
            let peak = simd.load_unaligned(chunk(&met.peak, begin));
            let from_middle = here - simd.load_unaligned(chunk(&met.middle, begin));
            let inverse_square = simd.load_unaligned(chunk(&met.inverse_square, begin));
            let weight = simd.load_unaligned(chunk(&met.weight, begin));
            let steepness = from_middle * inverse_square;
            let mut x = from_middle.neg_mul_add(steepness, peak).max(zero);
            let mut pull = weight;
            if self.has_kinks {
                let half_chord = (peak / inverse_square).sqrt();
                let (entry, exit) = (from_middle + half_chord, from_middle - half_chord);
                let covers = zero.le(entry) & exit.lt(zero);
                pull = weight.select(covers, zero);
                x = x.select(covers, zero);
                next_kink = (here - entry).select(entry.lt(zero), next_kink).min(next_kink);
                next_kink = (here - exit).select(exit.lt(zero), next_kink).min(next_kink);
            }
            field = pull.mul_add(self.kernel.value(x), field);
            slope = (pull * self.kernel.slope(x)).mul_add(steepness * minus_two, slope);
        }
        let next_kink = if self.has_kinks { next_kink.reduce_min() } else { f32::INFINITY };
        Value { field: field.reduce_sum(), slope: slope.reduce_sum(), next_kink }
    }

    /// Whether a point is within the fluid, as the balls that touch its leaf say.
    #[inline(always)]
    pub fn is_inside(&self, packets: &[Packet], point: [f64; 3]) -> bool {
        let simd = self.simd;
        let point = Point::new(simd, point);
        let (zero, one) = (simd.splat(0.0), simd.splat(1.0));
        let mut field = zero;
        for packet in packets {
            let away = length_squared(point.to_centers(simd, packet));
            let x = away.neg_mul_add(simd.load(&packet.inverse_square), one).max(zero);
            field = simd.load(&packet.weight).mul_add(self.kernel.value(x), field);
        }
        field.reduce_sum() >= self.density.isovalue
    }

    /// A point of the surface; its normal is `level` where the field is level there.
    #[inline(always)]
    pub fn surface(&self, packets: &[Packet], point: [f64; 3], level: [f32; 3]) -> Place {
        let simd = self.simd;
        let point = Point::new(simd, point);
        let (zero, one) = (simd.splat(0.0), simd.splat(1.0));
        let mut pull = [zero; 3];
        let (mut most, mut strongest) = (simd.splat(f32::NEG_INFINITY), zero);
        for (index, packet) in packets.iter().enumerate() {
            let to_center = point.to_centers(simd, packet);
            let inverse_square = simd.load(&packet.inverse_square);
            let weight = simd.load(&packet.weight);
            let x = length_squared(to_center).neg_mul_add(inverse_square, one);
            let reaches = zero.lt(x);
            let share = (weight * self.kernel.value(x)).select(reaches, zero);
            let strength = (weight * self.kernel.slope(x) * inverse_square).select(reaches, zero);
            for axis in 0..3 {
                pull[axis] = strength.mul_add(to_center[axis], pull[axis]);
            }
            let is_more = most.lt(share);
            most = share.select(is_more, most);
            strongest = simd.splat(index as f32).select(is_more, strongest);
        }
        let inward = [pull[0].reduce_sum(), pull[1].reduce_sum(), pull[2].reduce_sum()].map(f64::from);
        let length = inward.iter().map(|c| c * c).sum::<f64>().sqrt();
        let normal = if length > 0.0 { inward.map(|c| (-c / length) as f32) } else { level };
        let (shares, packet_of) = (most.lanes().0, strongest.lanes().0);
        let lane = (1..LANES).fold(0, |best, lane| if shares[lane] > shares[best] { lane } else { best });
        let packet = packet_of[lane] as usize;
        let radius = packets[packet].inverse_square.0[lane].sqrt().recip();
        // The gradient is twice the pull; not a number is the most.
        let off = SURELY_OFF * self.density.isovalue / (2.0 * length as f32);
        let lift = off.min(MOST_LIFT * radius) + DISTANCE_OFF * radius;
        Place { normal, ball: packet * LANES + lane, lift }
    }

    /// The mean of the balls' colours at a point, each weighted by its share of the field; balls that carve have none.
    #[inline(always)]
    pub fn blend(&self, packets: &[Packet], ids: &[u32], point: [f64; 3], colors: &[[f32; 3]]) -> [f32; 3] {
        let simd = self.simd;
        let point = Point::new(simd, point);
        let (zero, one) = (simd.splat(0.0), simd.splat(1.0));
        let (mut sum, mut total) = ([0.0f32; 3], 0.0);
        for (packet, ids) in packets.iter().zip(ids.chunks(LANES)) {
            let x = length_squared(point.to_centers(simd, packet)).neg_mul_add(simd.load(&packet.inverse_square), one);
            let shares = (simd.load(&packet.weight) * self.kernel.value(x.max(zero))).max(zero).lanes().0;
            for (share, id) in shares.into_iter().zip(ids) {
                if share > 0.0 {
                    let color = colors[*id as usize];
                    total += share;
                    for (channel, part) in sum.iter_mut().zip(color) {
                        *channel += share * part;
                    }
                }
            }
        }
        if total > 0.0 { sum.map(|channel| channel / total) } else { sum }
    }
}
