//! The tile caster on every SIMD path and stride: each pixel is background, or a depth between the clip distances with a unit
//! normal and a ball that exists.

#![no_main]

use libfuzzer_sys::arbitrary::{self, Arbitrary};
use libfuzzer_sys::fuzz_target;
use meniscus_core::job::Job;
use meniscus_core::simd::Path;
use meniscus_core::tile_caster::{Attribute, Image, NO_BALL, STRIDES, TileCaster, View};
use meniscus_fuzz::{Scene, is_unit};

const BACKGROUND: f32 = 1e10;
/// A side has fewer; enough for a few tiles, and more would only make a run slower.
const MOST_PIXELS: u8 = 50;

#[derive(Arbitrary, Debug)]
struct Input {
    scene: Scene,
    path: usize,
    stride: usize,
    camera: Camera,
}

#[derive(Arbitrary, Debug)]
enum Camera {
    Near { eye: [i8; 3], axes: u8, size: [u8; 2], clip: [u8; 2], is_perspective: bool },
    Any { axes: [[f64; 3]; 3], eye: [f64; 3], window: [f64; 4], clip: [f64; 2], size: [u8; 2], is_perspective: bool },
}

impl Camera {
    fn view(&self) -> View {
        match self {
            Self::Near { eye, axes, size, clip, is_perspective } => View {
                camera_from_world: axes_along(*axes),
                eye: eye.map(|number| f64::from(number) / 8.0),
                window: [-1.0, 1.0, -1.0, 1.0],
                is_perspective: *is_perspective,
                width: usize::from(size[0] % MOST_PIXELS),
                height: usize::from(size[1] % MOST_PIXELS),
                clip: clip.map(|number| f64::from(number) / 8.0),
            },
            Self::Any { axes, eye, window, clip, size, is_perspective } => View {
                camera_from_world: *axes,
                eye: *eye,
                window: *window,
                is_perspective: *is_perspective,
                width: usize::from(size[0] % MOST_PIXELS),
                height: usize::from(size[1] % MOST_PIXELS),
                clip: *clip,
            },
        }
    }
}

/// A camera that looks along an axis.
fn axes_along(number: u8) -> [[f64; 3]; 3] {
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    [[x, y, z], [y, z, x], [z, x, y]][usize::from(number % 3)]
}

fuzz_target!(|input: Input| {
    let Some(field) = input.scene.field() else { return };
    let (arrays, view, paths) = (input.scene.arrays(), input.camera.view(), Path::available());
    let balls = arrays.balls();
    let path = paths[input.path % paths.len()];
    let Ok(caster) = TileCaster::new(path, &balls, &field, &view, &Job::default()) else { return };
    let pixels = view.width * view.height;
    let (mut depth, mut normal, mut ball) = (vec![0.0; pixels], vec![0.0; 3 * pixels], vec![0; pixels]);
    let mut blended = vec![0.0; 3 * pixels];
    let attributes = vec![Attribute::new(balls.positions(), &mut blended)];
    let size = [view.width, view.height];
    let image = Image::new(size, BACKGROUND, &mut depth, &mut normal, Some(&mut ball), attributes).expect("the right sizes");
    caster.cast(STRIDES[input.stride % STRIDES.len()], &image, &Job::default()).expect("nobody cancels");
    for ((depth, normal), ball) in depth.iter().zip(normal.as_chunks::<3>().0).zip(&ball) {
        if *depth == BACKGROUND {
            assert_eq!((*normal, *ball), ([0.0; 3], NO_BALL));
        } else if matches!(input.camera, Camera::Near { .. }) {
            let [start, end] = view.clip.map(|distance| distance as f32);
            assert!((start * 0.9999..=end * 1.0001).contains(depth), "{depth}");
            assert!(is_unit(normal.map(f64::from)), "{normal:?}");
            assert!(*ball == NO_BALL || (0..balls.len() as i32).contains(ball), "{ball}");
        }
    }
});
