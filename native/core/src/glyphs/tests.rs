//! Glyphs whose pictures follow from closed forms, and random ones beside a plain search.

use super::*;
use crate::job::Job;

fn view(is_perspective: bool, side: usize, clip: [f64; 2]) -> View {
    View {
        camera_from_world: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        eye: [0.0; 3],
        window: [-1.0, 1.0, -1.0, 1.0],
        is_perspective,
        width: side,
        height: side,
        clip,
    }
}

struct Seen {
    depth: Vec<f32>,
    glyph: Vec<i32>,
    normal: Vec<[f32; 3]>,
}

fn seen_by(path: Path, glyphs: &Glyphs<'_>, view: &View) -> Seen {
    let pixels = view.width * view.height;
    let (mut depth, mut glyph, mut normal) = (vec![0.0; pixels], vec![7; pixels], vec![[9.0; 3]; pixels]);
    let mut image = Image { depth: &mut depth, glyph: &mut glyph, normal: &mut normal, background: 1e10 };
    cast(path, glyphs, view, &mut image, &Job::default()).unwrap();
    Seen { depth, glyph, normal }
}

fn seen(centers: &[[f32; 3]], extents: Extents<'_>, view: &View) -> Seen {
    seen_by(Path::chosen().unwrap(), &Glyphs::new(centers, extents).unwrap(), view)
}

#[test]
fn a_sphere_on_the_axis_is_a_disc() {
    let view = view(false, 101, [0.1, 100.0]);
    let found = seen(&[[0.0, 0.0, 5.0]], Extents::Spheres(&[0.75]), &view);
    for pixel in 0..101 * 101 {
        let [x, y] = view.pixel_center(pixel % 101, pixel / 101);
        let rest = 0.75f64.powi(2) - x * x - y * y;
        if rest < 0.0 {
            assert_eq!((found.depth[pixel], found.glyph[pixel], found.normal[pixel]), (1e10, NO_GLYPH, [0.0; 3]));
        } else {
            assert!((f64::from(found.depth[pixel]) - (5.0 - rest.sqrt())).abs() < 1e-6);
            let expected = [x, y, -rest.sqrt()].map(|part| (part / 0.75) as f32);
            assert!((0..3).all(|axis| (found.normal[pixel][axis] - expected[axis]).abs() < 1e-6));
        }
    }
}

#[test]
fn clip_depths_cut_and_the_inside_is_seen_from_within() {
    let centre = 5 * 11 + 5;
    let depth_of = |clip| seen(&[[0.0, 0.0, 5.0]], Extents::Spheres(&[2.0]), &view(true, 11, clip)).depth[centre];
    assert_eq!([depth_of([0.1, 100.0]), depth_of([3.0, 3.0001])], [3.0, 3.0]);
    assert_eq!([depth_of([3.5, 100.0]), depth_of([7.0, 8.0])], [7.0, 7.0]);
    assert_eq!([depth_of([0.1, 2.9]), depth_of([3.5, 6.9]), depth_of([7.1, 9.0])], [1e10; 3]);
    let inside = seen(&[[0.0, 0.0, 0.0]], Extents::Spheres(&[2.0]), &view(true, 11, [0.1, 9.0]));
    assert!(inside.glyph.iter().all(|glyph| *glyph == 0));
    assert_eq!((inside.depth[centre], inside.normal[centre]), (2.0, [0.0, 0.0, 1.0]));
}

/// Numbers from 0 to 1, always the same.
struct Random(u32);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as f32 / (1 << 24) as f32
    }

    /// Three numbers from -1 to 1.
    fn vector(&mut self) -> [f64; 3] {
        [0; 3].map(|_| f64::from(2.0 * self.next() - 1.0))
    }

    /// Three vectors at right angles of lengths from 0.05 to 0.85.
    fn axes(&mut self) -> [f32; 9] {
        let unit = |vector: [f64; 3]| vector.map(|part| part / dot(vector, vector).sqrt());
        let first = unit(self.vector());
        let second = unit(cross(first, self.vector()));
        let axes = [first, second, cross(first, second)].map(|axis| {
            let length = f64::from(0.05 + 0.8 * self.next());
            axis.map(|part| (length * part) as f32)
        });
        *axes.as_flattened().first_chunk().unwrap()
    }
}

