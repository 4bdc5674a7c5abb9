//! Triangles against every one of them tested by itself, and what surfaces do to light against formulas.

use proptest::prelude::*;

use super::random;
use super::triangles::{TriangleCaster, TriangleHit};
use super::*;
use crate::fitted_bvh::ray::Ray;
use crate::shading::material::{Parameters, Triple};
use crate::simd::{LANES, Lanes, Vector};
use crate::vectors::{along, cross, difference, dot, plus, tangents, unit};

/// Casts one ray at triangles.
struct Shot<'a> {
    triangles: &'a Triangles,
    ray: Ray,
    any: bool,
}

impl Task for Shot<'_> {
    type Output = Option<TriangleHit>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<TriangleHit> {
        TriangleCaster::new(simd, self.triangles).hit(&self.ray, self.any)
    }
}

fn hit(path: Path, triangles: &Triangles, origin: [f64; 3], direction: [f64; 3]) -> Option<TriangleHit> {
    let ray = Ray { origin, direction: unit(direction), t_min: 0.0, t_max: f64::INFINITY };
    let first = path.dispatch(Shot { triangles, ray, any: false });
    assert_eq!(first.is_some(), path.dispatch(Shot { triangles, ray, any: true }).is_some());
    first
}

/// A square in the plane z = 0 of so many rows of squares, each of two triangles.
fn grid(rows: i32) -> (Vec<[f32; 3]>, Vec<[i32; 3]>) {
    let corner = |index: i32| [(index % (rows + 1)) as f32, (index / (rows + 1)) as f32, 0.0];
    let square = |index: i32| {
        let low = index / rows * (rows + 1) + index % rows;
        let high = low + rows + 1;
        [[low, low + 1, high + 1], [low, high + 1, high]]
    };
    ((0..(rows + 1).pow(2)).map(corner).collect(), (0..rows * rows).flat_map(square).collect())
}

#[test]
fn no_ray_passes_between_triangles() {
    let (vertices, triangles) = grid(8);
    let tree = Triangles::build(&vertices, &triangles, &Job::default()).unwrap();
    for path in Path::available() {
        for index in 0..64 * 64 {
            // At corners, on edges and diagonals and between, from different sides.
            let place = [f64::from(index % 64 + 1) / 8.125, f64::from(index / 64 + 1) / 8.125, 0.0];
            for origin in [[4.0, 4.0, 3.0], [place[0], place[1], -2.0], [-5.0, 1.0, 0.25]] {
                let met = hit(path, &tree, origin, difference(place, origin));
                let met = met.unwrap_or_else(|| panic!("{path:?}: a ray from {origin:?} to {place:?} meets nothing"));
                let reached = plus(origin, met.t, unit(difference(place, origin)));
                assert!(difference(reached, place).into_iter().all(|c| c.abs() < 1e-9));
            }
        }
        for diagonal in 0..32 {
            let place = [f64::from(diagonal) / 4.0; 2];
            for origin in [[place[0], place[1], 1.0], [3.0, 3.0, 1.0]] {
                let place = [place[0], place[1], 0.0];
                assert!(hit(path, &tree, origin, difference(place, origin)).is_some(), "{path:?}: diagonal at {place:?}");
            }
        }
    }
}

type Corners = [[f32; 3]; 3];

/// The nearest triangle that a ray meets, and how near the ray comes to an edge of any.
fn nearest(corners: &[Corners], origin: [f64; 3], direction: [f64; 3]) -> (Option<(usize, f64)>, f64) {
    let (mut best, mut margin) = (None, f64::INFINITY);
    for (index, triangle) in corners.iter().enumerate() {
        let [a, b, c] = triangle.map(|corner| corner.map(f64::from));
        let (ab, ac) = (difference(b, a), difference(c, a));
        let normal = cross(ab, ac);
        let (slope, toward) = (dot(normal, direction), difference(a, origin));
        let t = dot(normal, toward) / slope;
        let across = cross(direction, toward);
        let (u, v) = (-dot(across, ac) / slope, dot(across, ab) / slope);
        margin = margin.min(u.abs()).min(v.abs()).min((1.0 - u - v).abs()).min(t.abs());
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 && best.is_none_or(|(_, least)| t < least) {
            best = Some((index, t));
        }
    }
    (best, margin)
}

