//! The light of sixteen points.

use std::f32::consts::PI;
use std::ops::{Add, Mul, Sub};

use super::Scene;
use crate::simd::{LANES, Lanes, Mask, Simd, Vector};

/// A surface, apart from its colour.
#[derive(Clone, Copy, Debug, Default)]
pub struct Material {
    /// 0 to 1.
    pub metallic: f32,
    /// 0 to 1.
    pub roughness: f32,
    /// 0 to 1.
    pub transmission: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Radiance that it gives off.
    pub emission: [f32; 3],
    /// Base colour, where nothing gives another.
    pub color: [f32; 3],
    /// What is inside takes light away, per unit of length; only traced light knows lengths.
    pub absorption: [f32; 3],
}

/// How a light shines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightKind {
    /// Parallel light; its power is that on a square unit.
    Sun,
    /// Evenly to all sides.
    Point,
    /// As a point, in a cone.
    Spot,
    /// To one side; exact on the axis of a disc.
    Area,
}

/// A light.
#[derive(Clone, Copy, Debug)]
pub struct Light {
    /// How it shines.
    pub kind: LightKind,
    /// Where it is.
    pub position: [f32; 3],
    /// Unit: where it shines.
    pub direction: [f32; 3],
    /// Of each channel.
    pub power: [f32; 3],
    /// Of an area light, square units.
    pub area: f32,
    /// Of a spot: cosine of half its angle, and the share of it over which its border is soft.
    pub cone: [f32; 2],
    /// Of a point or a spot light; of a sun half the angle that it is seen under.
    pub radius: f32,
    /// Of an area light: width and height.
    pub size: [f32; 2],
    /// Of an area light, unit: along its width.
    pub right: [f32; 3],
    /// Whether an area light is an ellipse, else it is a rectangle.
    pub is_round: bool,
    /// Whether what is in its way hides it.
    pub casts_shadow: bool,
}

/// Three vectors of lanes: coordinates, or channels.
///
/// No closure works on vectors here: one that is not inlined is compiled without the path's instructions.
pub struct Triple<S: Simd>(pub [S::Vector; 3]);

impl<S: Simd> Clone for Triple<S> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<S: Simd> Copy for Triple<S> {}

impl<S: Simd> Triple<S> {
    /// The same numbers in every lane.
    #[inline(always)]
    pub fn splat(simd: S, numbers: [f32; 3]) -> Self {
        Self([simd.splat(numbers[0]), simd.splat(numbers[1]), simd.splat(numbers[2])])
    }

    /// The scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> S::Vector {
        let ([a, b, c], [d, e, f]) = (self.0, other.0);
        a.mul_add(d, b.mul_add(e, c * f))
    }

    /// Each part times a factor.
    #[inline(always)]
    pub fn scaled(self, factor: S::Vector) -> Self {
        let [a, b, c] = self.0;
        Self([a * factor, b * factor, c * factor])
    }
}

macro_rules! by_part {
    ($trait:ident, $method:ident, $operator:tt) => {
        impl<S: Simd> $trait for Triple<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let ([a, b, c], [d, e, f]) = (self.0, other.0);
                Self([a $operator d, b $operator e, c $operator f])
            }
        }
    };
}

by_part!(Add, add, +);
by_part!(Sub, sub, -);
by_part!(Mul, mul, *);

/// What a surface sends to the eye.
pub struct Shaded<S: Simd> {
    /// By itself.
    pub radiance: Triple<S>,
    /// The share of the light from behind that passes.
    pub transmittance: Triple<S>,
}

/// The parameters of sixteen materials.
pub struct Parameters<S: Simd> {
    metallic: S::Vector,
    roughness: S::Vector,
    transmission: S::Vector,
    ior: S::Vector,
    /// Radiance that they give off.
    pub emission: Triple<S>,
}

/// What becomes of light that meets facets; the rest is lost in metal.
pub struct Met<S: Simd> {
    /// The share that is reflected.
    pub reflected: Triple<S>,
    /// The share that enters.
    pub entering: S::Vector,
}

/// Sixteen points of surfaces.
pub struct Facing<S: Simd> {
    /// Unit, on the side of the eye.
    pub normal: Triple<S>,
    /// Unit.
    pub to_eye: Triple<S>,
    /// Base colour.
    pub base: Triple<S>,
}

