//! What holds for any scene and any ray, and the cases that have no digits to spare.

use proptest::collection::vec;
use proptest::prelude::*;

use super::*;
use crate::kernel::Kernel;
use crate::kernel::tests::kernels;

/// Balls that own their arrays, a field and a ray.
#[derive(Clone, Debug)]
struct Scene {
    positions: Vec<[f32; 3]>,
    radii: Vec<f32>,
    weights: Vec<f32>,
    field: Field,
    origin: [f64; 3],
    direction: [f64; 3],
}

impl Scene {
    fn new(balls: &[([f32; 3], f32, f32)], kernel: &str, isovalue: f64) -> Self {
        Self {
            positions: balls.iter().map(|ball| ball.0).collect(),
            radii: balls.iter().map(|ball| ball.1).collect(),
            weights: balls.iter().map(|ball| ball.2).collect(),
            field: Field::new(named(kernel), isovalue).expect("a field"),
            origin: [0.0, -4.0, 0.0],
            direction: [0.0, 1.0, 0.0],
        }
    }

    fn seen(&self, origin: [f64; 3], direction: [f64; 3]) -> Self {
        Self { origin, direction, ..self.clone() }
    }

    fn balls(&self) -> Balls<'_> {
        Balls::new(&self.positions, &self.radii, &self.weights).expect("balls")
    }

    fn first(&self) -> (f64, [f64; 3]) {
        let (origins, directions) = ([self.origin], [self.direction]);
        let rays = Rays::new(&origins, &directions).expect("rays");
        let first = cast(self.balls(), self.field, rays, &Job::default()).expect("no error");
        (first.t[0], first.normals[0])
    }

    fn crossings(&self) -> Vec<(f64, bool)> {
        let (origins, directions) = ([self.origin], [self.direction]);
        let rays = Rays::new(&origins, &directions).expect("rays");
        let all = crossings(self.balls(), self.field, rays, &Job::default()).expect("no error");
        assert!(all.rays.iter().all(|ray| *ray == 0));
        all.t.into_iter().zip(all.is_entering).collect()
    }

    fn point(&self, t: f64) -> [f64; 3] {
        let direction = rays::unit(self.direction).expect("not 0");
        std::array::from_fn(|axis| self.origin[axis] + t * direction[axis])
    }

    /// The field less the isovalue, by its definition.
    fn excess(&self, t: f64) -> f64 {
        let point = self.point(t);
        let share = |k: usize| {
            let offset: [f64; 3] = std::array::from_fn(|axis| point[axis] - f64::from(self.positions[k][axis]));
            let x = 1.0 - rays::dot(offset, offset) / f64::from(self.radii[k]).powi(2);
            f64::from(self.weights[k]) * self.field.kernel.value(x)
        };
        (0..self.radii.len()).map(share).sum::<f64>() - self.field.isovalue
    }

    /// Whether each of the crossings is plain enough to be the same after rounding in another way.
    fn is_plain(&self) -> bool {
        let found = self.crossings();
        let steep = |t: f64| (self.excess(t + 1e-5) - self.excess(t - 1e-5)).abs() > 1e-8;
        found.iter().all(|(t, _)| steep(*t)) && found.windows(2).all(|pair| pair[1].0 - pair[0].0 > 1e-4)
    }
}

fn named(kernel: &str) -> Kernel {
    kernels().into_iter().find(|(name, _)| *name == kernel).expect("a kernel").1
}

/// Up to a dozen balls, some of which carve, on a grid of 1/1024 so that they can be moved exactly, and a ray among them.
fn scene() -> impl Strategy<Value = Scene> {
    let grid = || prop::array::uniform3(-1024i16..1024).prop_map(|p| p.map(|c| f32::from(c) / 1024.0));
    let ball = (grid(), 0.2f32..1.2, prop_oneof![3 => 0.3f32..1.3, 1 => -1.0f32..-0.2]);
    let name = prop::sample::select(kernels().map(|(name, _)| name).to_vec());
    (vec(ball, 1..12), name, 0.1..0.5, grid(), grid(), 0.0..4.0).prop_map(|(balls, kernel, isovalue, from, to, back)| {
        let direction = std::array::from_fn(|axis| f64::from(to[axis] - from[axis]) + f64::from(axis == 0) / 2048.0);
        let unit = rays::unit(direction).expect("not 0");
        let origin = std::array::from_fn(|axis| f64::from(from[axis]) - back * unit[axis]);
        Scene::new(&balls, kernel, isovalue).seen(origin, direction)
    })
}