#[test]
fn every_ray_sees_the_nearest_of_random_ellipsoids() {
    for (seed, is_perspective) in [(1, true), (2, false), (3, true), (4, false)] {
        let mut random = Random(seed);
        let centers: Vec<[f32; 3]> = (0..30).map(|_| random.vector().map(|part| 2.0 * part as f32)).collect();
        let axes: Vec<[f32; 9]> = (0..30).map(|_| random.axes()).collect();
        // The eye is among them, looks aslant, and the image is neither square nor in the middle.
        let forward = random.vector();
        let length = dot(forward, forward).sqrt();
        let forward = forward.map(|part| part / length);
        let side = cross(forward, [0.0, 0.0, 1.0]);
        let side = side.map(|part| part / dot(side, side).sqrt());
        let view = View {
            camera_from_world: [side, cross(side, forward), forward],
            eye: random.vector(),
            window: [-1.5, 0.7, -0.4, 1.1],
            is_perspective,
            width: 57,
            height: 43,
            clip: [0.3, 4.0],
        };
        let glyphs = Glyphs::new(&centers, Extents::Ellipsoids(&axes)).unwrap();
        for path in Path::available() {
            let found = seen_by(path, &glyphs, &view);
            assert!(found.glyph.iter().filter(|glyph| **glyph >= 0).count() > 300);
            for pixel in 0..57 * 43 {
                let [x, y] = view.pixel_center(pixel % 57, pixel / 57);
                let expected = (0..30)
                    .map(|index| (plain_crossing(&glyphs.in_view(index, &view), [x, y], &view), index as i32))
                    .min_by(|one, other| one.0.total_cmp(&other.0))
                    .unwrap();
                let expected = if expected.0.is_finite() { expected } else { (1e10, NO_GLYPH) };
                assert_eq!(found.glyph[pixel], expected.1, "seed {seed}, pixel {pixel}");
                assert!((f64::from(found.depth[pixel]) - expected.0).abs() < 1e-5);
            }
        }
    }
}

/// The same crossing by the roots of the quadratic along the ray.
fn plain_crossing(shape: &Shape, [x, y]: [f64; 2], view: &View) -> f64 {
    let (origin, direction) = if view.is_perspective { ([0.0; 3], [x, y, 1.0]) } else { ([x, y, 0.0], [0.0, 0.0, 1.0]) };
    let offset = [0, 1, 2].map(|axis| origin[axis] - shape.center[axis]);
    let [mut a, mut b, mut c] = [0.0, 0.0, -1.0];
    for axis in &shape.axes {
        let length_2 = dot(*axis, *axis);
        let (along, start) = (dot(*axis, direction) / length_2, dot(*axis, offset) / length_2);
        (a, b, c) = (a + along * along, b + along * start, c + start * start);
    }
    let root = (b * b - a * c).sqrt();
    let roots = [(-b - root) / a, (-b + root) / a];
    roots.into_iter().find(|depth| (view.clip[0]..=view.clip[1]).contains(depth)).unwrap_or(f64::INFINITY)
}

#[test]
fn a_small_sphere_far_away_keeps_its_border() {
    let mut far = view(true, 64, [0.1, 1e9]);
    // A million radii away it fills half the image.
    far.window = [-2e-6, 2e-6, -2e-6, 2e-6];
    let found = seen(&[[0.0, 0.0, 1e6]], Extents::Spheres(&[1.0]), &far);
    for pixel in 0..64 * 64 {
        let [x, y] = far.pixel_center(pixel % 64, pixel / 64);
        let apart = 1e6 * (x * x + y * y).sqrt();
        assert!((apart - 1.0).abs() < 1e-3 || (found.glyph[pixel] == 0) == (apart < 1.0));
    }
}

#[test]
fn what_is_equally_far_is_the_first_and_attributes_follow_the_glyph() {
    let view = view(false, 8, [0.1, 100.0]);
    let mut found = seen(&[[0.0, 0.0, 5.0], [0.0, 0.0, 5.0]], Extents::Spheres(&[0.5, 0.5]), &view);
    let is_hit: Vec<bool> = found.glyph.iter().map(|glyph| *glyph == 0).collect();
    assert!(is_hit.contains(&true) && found.glyph.iter().all(|glyph| *glyph <= 0));
    let mut color = vec![[7.0; 3]; 64];
    pick(&found.glyph, &[[1.0, 2.0, 3.0], [0.0; 3]], &mut color).unwrap();
    rename(&mut found.glyph, &[41, 42]).unwrap();
    for (pixel, is_hit) in is_hit.into_iter().enumerate() {
        assert_eq!(color[pixel], if is_hit { [1.0, 2.0, 3.0] } else { [0.0; 3] });
        assert_eq!(found.glyph[pixel], if is_hit { 41 } else { NO_GLYPH });
    }
    assert!(rename(&mut [1], &[5]).is_err());
    assert!(pick(&[0], &[], &mut [[0.0; 3]]).is_err());
    assert!(pick(&[0], &[[0.0; 3]], &mut []).is_err());
}

#[test]
fn unusable_glyphs_are_refused() {
    let error = |centers: &[[f32; 3]], extents: Extents<'_>| Glyphs::new(centers, extents).unwrap_err().to_string();
    assert!(error(&[[0.0; 3]], Extents::Spheres(&[])).contains("as many extents as glyphs"));
    assert!(error(&[[0.0, f32::NAN, 0.0]], Extents::Spheres(&[1.0])).contains("must be finite"));
    assert!(error(&[[0.0; 3]], Extents::Spheres(&[0.0])).contains("greater than zero"));
    assert!(
        error(&[[0.0; 3]], Extents::Ellipsoids(&[[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]])).contains("greater than zero")
    );
}
