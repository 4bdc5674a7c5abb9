//! Against closed forms: spheres, whose surface is known.

use super::hash::BallHash;
use super::*;
use crate::kernel::tests::kernels;
use crate::vectors::difference;

fn field(isovalue: f64) -> Field {
    Field::new(kernels()[0].1, isovalue).unwrap()
}

/// The particles of balls that stand still.
fn particles(positions: &[[f32; 3]], radii: &[f32], options: Options) -> SurfaceParticles {
    let weights = vec![1.0; radii.len()];
    let mut particles = SurfaceParticles::new(options).unwrap();
    particles.seed(&Balls::new(positions, radii, &weights).unwrap(), None, field(0.2), &Job::default()).unwrap();
    particles
}

/// The distances to the nearest other particle.
fn nearest(particles: &[Particle]) -> Vec<f64> {
    let distance = |one: &Particle, other: &Particle| {
        let offset = difference(double(one.position), double(other.position));
        dot(offset, offset).sqrt()
    };
    let others = |one: &Particle| {
        particles.iter().filter(|other| other.id != one.id).map(|other| distance(one, other)).fold(f64::INFINITY, f64::min)
    };
    particles.par_iter().map(others).collect()
}

fn variation(numbers: &[f64]) -> f64 {
    let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
    (numbers.iter().map(|number| (number - mean).powi(2)).sum::<f64>() / numbers.len() as f64).sqrt() / mean
}

#[test]
fn a_lone_ball_is_covered_evenly() {
    for steps in [0, 4, 10] {
        let found = particles(&[[1.0, 2.0, 3.0]], &[2.0], Options { count: 1000, steps, ..Options::default() });
        let radius = 2.0 * field(0.2).kernel_radius_share(1.0);
        assert_eq!(found.particles().len(), 1000);
        for particle in found.particles() {
            let offset = difference(double(particle.position), [1.0, 2.0, 3.0]);
            assert!((dot(offset, offset).sqrt() - radius).abs() < 1e-5 * radius);
            assert!(dot(unit(offset), double(particle.normal)) > 0.99999);
        }
        let even = even_distance(4.0 * std::f64::consts::PI * radius * radius, 1000);
        let distances = nearest(found.particles());
        assert!(variation(&distances) < if steps < 4 { 0.15 } else { 0.1 });
        assert!(distances.iter().all(|distance| *distance > 0.55 * even));
        // Measured before the steps, where random places have more neighbours than even ones.
        assert!(steps == 0 || (2.0 * found.reach / (REACH * even) - 1.0).abs() < 0.04, "{}", found.reach / even);
    }
}

#[test]
fn the_hash_finds_each_ball_that_reaches_once() {
    let random = |index: u32, axis: u32| mixed(branch(7, index * 4 + axis)) as f32 / u32::MAX as f32;
    let positions: Vec<[f32; 3]> = (0..300).map(|index| [0, 1, 2].map(|axis| 4.0 * random(index, axis) - 2.0)).collect();
    let radii: Vec<f32> = (0..300).map(|index| 10f32.powf(-2.5 * random(index, 3))).collect();
    for share in [0.2, 1.0 / 3.0, 1.0] {
        let hash = BallHash::new(&positions, &radii, share).unwrap();
        for point in positions.iter().map(|position| double(position.map(|c| c + 0.01))) {
            let mut found = Vec::new();
            hash.for_near(point, |ball| found.push(ball));
            let met = found.len();
            found.sort_unstable();
            found.dedup();
            assert_eq!(found.len(), met);
            for ball in 0..300 {
                let offset = difference(point, double(positions[ball]));
                if dot(offset, offset) < f64::from(radii[ball]).powi(2) {
                    assert!(found.binary_search(&ball).is_ok());
                }
            }
        }
    }
}