impl<S: Simd> Parameters<S> {
    /// Those of the materials with these indices.
    #[inline(always)]
    pub fn gathered(simd: S, materials: &[Material], indices: &[usize; LANES]) -> Self {
        Self {
            metallic: gathered(simd, materials, indices, |material| material.metallic),
            roughness: gathered(simd, materials, indices, |material| material.roughness),
            transmission: gathered(simd, materials, indices, |material| material.transmission),
            ior: gathered(simd, materials, indices, |material| material.ior),
            emission: Triple([
                gathered(simd, materials, indices, |material| material.emission[0]),
                gathered(simd, materials, indices, |material| material.emission[1]),
                gathered(simd, materials, indices, |material| material.emission[2]),
            ]),
        }
    }

    /// Of those that are seen from within: air is what lies behind them.
    #[inline(always)]
    pub fn turn_inside_out(&mut self, simd: S, within: S::Mask) {
        self.ior = (simd.splat(1.0) / self.ior).select(within, self.ior);
    }

    /// The colour of what is matt, of light that enters.
    #[inline(always)]
    pub fn matt(&self, simd: S, base: Triple<S>) -> Triple<S> {
        base.scaled(simd.splat(1.0) - self.transmission)
    }

    /// The share that passes, of light that enters.
    #[inline(always)]
    pub fn clear(&self) -> S::Vector {
        self.transmission
    }

    /// What of a light's irradiance is sent to the eye: by what is matt, of which `matt` is seen through the surface, and by
    /// facets.
    #[inline(always)]
    pub fn sent(&self, simd: S, point: &Facing<S>, matt: Triple<S>, toward: Triple<S>) -> [Triple<S>; 2] {
        let facing = point.normal.dot(toward).max(simd.splat(0.0));
        let between = unit(simd, point.to_eye + toward);
        let near = toward.dot(between);
        let gloss = facets(simd, self.roughness, point.normal.dot(between), near, facing);
        let reflected = self.meet(simd, near, simd.splat(1.0), point.base).reflected;
        [matt.scaled(facing * simd.splat(1.0 / PI)), reflected.scaled(gloss)]
    }

    /// What becomes of light at an angle to facets, given its cosine. Of what they reflect a share is `shown`; the rest is hidden
    /// by others, which metal reflects once more, on average over all angles.
    #[inline(always)]
    pub fn meet(&self, simd: S, cosine: S::Vector, shown: S::Vector, base: Triple<S>) -> Met<S> {
        let one = simd.splat(1.0);
        let cosine = cosine.max(simd.splat(1e-3)).min(one);
        let dielectric = self.fresnel(simd, cosine);
        let grazing = one - cosine;
        let squared = grazing * grazing;
        let grazing = squared * squared * grazing;
        let mut reflected = base;
        for channel in &mut reflected.0 {
            let again = *channel + (one - *channel) * simd.splat(1.0 / 21.0);
            let metal = (*channel + (one - *channel) * grazing) * (shown + (one - shown) * again);
            *channel = dielectric + self.metallic * (metal - dielectric);
        }
        Met { reflected, entering: (one - self.metallic) * (one - dielectric) }
    }

    /// What of unpolarized light a smooth dielectric reflects.
    #[inline(always)]
    fn fresnel(&self, simd: S, cosine: S::Vector) -> S::Vector {
        let (one, ior) = (simd.splat(1.0), self.ior);
        let within = (one - (one - cosine * cosine) / (ior * ior)).max(simd.splat(0.0)).sqrt();
        let across = (cosine - ior * within) / (cosine + ior * within);
        let along = (ior * cosine - within) / (ior * cosine + within);
        simd.splat(0.5) * (across * across + along * along)
    }
}

/// A parameter of sixteen materials; nearly always these are one.
#[inline(always)]
fn gathered<S: Simd>(
    simd: S,
    materials: &[Material],
    indices: &[usize; LANES],
    parameter: impl Fn(&Material) -> f32,
) -> S::Vector {
    if *indices == [indices[0]; LANES] {
        return simd.splat(parameter(&materials[indices[0]]));
    }
    let mut lanes = Lanes::splat(0.0);
    for (lane, index) in lanes.0.iter_mut().zip(indices) {
        *lane = parameter(&materials[*index]);
    }
    simd.load(&lanes)
}

/// Sixteen numbers, or fewer and zeros.
#[inline(always)]
pub fn numbers<S: Simd>(simd: S, numbers: &[f32]) -> S::Vector {
    let mut lanes = Lanes::splat(0.0);
    lanes.0[..numbers.len()].copy_from_slice(numbers);
    simd.load(&lanes)
}

