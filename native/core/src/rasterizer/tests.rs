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
    let normals = vec![[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]; corners.len()];
    let triangles = Triangles::new(vertices, corners, &normals).unwrap();
    seen_by(Path::chosen().unwrap(), &triangles, view, &Job::default()).unwrap()
}

fn seen_by(path: Path, triangles: &Triangles<'_>, view: &View, job: &Job) -> Result<Seen> {
    let pixels = view.width * view.height;
    let (mut depth, mut triangle, mut normal) = (vec![0.0; pixels], vec![0; pixels], vec![[9.0; 3]; pixels]);
    let image = Image { depth: &mut depth, triangle: &mut triangle, normal: &mut normal, background: 1e10 };
    rasterize(path, triangles, view, image, job)?;
    Ok((depth, triangle, normal))
}

/// Numbers from 0 to 1, always the same.
struct Random(u32);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as f32 / (1 << 24) as f32
    }

    /// Three numbers from -1 to 1.
    fn vector(&mut self) -> [f32; 3] {
        [0; 3].map(|_| 2.0 * self.next() - 1.0)
    }
}

/// A sphere of quadrilaterals, two triangles each, as seen from its inside without a gap.
fn sphere(center: [f32; 3], rings: i32) -> (Vec<[f32; 3]>, Vec<[i32; 3]>) {
    let segments = 2 * rings;
    let vertex = |index: i32| {
        let (ring, segment) = ((index / segments) as f32, (index % segments) as f32);
        let (polar, around) = (ring / rings as f32 * std::f32::consts::PI, segment / rings as f32 * std::f32::consts::PI);
        let offset = [polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos()];
        [0, 1, 2].map(|axis| center[axis] + offset[axis])
    };
    // All corners of the last ring are one pole, to the last bit.
    let mut vertices: Vec<_> = (0..rings * segments).map(vertex).collect();
    vertices.push([center[0], center[1], center[2] - 1.0]);
    let at = |ring: i32, segment: i32| if ring == rings { rings * segments } else { ring * segments + segment % segments };
    let quadrilateral = |ring: i32, segment: i32| {
        let [a, b, c, d] = [at(ring, segment), at(ring, segment + 1), at(ring + 1, segment), at(ring + 1, segment + 1)];
        [[a, b, c], [d, c, b]]
    };
    let corners = (0..rings).flat_map(|ring| (0..segments).flat_map(move |segment| quadrilateral(ring, segment))).collect();
    (vertices, corners)
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
fn no_ray_leaves_a_sphere_that_is_far_from_the_origin() {
    for center in [[0.0; 3], [1e3, -2e3, 5e2]] {
        let (vertices, corners) = sphere(center, 24);
        let eye = [0, 1, 2].map(|axis| f64::from(center[axis]) + [0.2, -0.1, 0.15][axis]);
        for [right, up, forward] in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
            let mut camera_from_world = [[0.0; 3]; 3];
            [camera_from_world[0][right], camera_from_world[1][up], camera_from_world[2][forward]] = [1.0; 3];
            let view = View { camera_from_world, eye, clip: [0.0, 10.0], ..view(true, 101, 67) };
            let (depth, ..) = seen(&vertices, &corners, &view);
            assert!(depth.iter().all(|depth| (0.4..1.3).contains(depth)), "{center:?}, {forward}");
        }
    }
}

#[test]
fn of_triangles_that_are_equally_far_the_first_is_seen() {
    let vertices = [[-9.0, -9.0, 2.0], [9.0, -9.0, 2.0], [0.0, 9.0, 2.0]];
    let (_, triangle, _) = seen(&vertices, &[[1, 0, 2], [0, 1, 2], [2, 1, 0]], &view(true, 5, 40));
    assert!(triangle.iter().all(|index| *index == 0));
}

#[test]
fn a_triangle_without_area_is_nowhere_else() {
    let mut random = Random(3);
    for is_perspective in [false, true] {
        for _ in 0..200 {
            // All of it lies on a line, or in a plane through the eye.
            let ([a, b], share) = ([random.vector(), random.vector()], random.next());
            let middle = [0, 1, 2].map(|axis| a[axis] + share * (b[axis] - a[axis]));
            let vertices = [a, b, middle].map(|corner| [corner[0], corner[1], corner[2] + 2.0]);
            let (depth, ..) = seen(&vertices, &[[0, 1, 2]], &view(is_perspective, 32, 32));
            let range = vertices.iter().fold([9.0f32, 0.0], |[low, high], corner| [low.min(corner[2]), high.max(corner[2])]);
            let is_near = |depth: &f32| (range[0] * 0.999999..=range[1] * 1.000001).contains(depth);
            assert!(depth.iter().all(|depth| *depth == 1e10 || is_near(depth)), "{vertices:?}");
        }
    }
}

