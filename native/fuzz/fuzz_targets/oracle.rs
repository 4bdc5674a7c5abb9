//! The exact caster: crossings are ordered, alternate, begin with the first one, and have unit normals.

#![no_main]

use libfuzzer_sys::arbitrary::{self, Arbitrary};
use libfuzzer_sys::fuzz_target;
use meniscus_core::job::Job;
use meniscus_core::oracle::{Rays, cast, crossings};
use meniscus_fuzz::{RayArrays, Scene, is_unit};

#[derive(Arbitrary, Debug)]
struct Input {
    scene: Scene,
    rays: RayArrays,
}

fuzz_target!(|input: Input| {
    let (origins, directions) = input.rays.arrays();
    let (Some(field), Ok(rays)) = (input.scene.field(), Rays::new(&origins, &directions)) else { return };
    let arrays = input.scene.arrays();
    let first = cast(arrays.balls(), field, rays, &Job::default()).expect("nobody cancels");
    let all = crossings(arrays.balls(), field, rays, &Job::default()).expect("nobody cancels");
    for (ray, (t, normal)) in first.t.iter().zip(&first.normals).enumerate() {
        let of_ray: Vec<_> = (0..all.t.len()).filter(|index| all.rays[*index] == ray as i64).collect();
        assert_eq!(of_ray.first().map_or(f64::INFINITY, |index| all.t[*index]), *t);
        assert!(*t > 0.0, "{t}");
        assert!(if t.is_finite() { is_unit(*normal) } else { *normal == [0.0; 3] }, "{t} {normal:?}");
        for pair in of_ray.windows(2) {
            assert!(all.t[pair[0]] <= all.t[pair[1]]);
            assert_ne!(all.is_entering[pair[0]], all.is_entering[pair[1]]);
        }
    }
});
