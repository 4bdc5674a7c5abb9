//! Against closed forms: spheres, and what the shape of a surface says of its normals.

use super::disc::{Disc, Ray, TURNED};
use super::*;
use crate::balls::Balls;
use crate::field::Field;
use crate::kernel::tests::kernels;
use crate::surface_particles::Options;
use crate::tile_caster::{Attribute, NO_BALL};
use crate::vectors::{difference, dot, plus, unit};

const SIDE: usize = 61;
const FORWARD: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The particles of balls with the weight 1.
fn particles(positions: &[[f32; 3]], radii: &[f32], count: usize) -> SurfaceParticles {
    let weights = vec![1.0; radii.len()];
    let mut particles = SurfaceParticles::new(Options { count, ..Options::default() }).unwrap();
    let field = Field::new(kernels()[0].1, 0.2).unwrap();
    particles.seed(&Balls::new(positions, radii, &weights).unwrap(), None, field, &Job::default()).unwrap();
    particles
}

fn discs(particles: &SurfaceParticles) -> Vec<Disc> {
    let fluid = particles.fluid.as_ref().unwrap();
    particles.particles.iter().filter_map(|particle| Disc::new(fluid, particle, particles.reach, TURNED)).collect()
}

fn view(is_perspective: bool, eye: [f64; 3], clip: [f64; 2]) -> View {
    View { camera_from_world: FORWARD, eye, window: [-1.0, 1.0, -1.0, 1.0], is_perspective, width: SIDE, height: SIDE, clip }
}

/// Depths, normals, balls and an attribute.
struct Seen {
    depth: Vec<f32>,
    normal: Vec<[f32; 3]>,
    ball: Vec<i32>,
    attribute: Vec<[f32; 3]>,
}

fn seen(particles: &SurfaceParticles, view: &View, is_exact: bool, attribute: &[[f32; 3]]) -> Seen {
    let pixels = view.width * view.height;
    let mut seen = Seen {
        depth: vec![7.0; pixels],
        normal: vec![[7.0; 3]; pixels],
        ball: vec![7; pixels],
        attribute: vec![[7.0; 3]; pixels],
    };
    let attributes = vec![Attribute::new(attribute, seen.attribute.as_flattened_mut())];
    let normal = seen.normal.as_flattened_mut();
    let image = Image::new([view.width, view.height], 1e10, &mut seen.depth, normal, Some(&mut seen.ball), attributes).unwrap();
    particles.draw(Path::chosen().unwrap(), view, is_exact, &image, &Job::default()).unwrap();
    seen
}

#[test]
fn discs_bend_as_the_normals_of_the_surface_turn() {
    let particles = particles(&[[0.0, 0.0, 0.0], [0.7, 0.1, 0.2], [0.2, 0.8, -0.1]], &[1.0, 0.8, 1.1], 0);
    let fluid = particles.fluid.as_ref().unwrap();
    let normal_at = |point| unit(fluid.sample(point).gradient.map(|c| -c));
    let found = discs(&particles);
    assert_eq!(found.len(), particles.particles.len());
    for disc in found {
        let [right, up] = crate::vectors::tangents(disc.normal);
        for along in [right, up, unit(plus(right, 0.7, up))] {
            let step = 1e-5;
            let turned = difference(normal_at(plus(disc.middle, step, along)), normal_at(plus(disc.middle, -step, along)));
            let [xx, yy, zz, xy, xz, yz] = disc.bend;
            let bent = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]].map(|row| dot(row, along));
            let apart = difference(bent, turned.map(|c| c / (2.0 * step)));
            assert!(dot(apart, apart).sqrt() < 1e-4 * (1.0 + dot(bent, bent).sqrt()), "{bent:?} {turned:?}");
        }
    }
}

#[test]
fn the_disc_of_a_lone_ball_is_its_sphere() {
    let particles = particles(&[[1.0, 2.0, 3.0]], &[2.0], 0);
    let radius = 2.0 * particles.fluid.as_ref().unwrap().field().kernel_radius_share(1.0);
    for disc in discs(&particles) {
        for (number, element) in disc.bend.iter().enumerate() {
            let expected = if number < 3 { 1.0 / radius } else { 0.0 };
            assert!((element - expected).abs() < 1e-9 / radius, "{number}: {element}");
        }
    }
}

#[test]
fn a_ray_meets_the_face_that_looks_at_it_within_the_disc() {
    let disc = Disc { middle: [0.0, 0.0, 5.0], normal: [0.0, 0.0, -1.0], bend: [0.0; 6], radius: 1.0, turned: TURNED };
    let ray = |x: f64, start: f64| Ray { start: [x, 0.0, start], direction: [0.0, 0.0, 1.0] };
    let met = |x, inside, clip| disc.meeting(&ray(x, 0.0), inside, clip).map(|meeting| (meeting.distance, meeting.weight));
    assert_eq!(met(0.5, false, [0.1, 9.0]), Some((5.0, 0.5625)));
    assert_eq!(met(0.5, true, [0.1, 9.0]), None);
    assert_eq!(met(1.01, false, [0.1, 9.0]), None);
    assert_eq!([met(0.5, false, [5.1, 9.0]), met(0.5, false, [0.1, 4.9])], [None; 2]);
    // A million units away nothing is lost.
    let far = Disc { middle: [1e6, 0.0, 1e6], ..disc };
    let direction = unit([1.0, 0.0, 1.0]);
    let meeting = far.meeting(&Ray { start: [0.0; 3], direction }, false, [0.1, 1e7]).unwrap();
    assert!((meeting.distance - 1e6 * 2f64.sqrt()).abs() < 1e-8);
}