fn check_same(found: &[(f64, bool)], expected: &[(f64, bool)]) -> std::result::Result<(), TestCaseError> {
    prop_assert_eq!(found.len(), expected.len(), "{:?} {:?}", found, expected);
    for (a, b) in found.iter().zip(expected) {
        prop_assert!((a.0 - b.0).abs() < 1e-8 && a.1 == b.1, "{:?} {:?}", found, expected);
    }
    Ok(())
}

proptest! {
    #[test]
    fn crossings_alternate_and_the_density_there_is_the_isovalue(scene in scene()) {
        let found = scene.crossings();
        let mut is_inside = scene.excess(0.0) > 0.0;
        let mut last = 0.0;
        for (t, is_entering) in &found {
            prop_assert!(*t > last);
            prop_assert_eq!(*is_entering, !is_inside);
            prop_assert!(scene.excess(*t).abs() < 2e-14, "{}", scene.excess(*t));
            last = *t;
            is_inside = *is_entering;
        }
        prop_assert!(!is_inside, "a ray ends outside");
    }

    #[test]
    fn between_crossings_the_density_stays_on_one_side(scene in scene()) {
        let found = scene.crossings();
        for step in 0..2000 {
            let t = f64::from(step) * 0.005;
            let is_inside = found.iter().rfind(|(at, _)| *at <= t).map_or(
                found.first().is_some_and(|(_, is_entering)| !is_entering),
                |(_, is_entering)| *is_entering,
            );
            let excess = scene.excess(t);
            prop_assert!((excess > 0.0) == is_inside || excess.abs() < 1e-13, "{} at {}", excess, t);
        }
    }

    #[test]
    fn the_first_crossing_is_the_first_of_all(scene in scene()) {
        let (t, normal) = scene.first();
        let found = scene.crossings();
        prop_assert_eq!(t, found.first().map_or(f64::INFINITY, |(t, _)| *t));
        if let Some((_, is_entering)) = found.first() {
            prop_assert!((rays::dot(normal, normal) - 1.0).abs() < 1e-14);
            let direction = rays::unit(scene.direction).expect("not 0");
            prop_assert!(rays::dot(normal, direction) < 1e-7 || !is_entering, "a ray enters against the normal");
            prop_assert!(rays::dot(normal, direction) > -1e-7 || *is_entering, "a ray leaves along the normal");
        } else {
            prop_assert_eq!(normal, [0.0; 3]);
        }
    }

    #[test]
    fn backwards_the_same_crossings_are_met(scene in scene()) {
        prop_assume!(scene.is_plain());
        let far = 20.0;
        let mut expected: Vec<(f64, bool)> = scene.crossings().iter().map(|(t, enters)| (far - t, !enters)).collect();
        expected.reverse();
        let mut found = scene.seen(scene.point(far), scene.direction.map(|d| -d)).crossings();
        // What lies behind the start.
        found.retain(|(t, _)| *t < far);
        check_same(&found, &expected)?;
    }

    #[test]
    fn moved_turned_and_mirrored_scenes_have_the_same_crossings(scene in scene(), axis in 0usize..3, flips in 0u8..8, far in 0i8..9) {
        prop_assume!(scene.is_plain());
        // Exact in float32: a place on the grid, and a turn by right angles.
        let sign = |k: usize| if flips >> k & 1 == 1 { -1.0 } else { 1.0 };
        let turned = |p: [f64; 3]| std::array::from_fn(|k| sign(k) * p[(k + axis) % 3]);
        let moved = |p: [f64; 3]| turned(p).map(|c: f64| c + f64::from(far) * 512.0);
        let positions = scene.positions.iter().map(|p| moved(p.map(f64::from)).map(|c| c as f32)).collect();
        let other = Scene { positions, ..scene.clone() }.seen(moved(scene.origin), turned(scene.direction));
        check_same(&other.crossings(), &scene.crossings())?;
    }

    #[test]
    fn the_order_of_the_balls_does_not_matter(scene in scene(), turn in 0usize..12) {
        prop_assume!(scene.is_plain());
        let mut other = scene.clone();
        let turn = turn % scene.radii.len();
        other.positions.rotate_left(turn);
        other.radii.rotate_left(turn);
        other.weights.rotate_left(turn);
        check_same(&other.crossings(), &scene.crossings())?;
    }

    #[test]
    fn a_ball_may_be_split_into_coincident_ones(scene in scene(), which in 0usize..12) {
        prop_assume!(scene.is_plain());
        let mut other = scene.clone();
        let which = which % scene.radii.len();
        other.positions.extend([scene.positions[which]; 2]);
        other.radii.extend([scene.radii[which]; 2]);
        other.weights[which] *= 0.5;
        other.weights.extend([0.25 * scene.weights[which]; 2]);
        check_same(&other.crossings(), &scene.crossings())?;
    }

    #[test]
    fn the_length_of_a_direction_does_not_matter(scene in scene(), exponent in -300i32..300) {
        let scale = 2f64.powi(exponent);
        prop_assert_eq!(scene.seen(scene.origin, scene.direction.map(|d| d * scale)).crossings(), scene.crossings());
    }

    #[test]
    fn numbers_of_any_size_give_numbers(
        balls in vec((prop::array::uniform3(any::<f32>()), any::<f32>(), any::<f32>()), 1..6),
        origin in prop::array::uniform3(any::<f64>()),
        direction in prop::array::uniform3(any::<f64>()),
        aim in any::<bool>(),
    ) {
        let finite = |v: f32| if v.is_finite() { v } else { 1.0 };
        let balls: Vec<_> = balls.iter().map(|(p, r, q)| (p.map(finite), finite(*r).abs().max(1e-45), finite(*q))).collect();
        let place = balls[0].0.map(f64::from);
        let origin = if aim { place } else { origin.map(|o| if o.is_finite() { o } else { 1.0 }) };
        let direction = direction.map(|d| if d.is_finite() && d != 0.0 { d } else { 1.0 });
        for (name, _) in kernels() {
            let (t, normal) = Scene::new(&balls, name, 0.3).seen(origin, direction).first();
            prop_assert!(t > 0.0);
            let length = rays::dot(normal, normal);
            let expected = if t.is_finite() { 1.0 } else { 0.0 };
            prop_assert!((length - expected).abs() < 1e-12, "{} {}", t, length);
        }
    }
}

