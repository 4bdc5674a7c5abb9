//! Triangles whose pixels can be told by hand, and random ones beside a plain ray caster.

use super::*;

fn view(is_perspective: bool, width: usize, height: usize) -> View {
    View {
        camera_from_world: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        eye: [0.0; 3],
        window: [-1.0, 1.0, -1.0, 1.0],
        is_perspective,
        width,
        height,
        clip: [0.1, 100.0],
    }
}

type Seen = (Vec<f32>, Vec<i32>, Vec<[f32; 3]>);

fn seen(vertices: &[[f32; 3]], corners: &[[i32; 3]], view: &View) -> Seen {
    let pixels = view.width * view.height;
    let (mut depth, mut triangle, mut normal) = (vec![0.0; pixels], vec![0; pixels], vec![[9.0; 3]; pixels]);
    let normals = vec![[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]; corners.len()];
    let triangles = Triangles::new(vertices, corners, &normals).unwrap();
    let image = Image { depth: &mut depth, triangle: &mut triangle, normal: &mut normal, background: 1e10 };
    rasterize(&triangles, view, image, &Job::default()).unwrap();
    (depth, triangle, normal)
}

#[test]
fn a_triangle_covers_the_centres_inside_it() {
    let vertices = [[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [-1.0, 1.0, 2.0]];
    for is_perspective in [false, true] {
        let (depth, triangle, normal) = seen(&vertices, &[[0, 1, 2]], &view(is_perspective, 4, 4));
        // At depth 2 a perspective view is twice as wide.
        let wanted: Vec<usize> = if is_perspective { vec![5, 6, 9] } else { vec![0, 1, 2, 3, 4, 5, 6, 8, 9, 12] };
        for pixel in 0..16 {
            let is_hit = wanted.contains(&pixel);
            assert_eq!(depth[pixel], if is_hit { 2.0 } else { 1e10 }, "pixel {pixel}, perspective {is_perspective}");
            assert_eq!(triangle[pixel], if is_hit { 0 } else { NO_TRIANGLE });
            assert_eq!(normal[pixel], if is_hit { [0.0, 0.0, -1.0] } else { [0.0; 3] });
        }
    }
}

#[test]
fn what_passes_the_eye_is_seen_up_to_the_clip_start() {
    // A floor below the eye, from far behind it to far ahead.
    let vertices = [[-500.0, -1.0, -500.0], [500.0, -1.0, -500.0], [0.0, -1.0, 800.0]];
    let view = View { clip: [1.5, 20.0], ..view(true, 1, 64) };
    let (depth, ..) = seen(&vertices, &[[0, 1, 2]], &view);
    for (row, depth) in depth.iter().enumerate() {
        let y = view.pixel_center(0, row)[1];
        let wanted = -1.0 / y;
        let is_hit = (1.5..=20.0).contains(&wanted);
        assert!(if is_hit { (f64::from(*depth) / wanted - 1.0).abs() < 1e-6 } else { *depth == 1e10 }, "row {row}");
    }
}

#[test]
fn no_ray_passes_between_neighbours() {
    let grid = 9;
    let vertices: Vec<[f32; 3]> = (0..grid * grid)
        .map(|index| {
            let (x, y) = (index % grid, index / grid);
            [x as f32 * 0.37 - 1.4, y as f32 * 0.41 - 1.6, 1.0 + 0.05 * ((x * 7 + y * 3) % 5) as f32]
        })
        .collect();
    let corners: Vec<[i32; 3]> = (0..grid * grid)
        .filter(|index| index % grid + 1 < grid && index / grid + 1 < grid)
        .flat_map(|index| {
            let (a, b, c, d) = (index, index + 1, index + grid, index + grid + 1);
            [[a, b, c], [d, c, b]]
        })
        .collect();
    for is_perspective in [false, true] {
        let (depth, ..) = seen(&vertices, &corners, &view(is_perspective, 97, 101));
        assert!(depth.iter().all(|depth| *depth < 1e10));
    }
}

#[test]
fn random_triangles_are_those_of_a_ray_caster() {
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let count = if cfg!(miri) { 8 } else { 60 };
    let vertices: Vec<[f32; 3]> =
        (0..3 * count).map(|_| [random() * 4.0 - 2.0, random() * 4.0 - 2.0, random() * 5.0 - 1.0]).collect();
    let corners: Vec<[i32; 3]> = (0..count).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect();
    for is_perspective in [false, true] {
        let view = view(is_perspective, 17, 13);
        let (depth, triangle, _) = seen(&vertices, &corners, &view);
        for pixel in 0..17 * 13 {
            let place = view.pixel_center(pixel % 17, pixel / 17);
            let hits = corners.iter().map(|ends| ray_depth(ends.map(|end| vertices[end as usize]), place, is_perspective));
            let (index, nearest) = hits.enumerate().fold((NO_TRIANGLE, 1e10), |best, (index, hit)| match hit {
                Some(hit) if hit >= 0.1 && hit < best.1 => (index as i32, hit),
                _ => best,
            });
            assert_eq!(triangle[pixel], index, "pixel {pixel}");
            assert!((f64::from(depth[pixel]) / nearest - 1.0).abs() < 1e-6);
        }
    }
}

/// As Moeller and Trumbore do it.
fn ray_depth(corners: [[f32; 3]; 3], place: [f64; 2], is_perspective: bool) -> Option<f64> {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let (origin, ray) =
        if is_perspective { ([0.0; 3], [place[0], place[1], 1.0]) } else { ([place[0], place[1], 0.0], [0.0, 0.0, 1.0]) };
    let minus = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let cross = |p: [f64; 3], q: [f64; 3]| [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    let (u_side, v_side, from) = (minus(b, a), minus(c, a), minus(origin, a));
    let p = cross(ray, v_side);
    let volume = dot(u_side, p);
    let (u, q) = (dot(from, p) / volume, cross(from, u_side));
    let v = dot(ray, q) / volume;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| dot(v_side, q) / volume)
}

#[test]
fn unusable_arguments_are_told() {
    assert!(Triangles::new(&[[0.0; 3]], &[[0, 0, 1]], &[[0.0; 9]]).is_err());
    assert!(Triangles::new(&[[0.0; 3]], &[[0, 0, -1]], &[[0.0; 9]]).is_err());
    assert!(Triangles::new(&[[0.0; 3]], &[[0, 0, 0]], &[]).is_err());
    let nothing = Triangles::new(&[], &[], &[]).unwrap();
    let image = Image { depth: &mut [0.0], triangle: &mut [0], normal: &mut [], background: 1e10 };
    assert!(rasterize(&nothing, &view(true, 1, 1), image, &Job::default()).is_err());
    let (depth, ..) = seen(&[[f32::NAN; 3], [0.0; 3], [1.0; 3]], &[[0, 1, 2]], &view(true, 2, 2));
    assert_eq!(depth, [1e10; 4]);
}