#[test]
fn probes_are_all_over_the_surface() {
    let random = |index: u32, axis: u32| f64::from(mixed(branch(9, index * 4 + axis))) / f64::from(u32::MAX);
    let count = 150;
    let positions: Vec<[f32; 3]> = (0..count).map(|index| [0, 1, 2].map(|axis| 2.0 * random(index, axis) as f32)).collect();
    let spacing = 0.2;
    for (greatest, weight) in [(1.0, 1.0), (8.0, 1.0), (1.0, 0.15), (1.0, -0.3)] {
        let radii: Vec<f32> = (0..count).map(|index| (0.4 * f64::powf(greatest, -random(index, 3))) as f32).collect();
        // A few are different.
        let weights: Vec<f32> = (0..count).map(|index| if index % 10 == 0 { weight } else { 1.0 }).collect();
        let fluid = Fluid::new(&Balls::new(&positions, &radii, &weights).unwrap(), None, field(0.2), 0.5).unwrap();
        let probes = probes(&fluid, spacing, |_| true, 5, &Job::default()).unwrap();
        let starts = (0..20_000).map(|index| [4, 5, 6].map(|axis| 2.6 * random(index * 8, axis) - 0.3));
        let points: Vec<SurfacePoint> = starts.filter_map(|start| fluid.projected(start)).collect();
        assert!(points.len() > 2000);
        let is_near = |point: &SurfacePoint, other: &SurfacePoint, share: f64| {
            let offset = difference(point.position, other.position);
            dot(offset, offset) < (share * point.scale.min(other.scale)).powi(2) && dot(point.normal, other.normal) > 0.0
        };
        let is_bare = |point: &&SurfacePoint| !probes.iter().any(|probe| is_near(point, probe, GAP / PROBE_SPACING * spacing));
        let bare = points.par_iter().filter(is_bare).count();
        // But small cavities, which are seen from nowhere.
        assert!(bare * 300 <= points.len(), "{bare} of {} where the sizes are {greatest} and weights {weight}", points.len());
    }
}

#[test]
fn a_surface_is_probed_by_the_balls_that_are_next_to_it() {
    let fluid = |positions: &[[f32; 3]]| {
        let ones = vec![1.0; positions.len()];
        Fluid::new(&Balls::new(positions, &ones, &ones).unwrap(), None, field(0.2), 0.5).unwrap()
    };
    let radius = field(0.2).kernel_radius_share(1.0);
    let sphere = 4.0 * std::f64::consts::PI * radius * radius;
    assert!((exposed_area(&fluid(&[[0.0; 3], [5.0, 0.0, 0.0]]), 3).unwrap() / (2.0 * sphere) - 1.0).abs() < 1e-3);
    // A cube of 9^3 balls; were all of them asked that reach the surface, this would be met several times as often.
    let apart = 0.7;
    let place = |index: i32| [index % 9, index / 9 % 9, index / 81].map(|cell| apart * cell as f32);
    let cube = fluid(&(0..729).map(place).collect::<Vec<_>>());
    let side = 8.0 * f64::from(apart) + 2.0 * radius;
    let area = exposed_area(&cube, 3).unwrap() / (6.0 * side * side);
    assert!((0.9..1.6).contains(&area), "{area}");
}

#[test]
fn particles_go_with_what_moves_and_keep_their_numbers() {
    let (positions, radii, weights) = ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [1.0, 1.2], [1.0, 1.0]);
    let velocities = [[1.0, -2.0, 0.5]; 2];
    let mut particles = SurfaceParticles::new(Options { count: 500, steps: 0, ..Options::default() }).unwrap();
    let balls = Balls::new(&positions, &radii, &weights).unwrap();
    particles.seed(&balls, Some(&velocities), field(0.2), &Job::default()).unwrap();
    let before = particles.particles().to_vec();
    assert!(before.iter().all(|particle| (0..3).all(|axis| (particle.velocity[axis] - velocities[0][axis]).abs() < 1e-5)));
    let later = positions.map(|[x, y, z]| [x + 0.5, y - 1.0, z + 0.25]);
    let balls = Balls::new(&later, &radii, &weights).unwrap();
    let report = particles.follow(&balls, Some(&velocities), field(0.2), 0.5, &Job::default()).unwrap();
    assert_eq!((report.lost, report.placed), (0, 0));
    for (particle, before) in particles.particles().iter().zip(&before) {
        assert_eq!(particle.id, before.id);
        let expected = plus(double(before.position), 0.5, double(velocities[0]));
        let apart = difference(double(particle.position), expected);
        assert!(dot(apart, apart).sqrt() < 1e-3, "{apart:?}");
    }
}