const UP: [f64; 3] = [0.0, 1.0, 0.0];
const DOWN: [f64; 3] = [0.0, -1.0, 0.0];
const AT_ZERO: [f32; 3] = [0.0; 3];

#[test]
fn a_ray_that_starts_on_the_surface_does_not_see_it_there() {
    // 1 - r^2 = 3/4 at r = 1/2, without rounding.
    let ball = Scene::new(&[(AT_ZERO, 1.0, 1.0)], "power_1", 0.75);
    assert_eq!(ball.seen([0.0, -0.5, 0.0], UP).crossings(), [(1.0, false)]);
    assert_eq!(ball.seen([0.0, -0.5, 0.0], DOWN).crossings(), []);
}

#[test]
fn a_ray_that_touches_does_not_cross() {
    let ball = Scene::new(&[(AT_ZERO, 1.0, 1.0)], "power_1", 0.75);
    assert_eq!(ball.seen([0.5, -4.0, 0.0], UP).crossings(), []);
    assert_eq!(ball.seen([0.5 - 1e-9, -4.0, 0.0], UP).crossings().len(), 2);
    // The density comes up to the isovalue at the centre only.
    assert_eq!(Scene::new(&[(AT_ZERO, 1.0, 0.5)], "quartic", 0.5).crossings(), []);
}

#[test]
fn a_slit_that_closes_at_one_point_is_not_crossed() {
    // Seen from within: the density falls to the isovalue at the centre of the ball that carves, and rises again.
    let slit = |carved: f32| Scene::new(&[(AT_ZERO, 4.0, 1.0), (AT_ZERO, 1.0, carved)], "quartic", 0.5);
    assert_eq!(slit(-0.5).seen([0.0, -0.9, 0.0], UP).crossings().len(), 1);
    assert_eq!(slit(-0.5 - 1e-6).seen([0.0, -0.9, 0.0], UP).crossings().len(), 3);
}

#[test]
fn a_stretch_on_the_isovalue_is_not_in_the_fluid() {
    // 4 (1 - r^2 / 4) - (1 - r^2) = 3 where r < 1, less beyond.
    let plateau = |isovalue| Scene::new(&[(AT_ZERO, 2.0, 4.0), (AT_ZERO, 1.0, -1.0)], "power_1", isovalue);
    assert_eq!(plateau(3.0).crossings(), []);
    assert_eq!(plateau(3.0).seen([0.0; 3], UP).crossings(), []);
    assert_eq!(plateau(2.75).crossings().len(), 2);
    assert_eq!(plateau(3.25).crossings(), []);
}