/// Sixteen vectors, or fewer and zeros.
#[inline(always)]
pub fn triples<S: Simd>(simd: S, triples: &[[f32; 3]]) -> Triple<S> {
    let (mut padded, mut lanes) = ([[0.0; 3]; LANES], [Lanes::splat(0.0); 3]);
    padded[..triples.len()].copy_from_slice(triples);
    for (lane, triple) in padded.iter().enumerate() {
        for axis in 0..3 {
            lanes[axis].0[lane] = triple[axis];
        }
    }
    Triple([simd.load(&lanes[0]), simd.load(&lanes[1]), simd.load(&lanes[2])])
}

/// The light of sixteen points whose normals face the eye.
#[inline(always)]
pub fn shade<S: Simd>(
    simd: S,
    scene: &Scene<'_>,
    material: &[usize; LANES],
    position: Triple<S>,
    normal: Triple<S>,
    to_eye: Triple<S>,
    base: Triple<S>,
) -> Shaded<S> {
    let parameters = Parameters::gathered(simd, scene.materials, material);
    let Met { reflected, entering } = parameters.meet(simd, normal.dot(to_eye), simd.splat(1.0), base);
    let matt = parameters.matt(simd, base).scaled(entering);
    let mut radiance = parameters.emission + (reflected + matt) * Triple::splat(simd, scene.world);
    let point = Facing { normal, to_eye, base };
    for light in scene.lights {
        let (toward, irradiance) = shine(simd, light, position);
        if simd.splat(0.0).lt(normal.dot(toward)).any() {
            let [diffuse, gloss] = parameters.sent(simd, &point, matt, toward);
            radiance = radiance + (diffuse + gloss) * irradiance;
        }
    }
    let transmittance = base.scaled(entering * parameters.clear());
    Shaded { radiance, transmittance }
}

/// What of a light's irradiance facets send to the eye, without what they let pass: Trowbridge and Reitz's distribution (GGX),
/// with the usual approximation of what they hide (Karis 2013).
#[inline(always)]
fn facets<S: Simd>(simd: S, roughness: S::Vector, cosine: S::Vector, near: S::Vector, facing: S::Vector) -> S::Vector {
    let one = simd.splat(1.0);
    let alpha = (roughness * roughness).max(simd.splat(0.002));
    let squared = alpha * alpha;
    let cosine = cosine.max(simd.splat(0.0));
    let spread = (cosine * cosine).mul_add(squared - one, one);
    let near = near.max(simd.splat(0.1));
    let hidden = simd.splat(4.0 * PI) * spread * spread * near * near * (alpha + simd.splat(0.5));
    (squared / hidden * facing).min(simd.splat(16.0))
}

/// Unit vectors to a light, and its irradiance on what faces it.
#[inline(always)]
fn shine<S: Simd>(simd: S, light: &Light, position: Triple<S>) -> (Triple<S>, Triple<S>) {
    let (one, zero) = (simd.splat(1.0), simd.splat(0.0));
    let power = Triple::splat(simd, light.power);
    let back = Triple::splat(simd, light.direction.map(|part| -part));
    if light.kind == LightKind::Sun {
        return (back, power);
    }
    let way = Triple::splat(simd, light.position) - position;
    let squared = way.dot(way).max(simd.splat(1e-12));
    let toward = way.scaled(one / squared.sqrt());
    let cosine = toward.dot(back);
    let share = match light.kind {
        LightKind::Area => cosine.max(zero) / (simd.splat(PI) * squared + simd.splat(light.area)),
        LightKind::Spot => {
            let soft = ((1.0 - light.cone[0]) * light.cone[1]).max(1e-6);
            let place = ((cosine - simd.splat(light.cone[0])) * simd.splat(1.0 / soft)).max(zero).min(one);
            place * place * (simd.splat(3.0) - simd.splat(2.0) * place) / (simd.splat(4.0 * PI) * squared)
        }
        LightKind::Point | LightKind::Sun => one / (simd.splat(4.0 * PI) * squared),
    };
    (toward, power.scaled(share))
}

#[inline(always)]
fn unit<S: Simd>(simd: S, vector: Triple<S>) -> Triple<S> {
    vector.scaled(simd.splat(1.0) / vector.dot(vector).max(simd.splat(1e-30)).sqrt())
}
