//! Finds the balls near a ray: a binary tree of bounding spheres over the balls, halved at the median.

use rayon::prelude::*;

use super::rays::{Ray, dot};
use crate::balls::Balls;
use crate::error::Result;
use crate::memory;

/// Balls that a leaf has at most.
const LEAF_SIZE: usize = 4;

/// Widens bounding spheres by this share of their size and distance, thousands of times what rounding can amount to, so that
/// no ball is lost that a ray meets.
const SLACK: f64 = 1e-12;

/// A ball in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    pub center: [f64; 3],
    pub radius: f64,
    pub weight: f64,
}

/// Contains the influence spheres of a range of balls.
#[derive(Clone, Copy, Debug, Default)]
struct Bounds {
    center: [f64; 3],
    radius: f64,
}

/// All balls, in an order in which each node of the tree has a range of them.
///
/// The tree is complete: node k has the children 2 k + 1 and 2 k + 2, each with half of its balls, and all leaves are at the
/// same depth.
pub struct SphereTree {
    balls: Vec<Ball>,
    nodes: Vec<Bounds>,
    depth: u32,
}

impl SphereTree {
    /// Sorts the balls into a tree.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn new(balls: Balls<'_>) -> Result<Self> {
        let mut sorted = memory::with_capacity(balls.len())?;
        for ((position, radius), weight) in balls.positions().iter().zip(balls.radii()).zip(balls.weights()) {
            let (radius, weight) = (f64::from(*radius), f64::from(*weight));
            sorted.push(Ball { center: position.map(f64::from), radius, weight });
        }
        let depth = balls.len().div_ceil(LEAF_SIZE).next_power_of_two().ilog2();
        sort_by_halves(&mut sorted, depth);
        let mut nodes = memory::filled(Bounds::default(), (2 << depth) - 1)?;
        for level in 0..=depth {
            let row = &mut nodes[(1 << level) - 1..(2 << level) - 1];
            row.par_iter_mut().enumerate().for_each(|(place, node)| *node = bounds(part(&sorted, level, place)));
        }
        Ok(Self { balls: sorted, nodes, depth })
    }

    /// Calls `found` with every ball whose influence sphere the ray may meet, and with some that it does not.
    pub fn visit(&self, ray: &Ray, found: &mut impl FnMut(&Ball)) {
        self.visit_below(0, self.depth, &self.balls, ray, found);
    }

    fn visit_below(&self, node: usize, height: u32, balls: &[Ball], ray: &Ray, found: &mut impl FnMut(&Ball)) {
        if self.nodes[node].is_missed_by(ray) {
            return;
        }
        if height == 0 {
            balls.iter().for_each(found);
            return;
        }
        let (left, right) = balls.split_at(balls.len() / 2);
        self.visit_below(2 * node + 1, height - 1, left, ray, found);
        self.visit_below(2 * node + 2, height - 1, right, ray, found);
    }
}

impl Bounds {
    fn is_missed_by(&self, ray: &Ray) -> bool {
        let (along, off_axis) = ray.nearest(self.center);
        let distance = dot(off_axis, off_axis).sqrt();
        let reach = self.radius + SLACK * (self.radius + along.abs() + distance);
        distance > reach || along < -reach
    }
}

/// Orders the balls so that each half, each quarter ... lies on one side of a median of their centres.
fn sort_by_halves(balls: &mut [Ball], depth: u32) {
    if depth == 0 {
        return;
    }
    let axis = widest_axis(balls);
    let middle = balls.len() / 2;
    balls.select_nth_unstable_by(middle, |a, b| a.center[axis].total_cmp(&b.center[axis]));
    let (left, right) = balls.split_at_mut(middle);
    rayon::join(|| sort_by_halves(left, depth - 1), || sort_by_halves(right, depth - 1));
}

fn widest_axis(balls: &[Ball]) -> usize {
    let extent = |axis: usize| {
        let (low, high) = range(balls.iter().map(|ball| (ball.center[axis], ball.center[axis])));
        high - low
    };
    let extents = [extent(0), extent(1), extent(2)];
    (0..3).fold(0, |widest, axis| if extents[axis] > extents[widest] { axis } else { widest })
}

/// The part of the balls that has the place `place` after `level` halvings.
fn part(balls: &[Ball], level: u32, place: usize) -> &[Ball] {
    (0..level).rev().fold(balls, |part, bit| {
        let (left, right) = part.split_at(part.len() / 2);
        if place >> bit & 1 == 0 { left } else { right }
    })
}