#[test]
fn random_triangles_are_those_of_a_ray_caster() {
    let mut random = Random(1);
    for (is_perspective, clip_start) in [(false, 0.1), (true, 0.0), (true, 0.1), (true, 1.0)] {
        for size in [0.05, 2.0] {
            let count = if size < 1.0 { 6000 } else { 60 };
            let middles: Vec<_> = (0..count).map(|_| random.vector()).collect();
            let corner = |index: usize| {
                let (middle, offset) = (middles[index / 3], random.vector());
                let at = |axis: usize| 2.0 * middle[axis] + size * offset[axis];
                [at(0), at(1), at(2) + 1.5]
            };
            let vertices: Vec<_> = (0..3 * count).map(corner).collect();
            let corners: Vec<_> = (0..count as i32).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect();
            let normals: Vec<[f32; 9]> = (0..count).map(|_| [0; 9].map(|_| random.next() - 0.5)).collect();
            let triangles = Triangles::new(&vertices, &corners, &normals).unwrap();
            let view = View { clip: [clip_start, 2.5], ..view(is_perspective, 33, 49) };
            let found = seen_by(Path::chosen().unwrap(), &triangles, &view, &Job::default()).unwrap();
            assert_as_cast(&triangles, &view, &found);
        }
    }
}

/// Compares an image with what rays that are cast one by one meet.
fn assert_as_cast(triangles: &Triangles<'_>, view: &View, (depth, triangle, normal): &Seen) {
    let mut hits = 0;
    for pixel in 0..view.width * view.height {
        let place = view.pixel_center(pixel % view.width, pixel / view.width);
        let ends = triangles.corners.iter().map(|ends| ends.map(|end| triangles.vertices[end as usize]));
        let cast = ends.map(|ends| ray_hit(ends, place, view.is_perspective));
        let nearest = cast.enumerate().fold((NO_TRIANGLE, [1e10, 0.0, 0.0]), |best, (index, hit)| match hit {
            Some(hit) if (view.clip[0]..=view.clip[1]).contains(&hit[0]) && hit[0] < best.1[0] => (index as i32, hit),
            _ => best,
        });
        assert_eq!(triangle[pixel], nearest.0, "pixel {pixel}");
        let (index, [wanted, u, v]) = nearest;
        assert!((f64::from(depth[pixel]) / wanted - 1.0).abs() < 1e-6);
        if index != NO_TRIANGLE {
            hits += 1;
            let ends = triangles.corners[index as usize].map(|end| triangles.vertices[end as usize]);
            let wanted = cast_normal(ends, &triangles.normals[index as usize], [u, v], place, view.is_perspective);
            assert!((0..3).all(|axis| (f64::from(normal[pixel][axis]) - wanted[axis]).abs() < 1e-5), "pixel {pixel}");
        }
    }
    assert!(hits > 100);
}

/// The mean of a triangle's normals, on the side that the ray comes from; world and camera space are the same.
fn cast_normal(ends: [[f32; 3]; 3], normals: &[f32; 9], [u, v]: [f64; 2], place: [f64; 2], is_perspective: bool) -> [f64; 3] {
    let [a, b, c] = ends.map(|end| end.map(f64::from));
    let mean = [0, 1, 2].map(|axis| {
        let [a, b, c] = [0, 3, 6].map(|corner| f64::from(normals[corner + axis]));
        (1.0 - u - v) * a + u * b + v * c
    });
    let plane = cross(minus(b, a), minus(c, a));
    let ray = if is_perspective { [place[0], place[1], 1.0] } else { [0.0, 0.0, 1.0] };
    let is_turned = (dot(plane, ray) > 0.0) == (dot(plane, mean) > 0.0);
    let length = dot(mean, mean).sqrt() * if is_turned { -1.0 } else { 1.0 };
    mean.map(|part| part / length)
}

/// Depth and shares of the second and the third corner, as Moeller and Trumbore (1997) find them.
fn ray_hit(corners: [[f32; 3]; 3], place: [f64; 2], is_perspective: bool) -> Option<[f64; 3]> {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let (origin, ray) =
        if is_perspective { ([0.0; 3], [place[0], place[1], 1.0]) } else { ([place[0], place[1], 0.0], [0.0, 0.0, 1.0]) };
    let (u_side, v_side, from) = (minus(b, a), minus(c, a), minus(origin, a));
    let p = cross(ray, v_side);
    let volume = dot(u_side, p);
    let (u, q) = (dot(from, p) / volume, cross(from, u_side));
    let v = dot(ray, q) / volume;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| [dot(v_side, q) / volume, u, v])
}

fn minus(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [p[0] - q[0], p[1] - q[1], p[2] - q[2]]
}

fn cross(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
}