#[test]
fn liquid_that_appears_gets_particles_at_once_and_what_vanishes_gives_its_own_back() {
    let (positions, radii, weights) =
        ([[0.0f32, 0.0, 0.0], [9.0, 0.0, 0.0], [-9.0, 0.0, 0.0]], [1.0f32, 1.0, 0.5], [1.0f32; 3]);
    let options = Options { count: 600, ..Options::default() };
    let mut particles = particles(&positions[..2], &radii[..2], options);
    let near = |particles: &SurfaceParticles, x: f32| {
        particles.particles().iter().filter(|particle| (particle.position[0] - x).abs() < 2.0).count()
    };
    assert!(near(&particles, 9.0).abs_diff(300) < 10 && near(&particles, -9.0) == 0);
    let balls = Balls::new(&positions, &radii, &weights).unwrap();
    let report = particles.follow(&balls, None, field(0.2), 0.04, &Job::default()).unwrap();
    assert_eq!(particles.particles().len(), 600);
    // As many as each of the others, about: a smaller ball has them nearer together.
    assert!((185..300).contains(&near(&particles, -9.0)), "{} {report:?}", near(&particles, -9.0));
    for _ in 0..10 {
        particles.follow(&balls, None, field(0.2), 0.04, &Job::default()).unwrap();
    }
    // No particle has a reason to go to another ball any more.
    let pressures = particles.pressures(&particles.crowd().unwrap()).unwrap();
    let density_at = |x: f32| {
        let there = |particle: &Particle| (particle.position[0] - x).abs() < 2.0;
        let pairs = particles.particles().iter().zip(&pressures).filter(|(particle, _)| there(particle));
        let densities: Vec<f64> = pairs.map(|(_, pressure)| pressure.density).collect();
        densities.iter().sum::<f64>() / densities.len() as f64
    };
    assert!((density_at(-9.0) - density_at(0.0)).abs() < DISPERSION_THRESHOLD);
    assert!((density_at(9.0) - density_at(0.0)).abs() < DISPERSION_THRESHOLD);
    let balls = Balls::new(&positions[..1], &radii[..1], &weights[..1]).unwrap();
    let report = particles.follow(&balls, None, field(0.2), 0.04, &Job::default()).unwrap();
    assert!(report.lost > 380);
    particles.follow(&balls, None, field(0.2), 0.04, &Job::default()).unwrap();
    assert_eq!(particles.particles().len(), 600);
    assert!(variation(&nearest(particles.particles())) < 0.2);
}

#[test]
fn dispersion_spreads_faster_than_repulsion_alone() {
    let positions: Vec<[f32; 3]> = (0..10).map(|index| [0.5 * index as f32, 0.0, 0.0]).collect();
    let (radii, weights) = ([1.0; 10], [1.0; 10]);
    let balls = Balls::new(&positions, &radii, &weights).unwrap();
    let starts: Vec<[f32; 3]> =
        (0..1200).map(|index| any_direction(index).map(|c| 0.8 * c as f32)).filter(|start| start[0] < 0.0).collect();
    let mean_place = |disperses: bool, steps: usize| {
        let options = Options { count: 1200, steps, disperses, fills_gaps: false, ..Options::default() };
        let mut particles = SurfaceParticles::new(options).unwrap();
        particles.seed_at(&starts, &balls, None, field(0.2), &Job::default()).unwrap();
        assert!(particles.particles().len() > 580);
        particles.particles().iter().map(|particle| f64::from(particle.position[0])).sum::<f64>()
            / particles.particles().len() as f64
    };
    let (begin, with, without) = (mean_place(false, 0), mean_place(true, 40), mean_place(false, 40));
    assert!(with - begin > 2.0 * (without - begin) && without > begin, "{begin} {with} {without}");
}

#[test]
fn what_has_no_surface_has_no_particles() {
    let found = particles(&[], &[], Options::default());
    assert!(found.particles().is_empty());
    let mut found = SurfaceParticles::new(Options { count: 50, ..Options::default() }).unwrap();
    let (positions, radii) = ([[1.0; 3]; 2], [1.0; 2]);
    let balls = Balls::new(&positions, &radii, &[1.0; 2]).unwrap();
    let report = found.seed(&balls, None, field(3.0), &Job::default()).unwrap();
    assert_eq!((found.particles().len(), report), (0, Report::default()));
    // Two at one point that are a surface only together.
    found.follow(&balls, None, field(1.5), 0.04, &Job::default()).unwrap();
    assert_eq!(found.particles().len(), 50);
}
