//! Influence spheres along a ray, and the intervals into which they cut it.

use std::ops::ControlFlow;

use super::rays::{Ray, dot};
use super::sphere_tree::Ball;

/// A ball along a ray: `x(t) = peak - ((t - middle) / radius)^2`, which is positive between `entry` and `exit`.
#[derive(Clone, Copy, Debug)]
pub struct Chord {
    pub weight: f64,
    pub radius: f64,
    peak: f64,
    middle: f64,
    /// From the ray at `middle` to the centre.
    off_axis: [f64; 3],
    /// At least 0, where the ray starts.
    entry: f64,
    exit: f64,
}

impl Chord {
    /// The part of the ray within a ball's influence sphere, if there is one.
    pub fn new(ball: &Ball, ray: &Ray) -> Option<Self> {
        let (middle, off_axis) = ray.nearest(ball.center);
        let distance = dot(off_axis, off_axis).sqrt();
        // Factored, because the difference of the squares would cancel at the rim.
        let half_2 = (ball.radius - distance) * (ball.radius + distance);
        let exit = middle + half_2.max(0.0).sqrt();
        let entry = (middle - half_2.max(0.0).sqrt()).max(0.0);
        // Coordinates beyond the range of a double make these NaN: no ball is seen from there.
        let is_met = half_2 > 0.0 && exit > entry;
        let peak = half_2 / (ball.radius * ball.radius);
        is_met.then_some(Self { weight: ball.weight, radius: ball.radius, peak, middle, off_axis, entry, exit })
    }

    /// x at the distance `t`.
    pub fn x(&self, t: f64) -> f64 {
        let offset = (t - self.middle) / self.radius;
        self.peak - offset * offset
    }

    /// Bernstein form of x over an interval within the chord.
    pub fn x_over(&self, begin: f64, end: f64) -> [f64; 3] {
        let (first, last) = ((begin - self.middle) / self.radius, (end - self.middle) / self.radius);
        [self.x_within(begin), self.peak - first * last, self.x_within(end)]
    }

    /// x at a distance within the chord: exactly 0 at its ends, whose distances are rounded, and never less.
    fn x_within(&self, t: f64) -> f64 {
        let is_entry = t == self.entry && self.entry > 0.0;
        if is_entry || t == self.exit { 0.0 } else { self.x(t).max(0.0) }
    }

    /// The vector from the ball's centre to the ray at the distance `t`.
    pub fn offset(&self, ray: &Ray, t: f64) -> [f64; 3] {
        std::array::from_fn(|axis| (t - self.middle) * ray.direction[axis] - self.off_axis[axis])
    }
}

/// The chords of one ray, and room to walk along them.
#[derive(Debug, Default)]
pub struct Intervals {
    chords: Vec<Chord>,
    cuts: Vec<f64>,
    active: Vec<usize>,
}

/// A stretch of a ray on which the same balls count.
#[derive(Clone, Copy, Debug)]
pub struct Interval<'a> {
    pub begin: f64,
    pub end: f64,
    chords: &'a [Chord],
    active: &'a [usize],
}

impl<'a> Interval<'a> {
    /// The chords of the balls that count. Each keeps its place among the others from one interval to the next.
    pub fn chords(&self) -> impl Iterator<Item = &'a Chord> {
        let all = self.chords;
        self.active.iter().map(|index| &all[*index])
    }
}

impl Intervals {
    /// Begins another ray.
    pub fn clear(&mut self) {
        self.chords.clear();
    }

    /// Adds a chord of the ray, in any order.
    pub fn push(&mut self, chord: Chord) {
        self.chords.push(chord);
    }

    /// All chords of the ray.
    pub fn chords(&self) -> &[Chord] {
        &self.chords
    }

    /// Calls `visit` with each interval from the start of the ray to where it leaves the last ball, until it breaks off. Each
    /// begins where the last one ends; none is empty, though some have no chord.
    pub fn walk(&mut self, visit: &mut impl FnMut(Interval) -> ControlFlow<()>) -> ControlFlow<()> {
        let Self { chords, cuts, active } = self;
        chords.sort_unstable_by(|a, b| a.entry.total_cmp(&b.entry));
        cuts.clear();
        cuts.push(0.0);
        cuts.extend(chords.iter().flat_map(|chord| [chord.entry, chord.exit]));
        cuts.sort_unstable_by(f64::total_cmp);
        cuts.dedup();
        active.clear();
        let mut entered = 0;
        for ends in cuts.windows(2) {
            let (begin, end) = (ends[0], ends[1]);
            active.retain(|index| chords[*index].exit > begin);
            while entered < chords.len() && chords[entered].entry <= begin {
                active.push(entered);
                entered += 1;
            }
            visit(Interval { begin, end, chords, active })?;
        }
        ControlFlow::Continue(())
    }
}
