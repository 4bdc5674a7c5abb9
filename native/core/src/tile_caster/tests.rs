//! Random fluids seen from anywhere, judged by the oracle, on the path that is chosen.

use proptest::prelude::*;
use proptest::test_runner::TestCaseResult;

use super::*;
use crate::kernel::tests::kernels;
use crate::oracle::{self, Rays};

/// Not whole tiles, nor whole squares of the coarsest stride.
const SIZE: [usize; 2] = [61, 46];
const NOTHING: f32 = 1e10;

/// Share of the isovalue that single precision may get the density wrong by.
const UNDECIDED: f64 = 1e-4;

/// A share of a radius by which a crossing may be elsewhere.
const ELSEWHERE: f64 = 1e-3;

#[derive(Clone, Debug)]
struct Scene {
    positions: Vec<[f32; 3]>,
    radii: Vec<f32>,
    weights: Vec<f32>,
    field: Field,
    view: View,
}

/// Many or few balls, alike or of radii over an order of magnitude, with or without some that carve.
fn any_balls() -> impl Strategy<Value = (Vec<[f32; 3]>, Vec<f32>, Vec<f32>)> {
    let ball = (prop::array::uniform3(-1.0..1.0f32), 0.1..1.0f32, 0.3..2.0f32, 0..8u8);
    let size = prop_oneof![Just(0.06f32), Just(0.2), Just(0.8)];
    (prop::collection::vec(ball, 1..500), size, any::<[bool; 3]>()).prop_map(|(balls, size, [are_alike, weigh, carve])| {
        let weight = |weight: f32, number: u8| if carve && number == 0 { -weight } else { weight };
        (
            balls.iter().map(|ball| ball.0).collect(),
            balls.iter().map(|ball| if are_alike { size } else { size * ball.1 }).collect(),
            balls.iter().map(|ball| weight(if weigh { ball.2 } else { 1.0 }, ball.3)).collect(),
        )
    })
}

/// From outside or amid the balls, towards them.
fn any_view() -> impl Strategy<Value = View> {
    let eye = prop::array::uniform3(-1.0..1.0f64);
    (eye, 0.2..5.0f64, any::<bool>(), 0.01..0.5f64, 0.3..1.0f64).prop_filter_map(
        "looks nowhere",
        |(direction, distance, is_perspective, clip_start, side)| {
            let forward = unit(direction.map(|c| -c))?;
            let right = unit([forward[1], -forward[0], 0.0])?;
            let up = cross(right, forward);
            let half = if is_perspective { side / 1.5 } else { side * 1.5 };
            Some(View {
                camera_from_world: [right, up, forward],
                eye: forward.map(|c| -c * distance),
                window: [-half, half, -half * 0.8, half * 0.8],
                is_perspective,
                width: SIZE[0],
                height: SIZE[1],
                clip: [clip_start, 20.0],
            })
        },
    )
}

fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let length = vector.iter().map(|c| c * c).sum::<f64>().sqrt();
    (length > 0.1).then(|| vector.map(|c| c / length))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Some scenes are faint: the density hardly exceeds the isovalue, and that where the camera looks, so most rays graze.
fn any_scene() -> impl Strategy<Value = Scene> {
    let faintness = prop_oneof![Just(None), (-3.0..0.0f64).prop_map(|power| Some(10f64.powf(power)))];
    (any_balls(), any_view(), 0..5usize, 0.1..0.8f64, faintness).prop_map(|(balls, view, kernel, isovalue, faintness)| {
        let (positions, radii, weights) = balls;
        let field = Field::new(kernels()[kernel].1, isovalue).expect("a field");
        let scene = Scene { positions, radii, weights, field, view };
        faintness.and_then(|excess| scene.faint(excess)).unwrap_or(scene)
    })
}

impl Scene {
    fn balls(&self) -> Balls<'_> {
        Balls::new(&self.positions, &self.radii, &self.weights).expect("usable balls")
    }

    /// The scene with its first ball where the camera looks, and the density there `1 + excess` isovalues.
    fn faint(&self, excess: f64) -> Option<Self> {
        let middle = self.positions[0];
        let density = self.excess(middle.map(f64::from)).0 + self.field.isovalue;
        let factor = (self.field.isovalue * (1.0 + excess) / density) as f32;
        (density > 0.1 * self.field.isovalue).then(|| Self {
            positions: self
                .positions
                .iter()
                .map(|position| std::array::from_fn(|axis| position[axis] - middle[axis]))
                .collect(),
            weights: self.weights.iter().map(|weight| weight * factor).collect(),
            ..self.clone()
        })
    }

    fn depths(&self, path: Path, stride: usize) -> Vec<f32> {
        let (mut depth, mut normal) = (vec![0.0; SIZE[0] * SIZE[1]], vec![0.0; 3 * SIZE[0] * SIZE[1]]);
        let caster = TileCaster::new(path, &self.balls(), &self.field, &self.view, &Job::default()).expect("a caster");
        let image = Image::new(SIZE, NOTHING, &mut depth, &mut normal, None, vec![]).expect("an image");
        caster.cast(stride, &image, &Job::default()).expect("depths");
        depth
    }

    /// Where the rays of all pixels meet the near clip plane, and their directions at depth 1.
    fn rays(&self) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
        let View { camera_from_world: [right, up, forward], eye, clip, is_perspective, .. } = self.view;
        let ray = |pixel: usize| {
            let [x, y] = self.view.pixel_center(pixel % SIZE[0], pixel / SIZE[0]);
            let across: [f64; 3] = std::array::from_fn(|axis| x * right[axis] + y * up[axis]);
            let direction: [f64; 3] =
                std::array::from_fn(|axis| forward[axis] + if is_perspective { across[axis] } else { 0.0 });
            let shift = if is_perspective { [0.0; 3] } else { across };
            (std::array::from_fn(|axis| eye[axis] + shift[axis] + clip[0] * direction[axis]), direction)
        };
        (0..SIZE[0] * SIZE[1]).map(ray).unzip()
    }

    /// The density less the isovalue, and what its shares add up to without their signs.
    fn excess(&self, point: [f64; 3]) -> (f64, f64) {
        let share = |id: usize| {
            let distance_2: f64 = (0..3).map(|axis| (point[axis] - f64::from(self.positions[id][axis])).powi(2)).sum();
            f64::from(self.weights[id]) * self.field.kernel.value(1.0 - distance_2 / f64::from(self.radii[id]).powi(2))
        };
        let shares = (0..self.radii.len()).map(share);
        shares.fold((-self.field.isovalue, self.field.isovalue), |(sum, size), share| (sum + share, size + share.abs()))
    }

    /// Whether single precision can tell on which side of the surface a point is.
    fn is_decided(&self, point: [f64; 3]) -> bool {
        let (excess, size) = self.excess(point);
        excess.abs() > UNDECIDED * size
    }
}

