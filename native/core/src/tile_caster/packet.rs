//! A packet of rays, from the camera to the first crossing of the isosurface.
//!
//! Along a ray every ball is `x(t) = a - b (t - tc)^2`. While a ray is on its way, the density F and its slope F' are summed
//! over the balls that touch a window ahead, and M bounds how fast the slope can rise there. With `g = T - F` the step
//! `2 g / (F' + sqrt(F'^2 + 2 M g))` cannot pass the first crossing, and steps converge quadratically to it.

use super::bins::Bins;
use super::polynomial::Polynomial;
use super::steps::{Bend, LEAST};
use super::tile::{Entries, Rays, Surface};
use crate::field::Field;
use crate::simd::{LANES, Lanes, Mask, Simd, Vector};

/// Least length of a window, in radii of the next ball.
const WINDOW: f32 = 0.5;

/// A window goes on until so many balls touch it.
const WINDOW_BALLS: usize = 2;

/// The same where balls are so small that each meets few of the rays.
const WINDOW_SMALL_BALLS: usize = 4;

/// Rays that are touched by fewer balls than this have a bound of their own.
const FEW: usize = 5;

/// Where more balls touch a window, one of them must give so little that looking for where it does costs more than it saves.
const FEW_ENOUGH: usize = 8;

/// Share of a distance by which the first possible crossing may be nearer than float32 says.
const FIRST_MARGIN: f32 = 5e-7;

/// A crossing is found where the density is this close to the isovalue, as a share of it.
const TOLERANCE: f32 = 2e-6;

/// A step to the guessed crossing is the last one where no crossing can be farther off than this share of the isovalue by the
/// bound of the slope's change; the guess itself is several times better.
const STEP_TOLERANCE: f32 = 8e-6;

/// Nor farther off than this share of a radius, which matters at silhouettes, where the density is nearly level.
const STEP_SHARE: f32 = 1e-5;

/// The least step, in radii of the least ball: only where a ray grazes the surface would steps be shorter.
const LEAST_STEP: f32 = 1e-5;

/// Share of a distance by which a kink may be elsewhere than float32 says.
const KINK_MARGIN: f32 = 1e-6;

/// A ball that touches the window, along each ray.
#[derive(Clone, Copy)]
struct ActiveBall {
    /// a: x at the ray's nearest point.
    peak: Lanes,
    /// tc: where that is.
    middle: Lanes,
    /// b = 1 / R^2.
    curvature: f32,
    /// R.
    radius: f32,
    /// q.
    weight: f32,
    /// Behind this no ray meets it.
    back: f32,
    /// Its number in the tile.
    entry: u32,
}

/// The balls that touch the window.
#[derive(Default)]
pub struct ActiveBalls {
    balls: Vec<ActiveBall>,
    /// Where the first and the last of them end.
    first_back: f32,
    last_back: f32,
    least_radius: f32,
}

impl ActiveBalls {
    fn clear(&mut self) {
        self.balls.clear();
        self.summarise();
    }

    #[inline(always)]
    fn push(&mut self, ball: ActiveBall) {
        self.add(&ball);
        self.balls.push(ball);
    }

    /// Forgets what ends before `distance`; whether there was something.
    #[inline(always)]
    fn drop_before(&mut self, distance: f32) -> bool {
        if distance < self.first_back {
            return false;
        }
        self.balls.retain(|ball| distance < ball.back);
        self.summarise();
        true
    }

    fn summarise(&mut self) {
        (self.first_back, self.last_back, self.least_radius) = (f32::MAX, f32::MIN, f32::MAX);
        for index in 0..self.balls.len() {
            let ball = self.balls[index];
            self.add(&ball);
        }
    }

    #[inline(always)]
    fn add(&mut self, ball: &ActiveBall) {
        self.first_back = self.first_back.min(ball.back);
        self.last_back = self.last_back.max(ball.back);
        self.least_radius = self.least_radius.min(ball.radius);
    }
}

