//! Points whose light can be told by hand, on every path.

use super::*;

const DULL: Material = Material {
    metallic: 0.0,
    roughness: 1.0,
    transmission: 0.0,
    ior: 1.0,
    emission: [0.0; 3],
    color: [0.0; 3],
    absorption: [0.0; 3],
};
const NO_LIGHT: Light = Light {
    kind: LightKind::Sun,
    position: [0.0; 3],
    direction: [0.0, 0.0, -1.0],
    power: [0.0; 3],
    area: 0.0,
    cone: [0.0; 2],
    radius: 0.0,
    size: [0.0; 2],
    right: [1.0, 0.0, 0.0],
    is_round: false,
    casts_shadow: true,
};

/// The light of one point at the origin that faces the eye and the lights above it.
fn point(path: Path, material: Material, lights: &[Light], world: [f32; 3], color: [f32; 3]) -> [f32; 3] {
    let up = [[0.0, 0.0, 1.0]];
    let points = Points { position: &[[0.0; 3]], normal: &up, to_eye: &up, color: &[color], material: &[0] };
    let mut radiance = [[9.0; 3]];
    let materials = [material];
    let scene = Scene::new(&materials, lights, world).unwrap();
    shade_points(path, &scene, points, &mut radiance, &Job::default()).unwrap();
    radiance[0]
}

fn assert_near(actual: [f32; 3], expected: [f32; 3]) {
    for (a, e) in actual.iter().zip(expected) {
        assert!((a - e).abs() <= 1e-5 * e.abs().max(1.0), "{actual:?} should be {expected:?}");
    }
}

#[test]
fn each_light_shines_by_its_formula() {
    use std::f32::consts::PI;
    let power = [8.0, 4.0, 2.0];
    let above = Light { position: [0.0, 0.0, 2.0], power, ..NO_LIGHT };
    let cone = Light { kind: LightKind::Spot, cone: [0.5, 1.0], ..above };
    let aside = Light { direction: [0.6, 0.0, -0.8], ..cone };
    let place: f32 = (0.8 - 0.5) / 0.5;
    let cases = [
        (Light { kind: LightKind::Sun, power, ..NO_LIGHT }, 1.0),
        (Light { kind: LightKind::Point, ..above }, 1.0 / (16.0 * PI)),
        (cone, 1.0 / (16.0 * PI)),
        (aside, place * place * (3.0 - 2.0 * place) / (16.0 * PI)),
        (Light { kind: LightKind::Area, area: 3.0, ..above }, 1.0 / (4.0 * PI + 3.0)),
        (Light { kind: LightKind::Area, area: 3.0, direction: [0.0, 0.0, 1.0], ..above }, 0.0),
    ];
    for path in Path::available() {
        for (light, share) in cases {
            let expected = power.map(|power| 0.5 * power * share / PI);
            assert_near(point(path, DULL, &[light], [0.0; 3], [0.5; 3]), expected);
        }
    }
}

#[test]
fn the_world_is_seen_in_all_materials() {
    let world = [0.2, 0.4, 0.8];
    let mirror = Material { metallic: 1.0, roughness: 0.0, ior: 1.5, ..DULL };
    let plastic = Material { ior: 1.5, ..DULL };
    for path in Path::available() {
        assert_near(point(path, DULL, &[], world, [0.5; 3]), world.map(|w| 0.5 * w));
        assert_near(point(path, mirror, &[], world, [0.9, 0.5, 0.1]), [0.18, 0.2, 0.08]);
        assert_near(point(path, plastic, &[], world, [0.5; 3]), world.map(|w| w * (0.04 + 0.96 * 0.5)));
        let glowing = Material { emission: [3.0, 2.0, 1.0], ..DULL };
        assert_near(point(path, glowing, &[], [0.0; 3], [0.5; 3]), [3.0, 2.0, 1.0]);
    }
}

#[test]
fn the_highlight_is_where_light_and_eye_mirror_each_other() {
    let metal = Material { metallic: 1.0, roughness: 0.5, ..DULL };
    let sun = |direction| Light { power: [1.0; 3], direction, ..NO_LIGHT };
    for path in Path::available() {
        // Alpha is 1/4: straight on the facets send alpha^2 / (4 pi alpha^4 (alpha + 1/2)).
        let expected = 16.0 / (4.0 * std::f32::consts::PI * 0.75);
        assert_near(point(path, metal, &[sun([0.0, 0.0, -1.0])], [0.0; 3], [1.0; 3]), [expected; 3]);
        let [slanted, ..] = point(path, metal, &[sun([0.8, 0.0, -0.6])], [0.0; 3], [1.0; 3]);
        assert!(slanted < 0.1 * expected);
    }
}

