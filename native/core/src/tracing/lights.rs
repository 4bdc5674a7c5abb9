//! Lights that have a size.

use std::f64::consts::PI;

use crate::shading::{Light, LightKind};

use super::random;
use crate::vectors::{along, cross, difference, dot, double, plus, unit};

/// Light that comes to a point.
#[derive(Clone, Copy, Debug)]
pub struct Shine {
    /// Unit, to a point of the light.
    pub toward: [f64; 3],
    /// How far that is.
    pub distance: f64,
    /// On what faces it.
    pub irradiance: [f32; 3],
}

/// Light from a point of a light, such that the mean over all samples is the light of the whole; none where it does not shine.
///
/// A sun is a disc in the sky, a point or a spot light a sphere: both send the same radiance from everywhere on the side that is seen.
/// Of an area light every point is as likely.
#[inline(always)]
pub fn shine(light: &Light, position: [f64; 3], sample: [f64; 2]) -> Option<Shine> {
    let back = double(light.direction).map(|c| -c);
    if light.kind == LightKind::Sun {
        let flat = 1.0 - f64::from(light.radius).cos();
        let toward = along(back, random::in_cone(sample, flat));
        // Over the disc it is tilted, and lights less of what faces its middle.
        let share = 2.0 / (2.0 - flat);
        return Some(Shine { toward, distance: f64::INFINITY, irradiance: scaled(light.power, share) });
    }
    let way = difference(double(light.position), position);
    if light.kind == LightKind::Area {
        return area_shine(light, way, sample);
    }
    let (squared, radius) = (dot(way, way), f64::from(light.radius));
    if squared <= radius * radius {
        return None;
    }
    let middle = unit(way);
    let sine_squared = radius * radius / squared;
    let cosine = (1.0 - sine_squared).sqrt();
    let local = random::in_cone(sample, sine_squared / (1.0 + cosine));
    let distance = squared.sqrt();
    // Where the way meets the sphere first.
    let half_chord = (radius * radius - squared * (1.0 - local[2] * local[2])).max(0.0).sqrt();
    let share = cone_share(light, dot(middle, back)) / (2.0 * PI * squared * (1.0 + cosine));
    (share > 0.0).then(|| Shine {
        toward: along(middle, local),
        distance: distance * local[2] - half_chord,
        irradiance: scaled(light.power, share),
    })
}

/// Light from a point of an area light, to whose middle there is a way.
#[inline(always)]
fn area_shine(light: &Light, way: [f64; 3], [u, v]: [f64; 2]) -> Option<Shine> {
    let [x, y] = if light.is_round {
        let (sine, cosine) = (2.0 * PI * v).sin_cos();
        let radius = 0.5 * u.sqrt();
        [radius * cosine, radius * sine]
    } else {
        [u - 0.5, v - 0.5]
    };
    let [right, up] = sides(light);
    let way = plus(plus(way, x, right), y, up);
    let squared = dot(way, way);
    let toward = unit(way);
    let cosine = -dot(toward, double(light.direction));
    (cosine > 0.0).then(|| Shine { toward, distance: squared.sqrt(), irradiance: scaled(light.power, cosine / (PI * squared)) })
}

/// The radiance that a ray meets in a light before it meets anything at a distance.
#[inline(always)]
pub fn seen(light: &Light, origin: [f64; 3], direction: [f64; 3], end: f64) -> [f32; 3] {
    let (radius, axis) = (f64::from(light.radius), double(light.direction));
    let share = match light.kind {
        LightKind::Sun if radius > 0.0 => {
            let is_seen = end.is_infinite() && -dot(direction, axis) >= radius.cos();
            if is_seen { 1.0 / (PI * radius.sin().powi(2)) } else { 0.0 }
        }
        LightKind::Point | LightKind::Spot if radius > 0.0 => {
            let way = difference(double(light.position), origin);
            let (middle, squared) = (dot(way, direction), dot(way, way));
            let half_chord_squared = radius * radius - (squared - middle * middle);
            let is_met = half_chord_squared >= 0.0 && squared > radius * radius;
            let distance = middle - half_chord_squared.max(0.0).sqrt();
            let is_seen = is_met && distance > 0.0 && distance < end;
            if is_seen { cone_share(light, -dot(unit(way), axis)) / (4.0 * PI * PI * radius * radius) } else { 0.0 }
        }
        LightKind::Area if light.area > 0.0 => {
            let way = difference(double(light.position), origin);
            let cosine = -dot(direction, axis);
            let distance = -dot(way, axis) / cosine;
            let place = plus(way.map(|c| -c), distance, direction);
            let [x, y] = sides(light).map(|side| dot(place, side) / dot(side, side));
            let is_within = if light.is_round { x * x + y * y <= 0.25 } else { x.abs() <= 0.5 && y.abs() <= 0.5 };
            let is_seen = cosine > 0.0 && distance > 0.0 && distance < end && is_within;
            if is_seen { 1.0 / (PI * f64::from(light.area)) } else { 0.0 }
        }
        _ => return [0.0; 3],
    };
    scaled(light.power, share)
}

/// The sine of half the angle that a light is seen under.
#[inline(always)]
pub fn extent(light: &Light, position: [f64; 3]) -> f64 {
    let size = match light.kind {
        LightKind::Sun => return f64::from(light.radius).sin(),
        LightKind::Point | LightKind::Spot => f64::from(light.radius),
        LightKind::Area => (f64::from(light.area) / PI).sqrt(),
    };
    let way = difference(double(light.position), position);
    size / dot(way, way).sqrt().max(1e-12)
}

/// Width and height of an area light as vectors.
#[inline(always)]
fn sides(light: &Light) -> [[f64; 3]; 2] {
    let right = double(light.right);
    let up = cross(right, double(light.direction));
    [right.map(|c| c * f64::from(light.size[0])), up.map(|c| c * f64::from(light.size[1]))]
}

/// What of its light a spot sends at an angle to its axis, given its cosine; all where it is no spot.
#[inline(always)]
fn cone_share(light: &Light, cosine: f64) -> f64 {
    if light.kind != LightKind::Spot {
        return 1.0;
    }
    let [border, blend] = light.cone.map(f64::from);
    let soft = ((1.0 - border) * blend).max(1e-6);
    let place = ((cosine - border) / soft).clamp(0.0, 1.0);
    place * place * (3.0 - 2.0 * place)
}

#[inline(always)]
fn scaled(power: [f32; 3], share: f64) -> [f32; 3] {
    power.map(|channel| channel * share as f32)
}