/// What a walk goes through.
pub struct Walk<'a, S: Simd, const LOW: usize, const HIGH: usize> {
    pub simd: S,
    pub kernel: Polynomial<S, LOW, HIGH>,
    pub isovalue: f32,
    pub thresholds: &'a Thresholds,
    pub bins: &'a Bins,
    pub entries: &'a mut Entries,
    pub rays: &'a Rays,
}

/// What at least one of n balls must have that together reach the isovalue.
pub struct Thresholds([f32; 32]);

impl Thresholds {
    /// Where no ball's weight is greater than `weight`.
    pub fn new(field: &Field, weight: f32) -> Self {
        // A little lower, so that rounding cannot make it too high.
        let share = |count: usize| field.isovalue * (1.0 - 1e-4) / (count as f64 * f64::from(weight));
        Self(std::array::from_fn(|index| field.kernel.inverse(share(index + 1)).unwrap_or(1.0) as f32))
    }

    /// A value of x that one of `count` balls must exceed.
    #[inline(always)]
    fn least_x(&self, count: usize) -> f32 {
        if count > self.0.len() { 0.0 } else { self.0[count.max(1) - 1] }
    }
}

/// Sums over the active balls: no density along a ray is greater, no slope of the density changes faster.
#[derive(Clone, Copy)]
struct Bounds<S: Simd> {
    density: S::Vector,
    rise: S::Vector,
    fall: S::Vector,
    /// How many balls touch the ray.
    touching: S::Vector,
}

/// The kinks ahead of a kernel with a linear term.
#[derive(Clone, Copy)]
struct Kinks<S: Simd> {
    /// Before this the slope does not jump.
    next: S::Vector,
    /// No slope ahead is steeper.
    steepest: S::Vector,
}

/// Where the rays of a packet are.
struct State<S: Simd> {
    /// There is no crossing before.
    t: S::Vector,
    /// 1 for rays that come from outside the fluid, -1 for those from inside.
    side: S::Vector,
    /// Rays that have found nothing yet.
    searching: S::Mask,
    bounds: Bounds<S>,
}