fn view(width: usize) -> View {
    View {
        camera_from_world: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        eye: [0.0; 3],
        window: [-1.0, 1.0, -1.0, 1.0],
        is_perspective: false,
        width,
        height: 1,
        clip: [0.1, 100.0],
    }
}

#[test]
fn images_are_laid_over_what_is_behind() {
    let glass = Material { transmission: 1.0, ..DULL };
    let materials = [DULL, glass];
    let lights = [Light { power: [std::f32::consts::PI; 3], direction: [0.0, 0.0, -1.0], ..NO_LIGHT }];
    let scene = Scene::new(&materials, &lights, [0.0; 3]).unwrap();
    let width = 19;
    for path in Path::available() {
        let behind = [0.5, 0.5, 0.5, 1.0];
        let mut rgba = vec![behind; width];
        rgba[2] = [0.0; 4];
        let material: Vec<i32> = (0..width as i32).map(|column| column % 3 - 1).collect();
        let image = Image {
            depth: &vec![1.0; width],
            // Some face away from the eye, and are seen from within.
            normal: &(0..width).map(|column| [0.0, 0.0, if column % 2 == 0 { -1.0 } else { 1.0 }]).collect::<Vec<_>>(),
            color: &vec![[0.8, 0.4, 0.2]; width],
            material: &material,
            contrast: &vec![0.5; width],
            rgba: &mut rgba,
            behind: None,
        };
        shade_image(path, &view(width), &scene, image, &Job::default()).unwrap();
        for (column, pixel) in rgba.iter().enumerate() {
            let expected = match (material[column], column) {
                (-1, _) => behind,
                (0, _) => [0.4, 0.2, 0.1, 1.0],
                // Over nothing a grey is tinted: each channel by how far its share is from their mean.
                (_, 2) => [0.25 * (0.8 - 1.4 / 3.0), 0.0, 0.0, 1.0 - 1.4 / 3.0],
                _ => [0.4, 0.2, 0.1, 1.0],
            };
            for axis in 0..4 {
                assert!((pixel[axis] - expected[axis]).abs() < 1e-5, "column {column}: {pixel:?}, not {expected:?}");
            }
        }
    }
}

#[test]
fn over_one_color_what_was_there_does_not_count() {
    let clear = Material { transmission: 1.0, ior: 1.0, ..DULL };
    for (material, behind) in [(DULL, [0.0; 4]), (clear, [0.0, 0.5, 1.0, 1.0])] {
        let materials = [material];
        let scene = Scene::new(&materials, &[], [0.5; 3]).unwrap();
        let laid = |mut rgba: [[f32; 4]; 2], behind| {
            let image = Image {
                depth: &[1.0; 2],
                normal: &[[0.0, 0.0, -1.0]; 2],
                color: &[[1.0; 3]; 2],
                material: &[0, -1],
                contrast: &[],
                rgba: &mut rgba,
                behind,
            };
            shade_image(Path::Portable, &view(2), &scene, image, &Job::default()).unwrap();
            rgba
        };
        let over = laid([[9.0; 4]; 2], Some(behind));
        assert_eq!(over, laid([behind; 2], None));
        assert_eq!(over[1], behind);
    }
}

#[test]
fn unusable_arguments_are_told() {
    assert!(Scene::new(&[], &[], [0.0; 3]).is_err());
    let materials = [DULL];
    let scene = Scene::new(&materials, &[], [0.0; 3]).unwrap();
    let points = Points { position: &[[0.0; 3]], normal: &[[0.0; 3]], to_eye: &[[0.0; 3]], color: &[[0.0; 3]], material: &[1] };
    let path = Path::Portable;
    assert!(shade_points(path, &scene, points, &mut [[0.0; 3]], &Job::default()).is_err());
    assert!(shade_points(path, &scene, Points { material: &[0], ..points }, &mut [], &Job::default()).is_err());
}
