//! Whether points, and straight ways, lie within the fluid.

use crate::balls::Balls;
use crate::cells::Cells;
use crate::field::Field;
use crate::kernel::{Kernel, MAX_POWER};

/// As a share of the isovalue: the field is on the surface where it is as close to it.
const CLOSE: f64 = 1e-9;

/// The least step, as a share of a way: thinner gaps, and only those that balls of tiny radii make, may not be seen.
const LEAST_STEP: f64 = 1e-4;

/// A ball on a way: `x(t) = peak - ((t - middle) / R)^2`.
struct Chord {
    peak: f64,
    middle: f64,
    inverse_square: f64,
    weight: f64,
}

impl Chord {
    /// The field falls at most so much faster and faster. With `x(t) = a - (t / R)^2` the second derivative of f is at least
    /// `-2 f'(a) / R^2`; that of a ball that carves is bounded by the other side, see `bent_up`.
    fn bend(&self, kernel: &Kernel) -> f64 {
        let bound = if self.weight > 0.0 { kernel.derivative(self.peak) } else { bent_up(kernel, self.peak) };
        2.0 * self.weight.abs() * bound * self.inverse_square
    }

    /// Density and slope.
    fn at(&self, kernel: &Kernel, t: f64) -> [f64; 2] {
        let off = t - self.middle;
        let x = self.peak - off * off * self.inverse_square;
        [self.weight * kernel.value(x), -2.0 * self.weight * kernel.derivative(x) * off * self.inverse_square]
    }

    /// Where it begins.
    fn entry(&self) -> f64 {
        self.middle - (self.peak.max(0.0) / self.inverse_square).sqrt()
    }
}

/// Looks into a fluid.
pub struct Ways<'a> {
    balls: &'a Balls<'a>,
    field: &'a Field,
    cells: &'a Cells,
}

impl<'a> Ways<'a> {
    /// `cells` are those of the influence spheres.
    pub fn new(balls: &'a Balls<'a>, field: &'a Field, cells: &'a Cells) -> Self {
        Self { balls, field, cells }
    }

    /// Whether the centre of a ball lies in the fluid.
    pub fn begins_in_fluid(&self, ball: usize) -> bool {
        let center = self.center(ball);
        let mut density = 0.0;
        self.cells.for_near(center, center, |other| {
            let [_, _, distance_2] = along(center, [0.0; 3], self.center(other));
            let radius = f64::from(self.balls.radii()[other]);
            density += f64::from(self.balls.weights()[other]) * self.field.kernel.value(1.0 - distance_2 / (radius * radius));
        });
        density >= self.field.isovalue
    }

    /// Whether the straight way between the centres of two balls, which lie in the fluid, lies in it as a whole. The steps
    /// are those of the casters: none passes the surface.
    pub fn lies_in_fluid(&self, one: usize, other: usize) -> bool {
        let (begin, end) = (self.center(one), self.center(other));
        let way: [f64; 3] = std::array::from_fn(|axis| end[axis] - begin[axis]);
        let length = way.iter().map(|c| c * c).sum::<f64>().sqrt();
        if length == 0.0 {
            return true;
        }
        let direction = way.map(|c| c / length);
        let chords = self.chords(begin, end, direction, length);
        let kernel = &self.field.kernel;
        let bend: f64 = chords.iter().map(|chord| chord.bend(kernel)).sum();
        let mut at = 0.0;
        while at < length {
            let [density, slope] = chords.iter().fold([0.0; 2], |[density, slope], chord| {
                let [more, steeper] = chord.at(kernel, at);
                [density + more, slope + steeper]
            });
            let gap = density - self.field.isovalue;
            if gap <= CLOSE * self.field.isovalue {
                return false;
            }
            let fall = -slope;
            let root = (fall * fall + 2.0 * bend * gap).sqrt();
            let step = if fall > 0.0 { 2.0 * gap / (fall + root) } else { (root - fall) / bend };
            let next = if step.is_nan() { length } else { (at + step).min(next_kink(&chords, kernel, at)) };
            at = next.max(at + LEAST_STEP * length);
        }
        true
    }

    fn center(&self, ball: usize) -> [f64; 3] {
        self.balls.positions()[ball].map(f64::from)
    }

    /// The balls that count on a way.
    fn chords(&self, begin: [f64; 3], end: [f64; 3], direction: [f64; 3], length: f64) -> Vec<Chord> {
        let low = std::array::from_fn(|axis| begin[axis].min(end[axis]));
        let high = std::array::from_fn(|axis| begin[axis].max(end[axis]));
        let mut chords = Vec::new();
        self.cells.for_near(low, high, |ball| {
            let radius = f64::from(self.balls.radii()[ball]);
            let [middle, off_2, _] = along(begin, direction, self.center(ball));
            let inverse_square = 1.0 / (radius * radius);
            let peak = 1.0 - off_2 * inverse_square;
            let to_nearest = middle.clamp(0.0, length) - middle;
            if peak - to_nearest * to_nearest * inverse_square > 0.0 {
                let weight = f64::from(self.balls.weights()[ball]);
                chords.push(Chord { peak, middle, inverse_square, weight });
            }
        });
        chords
    }
}

/// Where the field next begins to fall with a jump: where a ball begins that carves, of a kernel with a linear term.
fn next_kink(chords: &[Chord], kernel: &Kernel, at: f64) -> f64 {
    if kernel.coefficients()[1] == 0.0 {
        return f64::INFINITY;
    }
    let entries = chords.iter().filter(|chord| chord.weight < 0.0).map(Chord::entry);
    // To be there is not to be before it.
    entries.filter(|entry| *entry > at).fold(f64::INFINITY, f64::min)
}

/// What `f''` along a ray is not above, times R^2 / 2: the greatest of `k x^(k-2) (2 (k - 1) a - (2 k - 1) x)` over x in [0, a].
fn bent_up(kernel: &Kernel, peak: f64) -> f64 {
    const GREATEST: [f64; MAX_POWER + 1] = [0.0, 0.0, 4.0, 2.4, 128.0 / 49.0];
    (2..=MAX_POWER).map(|power| GREATEST[power] * kernel.coefficients()[power] * peak.max(0.0).powi(power as i32 - 1)).sum()
}

/// Where a ray comes nearest to a point, the square of how near, and the square of the distance from its origin.
fn along(origin: [f64; 3], direction: [f64; 3], point: [f64; 3]) -> [f64; 3] {
    let off: [f64; 3] = std::array::from_fn(|axis| point[axis] - origin[axis]);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let middle = dot(off, direction);
    let aside: [f64; 3] = std::array::from_fn(|axis| off[axis] - middle * direction[axis]);
    [middle, dot(aside, aside), dot(off, off)]
}