impl<S: Simd, const LOW: usize, const HIGH: usize> Walk<'_, S, LOW, HIGH> {
    /// Finds the first crossings and hands them to `surface`.
    #[inline(always)]
    pub fn run(&mut self, active: &mut ActiveBalls, surface: &mut Surface<'_>) {
        active.clear();
        let mut stream = Stream { group: 0, bits: 0 };
        let mut state = self.start(active, &mut stream);
        while let Some(horizon) = self.next_window(active, &mut stream, &mut state) {
            let found = self.advance(active, &mut state, horizon);
            if found.any() {
                self.shade(active, found, &state, surface);
            }
            state.searching = state.searching & !found & state.t.lt(self.simd.load(&self.rays.end));
            if !state.searching.any() {
                break;
            }
            self.drop_passed(active, &mut state);
        }
    }

    /// Rays at their starts: those from inside the fluid see its surface from within.
    #[inline(always)]
    fn start(&mut self, active: &mut ActiveBalls, stream: &mut Stream) -> State<S> {
        let simd = self.simd;
        let (t, zero, one) = (simd.load(&self.rays.start), simd.splat(0.0), simd.splat(1.0));
        let bounds = Bounds { density: zero, rise: zero, fall: zero, touching: zero };
        let mut state = State { t, side: one, searching: simd.mask(self.rays.lanes), bounds };
        self.insert(active, stream, &mut state.bounds, t.reduce_max(), 0);
        if !active.balls.is_empty() {
            let (density, _) = self.evaluate(active, t);
            state.side = (zero - one).select(simd.splat(self.isovalue).lt(density), one);
        }
        state
    }

    /// Takes in the balls of the next window, in which rays may go on until the distance returned; None where nothing is
    /// left.
    #[inline(always)]
    fn next_window(&mut self, active: &mut ActiveBalls, stream: &mut Stream, state: &mut State<S>) -> Option<f32> {
        let (simd, zero) = (self.simd, self.simd.splat(0.0));
        let nearest = state.t.select(state.searching, simd.splat(f32::MAX)).reduce_min();
        let next = stream.peek(self);
        let begin = match next {
            None if active.balls.is_empty() => return None,
            Some(entry) if active.balls.is_empty() => nearest.max(self.entries.front(entry)),
            _ => nearest,
        };
        state.t = state.t.max(simd.splat(begin));
        // Beyond `begin` also where the radius is lost in its rounding: the next ball must be taken in.
        let least = next.map_or(begin, |entry| (begin + WINDOW * self.entries.radius(entry)).max(begin.next_up()));
        let count = if self.bins.are_small { WINDOW_SMALL_BALLS } else { WINDOW_BALLS };
        self.insert(active, stream, &mut state.bounds, least, count);
        let next_front = stream.peek(self).map_or(f32::MAX, |entry| self.entries.front(entry));
        let horizon = next_front.min(active.last_back.max(least));
        // Where all balls together are too weak there is no crossing.
        let is_empty = zero.lt(state.side) & state.bounds.density.lt(simd.splat(self.isovalue));
        state.t = state.t.max(simd.splat(horizon)).select(is_empty, state.t);
        if active.balls.len() <= FEW_ENOUGH && (state.searching & !is_empty).any() {
            state.t = self.next_possible(active, state, horizon);
        }
        Some(horizon)
    }

    /// Where a ray from outside may meet the surface next, `horizon` at the latest: where n balls touch a ray, one of them
    /// alone must give the nth part of the isovalue.
    #[inline(always)]
    fn next_possible(&self, active: &ActiveBalls, state: &State<S>, horizon: f32) -> S::Vector {
        let simd = self.simd;
        let (zero, far) = (simd.splat(0.0), simd.splat(horizon));
        let (least, longer) = (simd.splat(LEAST), simd.splat(1.0 + 2.0 * S::ESTIMATE_ERROR));
        let threshold = self.least_x(&state.bounds);
        let mut first = far;
        for ball in &active.balls {
            let half_chord_2 = (simd.load(&ball.peak) - threshold) * simd.splat(ball.radius * ball.radius);
            // Longer rather than shorter: what begins earlier only costs time.
            let half_chord = half_chord_2 * half_chord_2.max(least).inverse_sqrt_estimate() * longer;
            let middle = simd.load(&ball.middle);
            let is_ahead = zero.lt(half_chord_2) & state.t.lt(middle + half_chord);
            first = first.min((middle - half_chord).select(is_ahead, far));
        }
        let first = first - first * simd.splat(FIRST_MARGIN);
        state.t.max(first).select(zero.lt(state.side), state.t)
    }

    /// A value of x that one of the balls that touch a ray must exceed where it meets the surface.
    #[inline(always)]
    fn least_x(&self, bounds: &Bounds<S>) -> S::Vector {
        let simd = self.simd;
        // Most rays are touched by few balls.
        let many = bounds.touching.reduce_max() as usize;
        let mut threshold = simd.splat(self.thresholds.least_x(many));
        for few in (1..many.min(FEW)).rev() {
            let is_few = bounds.touching.le(simd.splat(few as f32));
            threshold = simd.splat(self.thresholds.least_x(few)).select(is_few, threshold);
        }
        threshold
    }

    /// Adds the balls that begin before `horizon`, and more until there are `count`.
    #[inline(always)]
    fn insert(&mut self, active: &mut ActiveBalls, stream: &mut Stream, bounds: &mut Bounds<S>, horizon: f32, count: usize) {
        while let Some(entry) = stream.peek(self) {
            if self.entries.front(entry) >= horizon && active.balls.len() >= count {
                break;
            }
            stream.take();
            let (peak, middle) = self.along_rays(entry);
            if self.simd.splat(0.0).lt(peak).any() {
                let ball = self.active_ball(entry, peak, middle);
                self.add_bounds(bounds, &ball);
                active.push(ball);
            }
        }
    }

    /// a and tc for each ray.
    #[inline(always)]
    fn along_rays(&self, entry: usize) -> (S::Vector, S::Vector) {
        let simd = self.simd;
        let [dx, dy, dz] = self.rays.direction.each_ref().map(|axis| simd.load(axis));
        let [ox, oy] = self.rays.origin.each_ref().map(|axis| simd.load(axis));
        let [cx, cy, cz] = self.entries.center(entry).map(|number| simd.splat(number));
        let (x, y) = (cx - ox, cy - oy);
        let middle = x.mul_add(dx, y.mul_add(dy, cz * dz));
        // The vector from the nearest point to the centre; the difference of squares would cancel.
        let (px, py, pz) = (middle.neg_mul_add(dx, x), middle.neg_mul_add(dy, y), middle.neg_mul_add(dz, cz));
        let apart_2 = px.mul_add(px, py.mul_add(py, pz * pz));
        let curvature = simd.splat(self.entries.curvature(entry));
        (apart_2.neg_mul_add(curvature, simd.splat(1.0)), middle)
    }

    #[inline(always)]
    fn active_ball(&self, entry: usize, peak: S::Vector, middle: S::Vector) -> ActiveBall {
        ActiveBall {
            peak: peak.lanes(),
            middle: middle.lanes(),
            curvature: self.entries.curvature(entry),
            radius: self.entries.radius(entry),
            weight: self.entries.weight(entry),
            back: self.entries.back(entry),
            entry: entry as u32,
        }
    }

    #[inline(always)]
    fn add_bounds(&self, bounds: &mut Bounds<S>, ball: &ActiveBall) {
        let simd = self.simd;
        let zero = simd.splat(0.0);
        let peak = simd.load(&ball.peak).max(zero);
        bounds.touching = bounds.touching + simd.splat(1.0).select(zero.lt(peak), zero);
        let pull = simd.splat(ball.weight.abs() * ball.curvature);
        let (up, down) = (self.kernel.steepest_up(peak), self.kernel.steepest_down(peak));
        let (rise, fall) = if ball.weight < 0.0 { (down, up) } else { (up, down) };
        bounds.rise = pull.mul_add(rise, bounds.rise);
        bounds.fall = pull.mul_add(fall, bounds.fall);
        bounds.density = simd.splat(ball.weight.max(0.0)).mul_add(self.kernel.value(peak), bounds.density);
    }

    /// Forgets the balls that all searching rays have passed.
    #[inline(always)]
    fn drop_passed(&self, active: &mut ActiveBalls, state: &mut State<S>) {
        let nearest = state.t.select(state.searching, self.simd.splat(f32::MAX)).reduce_min();
        if active.drop_before(nearest) {
            let zero = self.simd.splat(0.0);
            state.bounds = Bounds { density: zero, rise: zero, fall: zero, touching: zero };
            for ball in &active.balls {
                self.add_bounds(&mut state.bounds, ball);
            }
        }
    }

    /// Steps until every ray is at the horizon or has found its crossing; those that have.
    ///
    /// Steps that are surely safe are short where the bound is much greater than the slope's true change. So the density is
    /// asked for farther ahead, at a guess of the crossing; what lies between may be proven empty from there as well.
    #[inline(always)]
    fn advance(&self, active: &ActiveBalls, state: &mut State<S>, horizon: f32) -> S::Mask {
        let simd = self.simd;
        let zero = simd.splat(0.0);
        let (end, isovalue) = (simd.load(&self.rays.end), simd.splat(self.isovalue));
        let last = horizon;
        let horizon = simd.splat(horizon).min(end);
        let least_density = isovalue * simd.splat(0.99) / state.bounds.touching.max(simd.splat(1.0));
        let is_outside = zero.lt(state.side);
        let bend = Bend::new(simd, state.bounds.rise.select(is_outside, state.bounds.fall));
        let bend_range = (state.bounds.rise + state.bounds.fall) * simd.splat(0.5);
        let tolerance = simd.splat(TOLERANCE * self.isovalue);
        let step_tolerance = simd.splat(STEP_TOLERANCE * self.isovalue);
        let farthest = simd.splat(STEP_SHARE * active.least_radius);
        let least_of_radius = simd.splat(LEAST_STEP * active.least_radius);
        let mut found = simd.mask(0);
        let mut at = state.t;
        loop {
            let walking = state.searching & !found & state.t.lt(horizon);
            if !walking.any() {
                return found;
            }
            let (density, slope) = self.evaluate(active, at);
            let (gap, slope) = ((isovalue - density) * state.side, slope * state.side);
            let is_proven = at.le(state.t);
            let gap = gap.max(zero).select(is_proven, gap);
            let steps = bend.steps(simd, gap, slope);
            let is_proven = is_proven | (steps.is_real & (at - steps.behind).le(state.t));
            let mut limit = horizon;
            let mut next = at + steps.ahead;
            if LOW == 1 {
                let kinks = self.kinks(active, state);
                limit = kinks.next.min(horizon);
                // Across a kink only the steepest slope that may come is a bound.
                next = next.min(limit).max(at + gap / kinks.steepest);
            }
            let step = next - at;
            // A step that is lost in the rounding of the distance would be made for ever.
            let least = least_of_radius.max(state.t * simd.splat(f32::EPSILON));
            // The density can miss the isovalue by no more than this after the step, and the distance by that over the slope.
            let is_close = (bend_range * step * step).le(step_tolerance.min(steps.slope * farthest)) & next.lt(limit);
            let is_there = gap.max(zero - gap).le(tolerance);
            let proven = walking & is_proven;
            found = found | (proven & (is_there | is_close));
            let moved = at.select(is_there, (at + steps.guess).select(is_close, next.max(state.t + least).min(horizon)));
            state.t = moved.select(proven, state.t);
            // Where no ball gives its part there is a gap.
            let is_in_gap = proven & !found & is_outside & density.lt(least_density);
            if is_in_gap.any() {
                state.t = self.next_possible(active, state, last).select(is_in_gap, state.t);
            }
            let guess = (at + steps.guess).max(state.t).min(horizon);
            at = if LOW == 1 { state.t } else { guess.select(proven & !is_in_gap, state.t) };
        }
    }

    /// F and F' at `t`.
    #[inline(always)]
    fn evaluate(&self, active: &ActiveBalls, t: S::Vector) -> (S::Vector, S::Vector) {
        let simd = self.simd;
        let zero = simd.splat(0.0);
        let (mut density, mut slope) = (zero, zero);
        for ball in &active.balls {
            let offset = t - simd.load(&ball.middle);
            let bent = offset * simd.splat(ball.curvature);
            let x = bent.neg_mul_add(offset, simd.load(&ball.peak)).max(zero);
            let (value, steepness) = self.kernel.value_and_slope(x);
            let weight = simd.splat(ball.weight);
            density = value.mul_add(weight, density);
            slope = (steepness * bent).mul_add(weight, slope);
        }
        (density, slope * simd.splat(-2.0))
    }

    /// The slope of a kernel with a linear term jumps where an influence sphere begins or ends.
    #[inline(always)]
    fn kinks(&self, active: &ActiveBalls, state: &State<S>) -> Kinks<S> {
        let simd = self.simd;
        let (zero, far, t) = (simd.splat(0.0), simd.splat(f32::MAX), state.t);
        let mut kinks = Kinks::<S> { next: far, steepest: zero };
        for ball in &active.balls {
            let (peak, middle) = (simd.load(&ball.peak).max(zero), simd.load(&ball.middle));
            let curvature = simd.splat(ball.curvature);
            let half_chord = (peak / curvature).sqrt();
            // Nearer than this it cannot be told whether a kink has been passed.
            let margin = (t + half_chord) * simd.splat(KINK_MARGIN);
            let (entry, exit): (S::Vector, S::Vector) = (middle - half_chord, middle + half_chord);
            let is_touched = zero.lt(peak);
            for kink in [entry, exit] {
                let is_ahead = is_touched & t.le(kink + margin);
                kinks.next = kinks.next.min((kink - margin).select(is_ahead, far));
            }
            let two = simd.splat(2.0);
            // No slope of the kernel is steeper than at the peak.
            let (_, kernel_slope) = self.kernel.value_and_slope(peak);
            let weight = simd.splat(ball.weight) * state.side * kernel_slope;
            let steepest = two * curvature * half_chord * weight.max(zero - weight);
            let now = (two * curvature * weight * (middle - t)).max(zero);
            let is_before = t.le(entry + margin) | weight.lt(zero);
            let bound = steepest.select(is_before, now).select(is_touched & t.le(exit + margin), zero);
            kinks.steepest = kinks.steepest + bound;
        }
        kinks
    }

    /// Normals, balls and attributes where rays have met the surface. Where the density is level, which has no normal, the one
    /// that faces along the ray.
    #[inline(always)]
    fn shade(&self, active: &ActiveBalls, found: S::Mask, state: &State<S>, surface: &mut Surface<'_>) {
        let (simd, t) = (self.simd, state.t);
        let zero = simd.splat(0.0);
        let [dx, dy, dz] = self.rays.direction.each_ref().map(|axis| simd.load(axis));
        let [ox, oy] = self.rays.origin.each_ref().map(|axis| simd.load(axis));
        let point = [dx.mul_add(t, ox), dy.mul_add(t, oy), dz * t];
        let mut outward = [zero; 3];
        let (mut greatest, mut dominant) = (zero, zero);
        surface.begin_shares();
        for (number, ball) in active.balls.iter().enumerate() {
            let offset = t - simd.load(&ball.middle);
            let bent = offset * simd.splat(ball.curvature);
            let x = bent.neg_mul_add(offset, simd.load(&ball.peak)).max(zero);
            let (value, steepness) = self.kernel.value_and_slope(x);
            let pull = steepness * simd.splat(ball.weight * ball.curvature);
            let center = self.entries.center(ball.entry as usize);
            for axis in 0..3 {
                outward[axis] = (point[axis] - simd.splat(center[axis])).mul_add(pull, outward[axis]);
            }
            if surface.wants_shares() {
                let share = value * simd.splat(ball.weight.max(0.0));
                dominant = simd.splat(number as f32).select(greatest.lt(share), dominant);
                greatest = greatest.max(share);
                surface.add_share(simd, self.entries.index(ball.entry as usize), share);
            }
        }
        let length_2 = outward[0].mul_add(outward[0], outward[1].mul_add(outward[1], outward[2] * outward[2]));
        let scale = simd.splat(1.0) / length_2.sqrt();
        let is_level = length_2.le(zero);
        let mut normal = [dx, dy, dz];
        for (facing, outward) in normal.iter_mut().zip(outward) {
            *facing = (zero - *facing * state.side).select(is_level, outward * scale);
        }
        let dominant = dominant.lanes();
        let index = |ray| self.entries.index(active.balls[dominant.0[ray] as usize].entry as usize);
        surface.put(simd, found, point[2], normal, index);
    }
}

/// The balls of the tile that may touch the packet, in the order in which they begin.
struct Stream {
    /// The next sixteen.
    group: usize,
    /// Those of the sixteen before that are still to come.
    bits: u16,
}

impl Stream {
    /// The next one's number.
    #[inline(always)]
    fn peek<S: Simd, const LOW: usize, const HIGH: usize>(&mut self, walk: &mut Walk<'_, S, LOW, HIGH>) -> Option<usize> {
        while self.bits == 0 {
            if !walk.entries.begins_before(self.group, walk.rays.visible_end) {
                return None;
            }
            self.bits = walk.entries.touching(walk.simd, walk.bins, self.group, &walk.rays.bundle);
            self.group += 1;
        }
        Some((self.group - 1) * LANES + self.bits.trailing_zeros() as usize)
    }

    #[inline(always)]
    fn take(&mut self) {
        self.bits &= self.bits - 1;
    }
}