fn bounds(balls: &[Ball]) -> Bounds {
    let center = std::array::from_fn(|axis| {
        let (low, high) = range(balls.iter().map(|b| (b.center[axis] - b.radius, b.center[axis] + b.radius)));
        0.5 * (low + high)
    });
    let reach = |ball: &Ball| {
        let offset: [f64; 3] = std::array::from_fn(|axis| ball.center[axis] - center[axis]);
        dot(offset, offset).sqrt() + ball.radius
    };
    Bounds { center, radius: balls.iter().map(reach).fold(0.0, f64::max) }
}

/// The least low and the greatest high.
fn range(spans: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    spans.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), span| (low.min(span.0), high.max(span.1)))
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::super::chord::Chord;
    use super::super::rays::unit;
    use super::*;

    fn coordinates(size: f32) -> impl Strategy<Value = [f32; 3]> {
        prop::array::uniform3(-size..size)
    }

    proptest! {
        #[test]
        fn every_ball_that_a_ray_meets_is_found_once(
            positions in vec(coordinates(10.0), 0..200),
            exponent in -4.0f32..1.0,
            shift in prop::sample::select(vec![0.0f32, 1e5]),
            from in 0usize..200,
            offset in coordinates(20.0),
            to in 0usize..200,
        ) {
            let positions: Vec<[f32; 3]> = positions.iter().map(|p| p.map(|c| c + shift)).collect();
            let radii: Vec<f32> = (0..positions.len()).map(|k| 10f32.powf(exponent - (k % 5) as f32 * 0.5)).collect();
            let weights: Vec<f32> = (0..positions.len()).map(|k| k as f32).collect();
            let at = |index: usize| positions.get(index).copied().unwrap_or([shift; 3]).map(f64::from);
            let origin = std::array::from_fn(|axis| at(from)[axis] + f64::from(offset[axis]));
            let toward = std::array::from_fn(|axis| at(to)[axis] - origin[axis]);
            let ray = Ray { origin, direction: unit(toward).unwrap_or([1.0, 0.0, 0.0]) };

            let tree = SphereTree::new(Balls::new(&positions, &radii, &weights).expect("balls")).expect("memory");
            let mut found = Vec::new();
            tree.visit(&ray, &mut |ball| found.extend(Chord::new(ball, &ray).map(|chord| chord.weight as usize)));
            found.sort_unstable();
            let is_met = |k: &usize| {
                let ball = Ball { center: positions[*k].map(f64::from), radius: f64::from(radii[*k]), weight: 0.0 };
                Chord::new(&ball, &ray).is_some()
            };
            let expected: Vec<usize> = (0..positions.len()).filter(is_met).collect();
            prop_assert_eq!(found, expected);
        }
    }

    #[test]
    fn balls_that_are_grazed_from_afar_are_found() {
        // Two balls side by side, whose bounding sphere ends where the first one ends. From this distance rounding moves the
        // ray by a hundred-thousandth of their radius.
        let (direction, across) = ([0.48, 0.6, 0.64], [0.8f32, 0.0, -0.6]);
        let mut met = 0;
        for k in 0..2000 {
            let radius = 1e-6 * (1.0 + 0.01 * (k % 97) as f32);
            let (positions, radii) = ([[0.0; 3], across.map(|c| -2.0 * radius * c)], [radius; 2]);
            let tree = SphereTree::new(Balls::new(&positions, &radii, &[1.0; 2]).expect("balls")).expect("memory");
            let ball = Ball { center: [0.0; 3], radius: f64::from(radius), weight: 1.0 };
            let offset = ball.radius * (1.0 + 1e-8 * f64::from(k - 1000));
            let origin = std::array::from_fn(|axis| offset * f64::from(across[axis]) - (1e5 + f64::from(k)) * direction[axis]);
            let ray = Ray { origin, direction };
            let mut found = 0;
            tree.visit(&ray, &mut |_| found += 1);
            assert!(found == 2 || Chord::new(&ball, &ray).is_none(), "{k}");
            met += usize::from(Chord::new(&ball, &ray).is_some());
        }
        assert!((500..1500).contains(&met), "{met}");
    }

    #[test]
    fn few_balls_are_looked_at() {
        let positions: Vec<[f32; 3]> =
            (0..100_000).map(|k| [(k % 100) as f32, (k / 100 % 100) as f32, (k / 10_000) as f32]).collect();
        let (radii, weights) = (vec![0.4; positions.len()], vec![1.0; positions.len()]);
        let tree = SphereTree::new(Balls::new(&positions, &radii, &weights).expect("balls")).expect("memory");
        let ray = Ray { origin: [-5.0, 50.0, 5.0], direction: [1.0, 0.0, 0.0] };
        let mut looked_at = 0;
        tree.visit(&ray, &mut |_| looked_at += 1);
        assert!((100..1500).contains(&looked_at), "{looked_at}");
    }
}