/// A ray's crossings, distances in units of its direction, as the oracle finds them; and what the tile caster found.
struct Ray<'a> {
    scene: &'a Scene,
    origin: [f64; 3],
    direction: [f64; 3],
    crossings: &'a [f64],
    found: Option<f64>,
}

impl Ray<'_> {
    fn at(&self, t: f64) -> [f64; 3] {
        std::array::from_fn(|axis| self.origin[axis] + t * self.direction[axis])
    }

    /// What was found must lie on the surface, and every crossing before it must be undecidable: between it and the next one the
    /// density hardly leaves the isovalue.
    fn check(&self) -> TestCaseResult {
        if !self.scene.is_decided(self.origin) {
            return Ok(());
        }
        let slack = ELSEWHERE * self.scene.radii.iter().fold(0.0, |most: f64, radius| most.max(f64::from(*radius)));
        let range = self.scene.view.clip[1] - self.scene.view.clip[0];
        if let Some(found) = self.found {
            let is_crossing = self.crossings.iter().any(|t| (t - found).abs() < slack);
            prop_assert!(is_crossing || !self.scene.is_decided(self.at(found)), "nothing is at {found}: {:?}", self.crossings);
        }
        let end = self.found.unwrap_or(range) - slack;
        let passed = self.crossings.iter().filter(|t| **t < end).count();
        for pair in self.crossings[..passed].chunks(2) {
            let last = pair.get(1).copied().unwrap_or(end);
            let is_between = |step: u32| self.scene.is_decided(self.at(pair[0] + f64::from(step) / 32.0 * (last - pair[0])));
            prop_assert!(!(1..32).any(is_between), "{:?} passed {pair:?} of {:?}", self.found, self.crossings);
        }
        Ok(())
    }
}

fn check(scene: &Scene) -> TestCaseResult {
    let (origins, directions) = scene.rays();
    let rays = Rays::new(&origins, &directions).expect("usable rays");
    let all = oracle::crossings(scene.balls(), scene.field, rays, &Job::default()).expect("crossings");
    let crossings_of = |pixel: usize| -> Vec<f64> {
        let [first, end] = [pixel, pixel + 1].map(|next| all.rays.partition_point(|ray| *ray < next as i64));
        let length = directions[pixel].iter().map(|c| c * c).sum::<f64>().sqrt();
        all.t[first..end].iter().map(|t| t / length).collect()
    };
    for stride in STRIDES {
        let depths = scene.depths(Path::chosen().expect("a path"), stride);
        for (pixel, depth) in depths.iter().enumerate() {
            let Some(cast) = cast_pixel(pixel, stride) else { continue };
            prop_assert_eq!(*depth, depths[cast], "a pixel is like the one of its square that is cast");
            if pixel == cast {
                let found = (*depth < NOTHING).then(|| f64::from(*depth) - scene.view.clip[0]);
                let (origin, direction) = (origins[pixel], directions[pixel]);
                Ray { scene, origin, direction, crossings: &crossings_of(pixel), found }.check()?;
            }
        }
    }
    Ok(())
}

/// The pixel whose ray stands for a pixel, unless it lies beyond the image.
fn cast_pixel(pixel: usize, stride: usize) -> Option<usize> {
    let [x, y] = [pixel % SIZE[0], pixel / SIZE[0]].map(|side| side / stride * stride + stride / 2);
    (x < SIZE[0] && y < SIZE[1]).then_some(y * SIZE[0] + x)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    #[cfg_attr(miri, ignore = "too many rays for Miri")]
    fn what_is_seen_is_the_first_crossing(scene in any_scene()) {
        check(&scene)?;
    }
}

#[test]
#[cfg_attr(miri, ignore = "rayon's threads outlive the test")]
fn progress_ends_at_one() {
    let job = Job::default();
    let (positions, radii, weights) = (vec![[0.0, 3.0, 0.0]; 3], vec![1.0; 3], vec![1.0; 3]);
    let balls = Balls::new(&positions, &radii, &weights).expect("balls");
    let view = View {
        camera_from_world: [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
        eye: [0.0; 3],
        window: [-1.0, 1.0, -1.0, 1.0],
        is_perspective: true,
        width: 8,
        height: 8,
        clip: [0.1, 10.0],
    };
    let field = Field::new(kernels()[0].1, 0.2).expect("a field");
    let caster = TileCaster::new(Path::Portable, &balls, &field, &view, &job).expect("a caster");
    assert_eq!((job.progress(), caster.seen()), (1.0, 3));
}