#[test]
fn a_crossing_where_the_density_is_level_faces_along_the_ray() {
    // One ball comes down from the isovalue at its centre; there the next one begins, and outweighs it.
    let saddle = Scene::new(&[(AT_ZERO, 1.0, 0.5), ([0.0, 1.0, 0.0], 1.0, 1.0)], "quartic", 0.5);
    let (t, normal) = saddle.first();
    assert!((t - 4.0).abs() < 1e-7, "{t}");
    assert_eq!(normal, [0.0, -1.0, 0.0]);
}

#[test]
fn surfaces_at_the_ends_of_influence_spheres_count_once() {
    // With x as the kernel the density has a crease where the small ball begins and ends: there it is the isovalue.
    let creased = |carved: f32| Scene::new(&[(AT_ZERO, 1.0, 1.0), (AT_ZERO, 0.5, carved)], "power_1", 0.75);
    assert_eq!(creased(0.5).crossings(), [(3.5, true), (4.5, false)]);
    assert_eq!(creased(-0.5).crossings(), []);
    // A row of balls, each of which begins where another ends.
    let row = [([0.0, 0.0, 0.0], 1.0, 1.0), ([0.0, 1.0, 0.0], 1.0, 1.0), ([0.0, 2.0, 0.0], 1.0, 1.0)];
    assert_eq!(Scene::new(&row, "power_1", 0.75).crossings(), [(3.5, true), (6.5, false)]);
}

#[test]
fn a_ball_that_begins_where_the_density_is_level_adds_no_crossings() {
    // The small ball begins near the top of the large one, which is barely over the isovalue. The distance of that place is
    // rounded to 1e-11; the density of the small ball there would be off by 1e-8 to either side, if it were not taken for 0.
    let small = 1.0 / 1024.0;
    for step in 0..200 {
        let distance = 1e5 + f64::from(step);
        let begins = ([1e-4 + 5e-7 * step as f32, small, 0.0], small, 1.0);
        let scene = Scene::new(&[(AT_ZERO, 1.0, 1.0), begins], "power_1", 1.0 - 1e-9);
        let found = scene.seen([0.0, -distance, 0.0], UP).crossings();
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0].0 - (distance - 1e-9f64.sqrt())).abs() < 1e-10, "{found:?}");
    }
}

#[test]
fn nothing_is_seen_without_balls_or_rays() {
    assert_eq!(Scene::new(&[], "wyvill", 0.2).crossings(), []);
    let scene = Scene::new(&[(AT_ZERO, 1.0, 1.0)], "wyvill", 0.2);
    let none = Rays::new(&[], &[]).expect("rays");
    assert!(none.is_empty());
    assert_eq!(cast(scene.balls(), scene.field, none, &Job::default()), Ok(FirstCrossings::default()));
    assert_eq!(crossings(scene.balls(), scene.field, none, &Job::default()), Ok(Crossings::default()));
}

#[test]
fn many_rays_are_told_apart_and_the_work_is_counted() {
    let scene = Scene::new(&[(AT_ZERO, 1.0, 1.0)], "power_1", 0.75);
    let origins: Vec<[f64; 3]> = (0..1000).map(|k| [if k % 3 == 0 { 0.0 } else { 2.0 }, -f64::from(k + 1), 0.0]).collect();
    let directions = vec![UP; 1000];
    let rays = Rays::new(&origins, &directions).expect("rays");
    let job = Job::default();
    let all = crossings(scene.balls(), scene.field, rays, &job).expect("no error");
    assert_eq!(job.progress(), 1.0);
    let first = cast(scene.balls(), scene.field, rays, &Job::default()).expect("no error");
    for (k, t) in first.t.iter().enumerate() {
        let expected = if k % 3 == 0 { k as f64 + 0.5 } else { f64::INFINITY };
        assert!(*t == expected || (*t - expected).abs() < 1e-12, "{t} {expected}");
    }
    assert_eq!(all.rays.len(), 2 * 334);
    for (pair, ray) in all.rays.chunks(2).zip((0..1000).step_by(3)) {
        assert_eq!(pair, [ray, ray]);
    }
}

#[test]
fn the_user_can_give_up() {
    let scene = Scene::new(&[(AT_ZERO, 1.0, 1.0)], "wyvill", 0.2);
    let (origins, directions) = ([scene.origin], [scene.direction]);
    let rays = Rays::new(&origins, &directions).expect("rays");
    let job = Job::default();
    job.cancel();
    assert_eq!(cast(scene.balls(), scene.field, rays, &job), Err(crate::error::Error::Cancelled));
    assert_eq!(crossings(scene.balls(), scene.field, rays, &job), Err(crate::error::Error::Cancelled));
}