fn any_vector(size: f32) -> impl Strategy<Value = [f32; 3]> {
    prop::array::uniform3(-size..size)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]
    #[test]
    #[cfg_attr(miri, ignore = "too slow")]
    fn the_nearest_triangle_is_found(
        places in prop::collection::vec((any_vector(4.0), any_vector(1.0), any_vector(1.0)), 0..300),
        shots in prop::collection::vec((any_vector(6.0), any_vector(1.0)), 50),
    ) {
        let corners: Vec<Corners> = places.iter().map(|(a, b, c)| {
            [*a, std::array::from_fn(|axis| a[axis] + b[axis]), std::array::from_fn(|axis| a[axis] + c[axis])]
        }).collect();
        let vertices: Vec<_> = corners.iter().flatten().copied().collect();
        let triangles: Vec<_> = (0..corners.len() as i32).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect();
        let tree = Triangles::build(&vertices, &triangles, &Job::default()).unwrap();
        for (origin, direction) in shots {
            let (origin, direction) = (origin.map(f64::from), unit(direction.map(f64::from)));
            let (expected, margin) = nearest(&corners, origin, direction);
            // Beside an edge, single precision may say otherwise.
            if margin < 1e-4 || direction == [0.0; 3] {
                continue;
            }
            for path in Path::available() {
                let met = hit(path, &tree, origin, direction);
                prop_assert_eq!(met.map(|met| met.triangle), expected.map(|(index, _)| index));
                if let (Some(met), Some((index, t))) = (met, expected) {
                    prop_assert!((met.t - t).abs() < 1e-9 * (1.0 + t));
                    let [a, b, c] = corners[index].map(|corner| corner.map(f64::from));
                    let [u, v] = met.shares;
                    let place = plus(plus(a, u, difference(b, a)), v, difference(c, a));
                    let reached = plus(origin, met.t, direction);
                    prop_assert!(difference(place, reached).into_iter().all(|c| c.abs() < 1e-6));
                }
            }
        }
    }
}

#[test]
fn triangles_of_one_place_and_of_no_area_are_taken() {
    let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let triangles = [vec![[0, 1, 2]; 100], vec![[0, 0, 0]; 50], vec![[0, 1, 1]; 50]].concat();
    let tree = Triangles::build(&vertices, &triangles, &Job::default()).unwrap();
    for path in Path::available() {
        let met = hit(path, &tree, [0.2, 0.2, 1.0], [0.0, 0.0, -1.0]).unwrap();
        assert!((met.t - 1.0).abs() < 1e-12 && met.triangle < 100);
        assert_eq!(hit(path, &tree, [0.8, 0.8, 1.0], [0.0, 0.0, -1.0]), None);
    }
}

#[test]
fn unusable_triangles_are_told() {
    let job = Job::default();
    for wrong in [[0, 1, 3], [0, -1, 2]] {
        assert!(Triangles::build(&[[0.0; 3]; 3], &[wrong], &job).is_err());
    }
    assert!(Triangles::build(&[[0.0, f32::NAN, 0.0]; 3], &[[0, 1, 2]], &job).is_err());
    assert_eq!(Triangles::build(&[], &[], &job).unwrap().len(), 0);
    job.cancel();
    assert_eq!(Triangles::build(&[[0.0; 3]; 3], &[[0, 1, 2]], &job).unwrap_err(), Error::Cancelled);
}

/// What sixteen materials of an index of refraction reflect at angles of these cosines, seen from without or from within.
struct Reflectance {
    ior: f32,
    cosines: [f32; LANES],
    from_within: bool,
}

impl Task for Reflectance {
    type Output = [f32; LANES];

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> [f32; LANES] {
        let material = Material {
            metallic: 0.0,
            roughness: 0.0,
            transmission: 1.0,
            ior: self.ior,
            emission: [0.0; 3],
            color: [1.0; 3],
            absorption: [0.0; 3],
        };
        let mut parameters = Parameters::gathered(simd, &[material], &[0; LANES]);
        parameters.turn_inside_out(simd, simd.mask(if self.from_within { u16::MAX } else { 0 }));
        let white = Triple::splat(simd, [1.0; 3]);
        parameters.meet(simd, simd.load(&Lanes(self.cosines)), simd.splat(1.0), white).reflected.0[0].lanes().0
    }
}

#[test]
fn as_much_is_reflected_from_either_side() {
    for path in Path::available() {
        for ior in [0.7f32, 1.0, 1.33, 1.5, 2.4] {
            let cosines: [f32; LANES] = std::array::from_fn(|lane| (lane as f32 + 0.5) / 16.0);
            let outside = path.dispatch(Reflectance { ior, cosines, from_within: false });
            let behind = cosines.map(|x| 1.0 - (1.0 - x * x) / (ior * ior));
            let inside = path.dispatch(Reflectance { ior, cosines: behind.map(|y| y.max(0.0).sqrt()), from_within: true });
            for lane in 0..LANES {
                // Where nothing enters, all is reflected.
                let expected = if behind[lane] < 0.0 { 1.0 } else { inside[lane] };
                assert!((outside[lane] - expected).abs() < 5e-5, "{path:?}, {ior}: {} {expected}", outside[lane]);
            }
            let total = path.dispatch(Reflectance { ior, cosines: [0.1; LANES], from_within: true });
            assert_eq!(total[0] > 0.999, ior > 1.01);
        }
    }
}

#[test]
fn tangents_are_at_right_angles() {
    for index in 0..500 {
        let normal = along([0.0, 0.0, if index % 2 == 0 { 1.0 } else { -1.0 }], random::by_cosine(random::square(3, index)));
        let [right, up] = tangents(normal);
        for (a, b) in [(right, up), (right, normal), (up, normal)] {
            assert!(dot(a, b).abs() < 1e-12);
        }
        assert!((dot(right, right) - 1.0).abs() < 1e-12 && (dot(up, up) - 1.0).abs() < 1e-12);
    }
}
