//! The fitted BVH with any of its refinements: each ray meets nothing, or a ball that exists between its limits, with a unit
//! normal. Whether it meets the surface, the two questions may answer apart where the field comes as near to the isovalue as
//! rounding; that they agree elsewhere is what the tests of the core look at.

#![no_main]

use libfuzzer_sys::arbitrary::{self, Arbitrary};
use libfuzzer_sys::fuzz_target;
use meniscus_core::fitted_bvh::{FittedBvh, Hierarchy, Options, Rays};
use meniscus_core::job::Job;
use meniscus_fuzz::{RayArrays, Scene, is_unit};

#[derive(Arbitrary, Debug)]
struct Input {
    scene: Scene,
    rays: RayArrays,
    limits: [u8; 2],
    /// Overlapping, fits, tightens, discards, proves.
    options: [bool; 5],
}

impl Input {
    fn options(&self) -> Options {
        let [is_overlapping, fits, tightens, discards, proves] = self.options;
        let hierarchy = if is_overlapping { Hierarchy::Overlapping } else { Hierarchy::Fitted };
        Options { hierarchy, fits, tightens, discards, proves }
    }
}

fuzz_target!(|input: Input| {
    let Some(field) = input.scene.field() else { return };
    let arrays = input.scene.arrays();
    let balls = arrays.balls();
    let bvh = FittedBvh::build(&balls, &field, &input.options(), &Job::default()).expect("nobody cancels");
    let (origins, directions) = input.rays.arrays();
    let [begin, end] = input.limits.map(|number| f64::from(number) / 8.0);
    let (t_min, t_max) = ([begin], [end]);
    let rays = Rays::new(&origins, &directions, &t_min, &t_max).expect("the right lengths");
    // Rays that are unusable are refused.
    let Ok(hits) = bvh.first_hit(&rays, &Job::default()) else { return };
    let meets = bvh.any_hit(&rays, &Job::default()).expect("the same rays");
    assert_eq!(meets.len(), hits.t.len());
    for (ray, (t, normal)) in hits.t.iter().zip(&hits.normals).enumerate() {
        if t.is_finite() {
            assert!((begin..=end).contains(t), "{t}");
            assert!(is_unit(normal.map(f64::from)), "{normal:?}");
            assert!((0..balls.len() as i32).contains(&hits.balls[ray]), "{}", hits.balls[ray]);
        } else {
            assert_eq!((*normal, hits.balls[ray]), ([0.0; 3], -1));
        }
    }
});