#[test]
fn a_lone_ball_is_drawn_exactly_in_both_ways() {
    for eye in [[0.0, 0.0, -4.0], [1e5, -1e5, 1e5 - 4.0]] {
        let center = [eye[0] as f32, eye[1] as f32, (eye[2] + 4.0) as f32];
        let particles = particles(&[center], &[1.0], 0);
        let radius = particles.fluid.as_ref().unwrap().field().kernel_radius_share(1.0);
        for (is_exact, is_perspective) in [(false, false), (true, false), (false, true), (true, true)] {
            let view = view(is_perspective, eye, [0.1, 100.0]);
            let found = seen(&particles, &view, is_exact, &[[3.0, 2.0, 1.0]]);
            let mut hits = 0;
            for pixel in 0..SIDE * SIDE {
                let [x, y] = view.pixel_center(pixel % SIDE, pixel / SIDE);
                let ([x, y], size) = if is_perspective { ([x, y], x * x + y * y + 1.0) } else { ([x, y], 1.0) };
                // The nearer root of the sphere's quadratic in the planar depth.
                let rest =
                    if is_perspective { 16.0 - size * (16.0 - radius * radius) } else { radius * radius - x * x - y * y };
                if rest.abs() < 1e-3 {
                    continue;
                }
                if rest < 0.0 {
                    assert_eq!((found.depth[pixel], found.ball[pixel]), (1e10, NO_BALL));
                    assert_eq!((found.normal[pixel], found.attribute[pixel]), ([0.0; 3], [0.0; 3]));
                    continue;
                }
                hits += 1;
                let depth = (4.0 - rest.sqrt()) / size;
                let normal = if is_perspective { [x * depth, y * depth, depth - 4.0] } else { [x, y, depth - 4.0] };
                assert!((f64::from(found.depth[pixel]) - depth).abs() < 1e-5);
                let normal = normal.map(|c| c / radius);
                assert!((0..3).all(|axis| (f64::from(found.normal[pixel][axis]) - normal[axis]).abs() < 1e-4));
                assert_eq!((found.ball[pixel], found.attribute[pixel]), (0, [3.0, 2.0, 1.0]));
            }
            assert!(hits > 60, "{hits}");
        }
    }
}

#[test]
fn rays_that_start_in_the_fluid_see_it_from_within() {
    let particles = particles(&[[0.0; 3]], &[2.0], 0);
    let radius = 2.0 * particles.fluid.as_ref().unwrap().field().kernel_radius_share(1.0);
    let found = seen(&particles, &view(true, [0.0; 3], [0.01, 100.0]), true, &[[1.0; 3]]);
    let middle = SIDE * SIDE / 2;
    assert!((f64::from(found.depth[middle]) - radius).abs() < 1e-5);
    assert!((found.normal[middle][2] - 1.0).abs() < 1e-6);
    assert!(found.depth.iter().all(|depth| *depth < 1e10));
}

#[test]
fn a_place_without_a_gradient_has_a_flat_disc() {
    // Two balls at one point carve each other away: there is no gradient anywhere.
    let (positions, radii, weights) = ([[0.0f32; 3]; 2], [1.0f32; 2], [1.0f32, -1.0]);
    let field = Field::new(kernels()[0].1, 0.2).unwrap();
    let balls = Balls::new(&positions, &radii, &weights).unwrap();
    let fluid = Fluid::new(&balls, None, field, 0.3).unwrap();
    let bend = super::disc::bend([0.0, 0.0, 1.0], fluid.second_derivatives([0.1; 3]), fluid.sample([0.1; 3]).gradient);
    assert_eq!(bend, [0.0; 6]);
}

#[test]
fn what_does_not_fit_is_refused() {
    let image_of =
        |depth: &mut [f32], normal: &mut [[f32; 3]], view: &View, particles: &SurfaceParticles, rows: &[[f32; 3]]| {
            let mut attribute = vec![0.0; 3 * SIDE * SIDE];
            let attributes = vec![Attribute::new(rows, &mut attribute)];
            let image = Image::new([SIDE, SIDE], 1e10, depth, normal.as_flattened_mut(), None, attributes).unwrap();
            particles.draw(Path::chosen().unwrap(), view, true, &image, &Job::default())
        };
    let (mut depth, mut normal) = (vec![0.0; SIDE * SIDE], vec![[0.0; 3]; SIDE * SIDE]);
    let ball = particles(&[[0.0; 3]], &[1.0], 0);
    let whole = view(true, [0.0, 0.0, -4.0], [0.1, 100.0]);
    let mut refused = |view: &View, particles: &SurfaceParticles, rows: &[[f32; 3]]| {
        image_of(&mut depth, &mut normal, view, particles, rows).is_err()
    };
    assert!(!refused(&whole, &ball, &[[0.0; 3]]));
    assert!(refused(&whole, &ball, &[]));
    assert!(refused(&View { width: 7, ..whole }, &ball, &[[0.0; 3]]));
    assert!(refused(&View { clip: [2.0, 1.0], ..whole }, &ball, &[[0.0; 3]]));
    assert!(refused(&whole, &SurfaceParticles::new(Options::default()).unwrap(), &[]));
}
