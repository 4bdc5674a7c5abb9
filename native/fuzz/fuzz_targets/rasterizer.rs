//! The rasterizer: any triangles; what is seen lies between the clip distances and faces the eye.

#![no_main]

use libfuzzer_sys::arbitrary::{self, Arbitrary};
use libfuzzer_sys::fuzz_target;
use meniscus_core::job::Job;
use meniscus_core::rasterizer::{Image, NO_TRIANGLE, Triangles, View, rasterize};
use meniscus_core::simd::Path;

const SIDE: usize = 12;
const BACKGROUND: f32 = 1e10;

#[derive(Arbitrary, Debug)]
struct Input {
    near: Vec<[i8; 3]>,
    any: Vec<[f32; 3]>,
    corners: Vec<[u8; 3]>,
    is_perspective: bool,
    path: usize,
}

fuzz_target!(|input: Input| {
    let near = input.near.iter().map(|vertex| vertex.map(|number| f32::from(number) / 16.0));
    let vertices: Vec<[f32; 3]> = near.chain(input.any).take(48).collect();
    if vertices.is_empty() {
        return;
    }
    let index = |corner: u8| i32::from(corner) % vertices.len() as i32;
    let corners: Vec<[i32; 3]> = input.corners.iter().take(64).map(|corner| corner.map(index)).collect();
    let normals = vec![[0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0]; corners.len()];
    let view = View {
        camera_from_world: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        eye: [0.0; 3],
        window: [-1.0, 1.0, -1.0, 1.0],
        is_perspective: input.is_perspective,
        width: SIDE,
        height: SIDE,
        clip: [0.25, 64.0],
    };
    let pixels = SIDE * SIDE;
    let (mut depth, mut triangle, mut normal) = (vec![0.0; pixels], vec![0; pixels], vec![[0.0; 3]; pixels]);
    let image = Image { depth: &mut depth, triangle: &mut triangle, normal: &mut normal, background: BACKGROUND };
    let triangles = Triangles::new(&vertices, &corners, &normals).expect("the vertices exist");
    let paths = Path::available();
    let path = paths[input.path % paths.len()];
    rasterize(path, &triangles, &view, image, &Job::default()).expect("nobody cancels");
    for pixel in 0..pixels {
        if triangle[pixel] == NO_TRIANGLE {
            assert_eq!((depth[pixel], normal[pixel]), (BACKGROUND, [0.0; 3]));
        } else {
            assert!((0.25..=64.0).contains(&depth[pixel]) && (triangle[pixel] as usize) < corners.len());
            let length: f32 = normal[pixel].iter().map(|part| part * part).sum();
            assert!(length == 0.0 || (length - 1.0).abs() < 1e-4, "{length}");
        }
    }
});