#[test]
fn the_image_is_the_same_on_every_path_and_for_any_number_of_threads() {
    let (vertices, corners) = sphere([0.0, 0.0, 2.0], 60);
    let normals: Vec<_> = corners.iter().map(|_| [0.1, 0.9, 0.0, 0.3, 0.2, 0.5, 0.0, 0.0, 1.0]).collect();
    let triangles = Triangles::new(&vertices, &corners, &normals).unwrap();
    assert!(corners.len() > 3 * CHUNK);
    let view = view(true, 83, 61);
    let wanted = seen_by(Path::Portable, &triangles, &view, &Job::default()).unwrap();
    for path in Path::available() {
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let found = pool.install(|| seen_by(path, &triangles, &view, &Job::default())).unwrap();
            assert!(found == wanted, "{path:?}, {threads} threads");
        }
    }
}

#[test]
fn cancelling_ends_it() {
    let (vertices, corners) = sphere([0.0, 0.0, 2.0], 4);
    let normals = vec![[1.0; 9]; corners.len()];
    let job = Job::default();
    job.cancel();
    let triangles = Triangles::new(&vertices, &corners, &normals).unwrap();
    assert_eq!(seen_by(Path::Portable, &triangles, &view(true, 8, 8), &job), Err(Error::Cancelled));
}

#[test]
fn unusable_arguments_are_told() {
    assert!(Triangles::new(&[[0.0; 3]], &[[0, 0, 1]], &[[0.0; 9]]).is_err());
    assert!(Triangles::new(&[[0.0; 3]], &[[0, 0, -1]], &[[0.0; 9]]).is_err());
    assert!(Triangles::new(&[[0.0; 3]], &[[0, 0, 0]], &[]).is_err());
    let nothing = Triangles::new(&[], &[], &[]).unwrap();
    let image = Image { depth: &mut [0.0], triangle: &mut [0], normal: &mut [], background: 1e10 };
    assert!(rasterize(Path::Portable, &nothing, &view(true, 1, 1), image, &Job::default()).is_err());
    let (depth, ..) = seen(&[[f32::NAN; 3], [0.0; 3], [1.0; 3]], &[[0, 1, 2]], &view(true, 2, 2));
    assert_eq!(depth, [1e10; 4]);
}

#[test]
fn displacements_are_blends_of_the_corners() {
    // Of depths that differ, so that shares in space are not those in the image.
    let vertices = [[-4.0, -4.0, 4.0], [4.0, -4.0, 4.0], [0.0, 8.0, 12.0], [9.0, 9.0, 9.0]];
    let linear = |[x, y, z]: [f32; 3]| [x + 0.5 * y - z + 1.0, 2.0 * z, -x];
    let elsewhere = vertices.map(linear);
    let corners = [[0, 1, 2]];
    let normals = [[0.0; 9]];
    let triangles = Triangles::new(&vertices, &corners, &normals).unwrap();
    for is_perspective in [true, false] {
        let mut view = view(is_perspective, 5, 4);
        view.window = if is_perspective { [-2.0, 2.0, -2.0, 2.0] } else { [-8.0, 8.0, -8.0, 8.0] };
        let (depth, triangle, _) = seen(&vertices, &corners, &view);
        assert!(triangle.contains(&0) && triangle.contains(&NO_TRIANGLE));
        let mut displacement = [[9.0; 3]; 20];
        displace(&triangles, &elsewhere, &view, &triangle, &mut displacement, &Job::default()).unwrap();
        for (pixel, found) in displacement.iter().enumerate() {
            let expected = if triangle[pixel] == NO_TRIANGLE {
                [0.0; 3]
            } else {
                let scale = if is_perspective { depth[pixel] } else { 1.0 };
                let [x, y] = view.pixel_center(pixel % 5, pixel / 5).map(|number| number as f32 * scale);
                let (here, there) = ([x, y, depth[pixel]], linear([x, y, depth[pixel]]));
                [0, 1, 2].map(|axis| there[axis] - here[axis])
            };
            assert!(
                found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-4),
                "{found:?} {expected:?}"
            );
        }
    }
}

#[test]
fn displacements_need_what_was_seen() {
    let (vertices, normals) = ([[0.0; 3]; 3], [[0.0; 9]]);
    let triangles = Triangles::new(&vertices, &[[0, 1, 2]], &normals).unwrap();
    let view = view(true, 2, 1);
    let mut displacement = [[9.0; 3]; 2];
    let mut try_with = |elsewhere: &[[f32; 3]], triangle: &[i32]| {
        displace(&triangles, elsewhere, &view, triangle, &mut displacement, &Job::default())
    };
    assert!(try_with(&vertices, &[0, 1]).is_err());
    assert!(try_with(&vertices[..2], &[0, 0]).is_err());
    assert!(try_with(&vertices, &[0]).is_err());
    // A triangle without area has no shares.
    try_with(&[[1.0; 3]; 3], &[0, NO_TRIANGLE]).unwrap();
    assert_eq!(displacement, [[0.0; 3]; 2]);
}
