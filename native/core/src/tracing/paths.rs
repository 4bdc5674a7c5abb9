//! Light followed back from the eye, a block of pixels at a time.

use crate::error::Result;
use crate::fitted_bvh::ray::Ray;
use crate::fitted_bvh::traversal::{Caster, Hit, Uncounted};
use crate::job::Job;
use crate::shading::material::{Facing, Met, Parameters, Triple, triples};
use crate::simd::{LANES, Lanes, Simd, Vector};

use super::lights::{self, Shine};
use super::random;
use super::triangles::{TriangleCaster, TriangleHit};
use super::{Scene, Settings, Surfaces};
use crate::vectors::{along, dot, double, plus, single, tangents, unit};

/// Paths that have met so many surfaces follow one way of those that open up, not both.
const SPLITS: u32 = 2;

/// What is left of light that is not worth another ray.
const DIM: f32 = 1e-4;

/// How far, in influence radii, methods may have found the surface from where it is, and as a share of the distance.
const METHOD_ERROR: f64 = 0.02;
const DEPTH_ERROR: f64 = 4e-6;

/// As a share of coordinates and distances: how far off a plane points on it may be computed.
const PLANE_ERROR: f64 = 1e-9;

/// No material: air.
const AIR: u32 = u32::MAX;

/// What random numbers are used for; lights follow.
const FACET: u32 = 0;
const CHOICE: u32 = 1;
const OCCLUSION: u32 = 2;
const REFLECTION: u32 = 3;
const REFRACTION: u32 = 4;
const LIGHTS: u32 = 5;

/// How a ray came about.
#[derive(Clone, Copy, Debug)]
struct Path {
    /// Index into the block's pixels.
    pixel: usize,
    seed: u32,
    reflections: u32,
    refractions: u32,
    /// Whether it passed all surfaces that it met.
    is_straight: bool,
    /// The greatest width of facets that mirrored it from outside. Smaller lights are not seen behind them: they would be sparks.
    spread: f64,
}

/// What a ray is cast for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Purpose {
    /// Finds the surface of its pixel again, exactly.
    Eye,
    /// Light that comes from whatever it meets, also from lights that were not counted where it began.
    Gather,
    /// Brings light from a light, as far as what it meets lets it pass.
    Shadow,
}

/// A ray on its way.
#[derive(Clone, Copy, Debug)]
struct Flight {
    ray: Ray,
    /// The share of the light that it finds, or what it brings.
    light: [f32; 3],
    path: Path,
    /// The material that it goes through, or `AIR`.
    medium: u32,
    purpose: Purpose,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug)]
struct Arrival {
    t: f64,
    /// For light, unit; and that of the surface itself, on the same side.
    normal: [f64; 3],
    geometric: [f64; 3],
    base: [f32; 3],
    material: u32,
    /// So far off it rays begin.
    lift: f64,
}

/// A point of a surface that is to be shaded.
#[derive(Clone, Copy, Debug)]
struct Vertex {
    flight: Flight,
    arrival: Arrival,
    position: [f64; 3],
    /// Whether it is seen from within; the normals are on the side of the ray.
    is_within: bool,
}

impl Vertex {
    /// A ray from it, on the side it is seen from or on the other.
    fn leaving(&self, direction: [f64; 3], t_max: f64, passes: bool) -> Ray {
        let lift = if passes { -self.arrival.lift } else { self.arrival.lift };
        Ray { origin: plus(self.position, lift, self.arrival.geometric), direction, t_min: 0.0, t_max }
    }

    /// What lies behind it.
    fn beyond(&self) -> u32 {
        if self.is_within { AIR } else { self.arrival.material }
    }
}

/// A question that any hit answers.
#[derive(Clone, Copy, Debug)]
enum Query {
    /// Whether light arrives.
    Light { ray: Ray, light: [f32; 3] },
    /// How much of the world a point sees.
    World { origin: [f64; 3], normal: [f64; 3], open: [f32; 3], light: [f32; 3], seed: u32, rays: u32 },
}

/// Traces blocks of pixels, one after another.
pub struct Tracer<'a, S: Simd> {
    simd: S,
    scene: &'a Scene<'a>,
    settings: &'a Settings,
    fluid: Caster<'a, S, Uncounted>,
    meshes: TriangleCaster<'a, S>,
    /// Whether light may pass through anything, so that shadows are not black or white.
    lets_pass: bool,
    /// The pixels of the block.
    pub pixels: Vec<u32>,
    radiance: Vec<[f32; 3]>,
    /// The share of what lies behind everything that is seen.
    behind: Vec<[f32; 3]>,
    sample: u32,
    flights: Vec<Flight>,
    next: Vec<Flight>,
    vertices: Vec<Vertex>,
    queries: Vec<(usize, Query)>,
}

impl<'a, S: Simd> Tracer<'a, S> {
    #[inline(always)]
    pub fn new(simd: S, scene: &'a Scene<'a>, settings: &'a Settings) -> Self {
        let lets_pass = scene.materials.iter().any(|material| material.transmission > 0.0 && material.metallic < 1.0);
        Self {
            simd,
            scene,
            settings,
            fluid: Caster::new(simd, scene.fluid.bvh, Uncounted),
            meshes: TriangleCaster::new(simd, scene.meshes.triangles),
            lets_pass,
            pixels: Vec::new(),
            radiance: Vec::new(),
            behind: Vec::new(),
            sample: 0,
            flights: Vec::new(),
            next: Vec::new(),
            vertices: Vec::new(),
            queries: Vec::new(),
        }
    }

    /// The mean radiance of a pixel of the block, and its alpha.
    pub fn seen(&self, pixel: usize) -> ([f32; 3], f32) {
        let mean = 1.0 / self.settings.samples as f32;
        let [r, g, b] = self.behind[pixel];
        (self.radiance[pixel].map(|channel| channel * mean), 1.0 - (r + g + b) * mean / 3.0)
    }

    /// Traces the pixels.
    #[inline(always)]
    pub fn trace(&mut self, surfaces: &Surfaces<'_>, job: &Job) -> Result<()> {
        self.radiance.clear();
        self.radiance.resize(self.pixels.len(), [0.0; 3]);
        self.behind.clear();
        self.behind.resize(self.pixels.len(), [0.0; 3]);
        for sample in 0..self.settings.samples {
            job.advance(0)?;
            self.sample = self.settings.image.wrapping_mul(self.settings.samples).wrapping_add(sample);
            self.begin(surfaces);
            while !self.flights.is_empty() {
                self.cast(surfaces);
                for start in (0..self.vertices.len()).step_by(LANES) {
                    self.shade(start, LANES.min(self.vertices.len() - start));
                }
                self.answer();
                std::mem::swap(&mut self.flights, &mut self.next);
            }
        }
        Ok(())
    }

    /// A ray from the eye to the surface of each pixel.
    fn begin(&mut self, surfaces: &Surfaces<'_>) {
        let view = surfaces.view;
        let [right, up, forward] = view.camera_from_world;
        for (index, pixel) in self.pixels.iter().enumerate() {
            let pixel = *pixel as usize;
            let [x, y] = view.pixel_center(pixel % view.width, pixel / view.width);
            let depth = f64::from(surfaces.depth[pixel]);
            let aside = plus(right.map(|c| c * x), y, up);
            let (origin, way) =
                if view.is_perspective { (view.eye, plus(aside, 1.0, forward)) } else { (plus(view.eye, 1.0, aside), forward) };
            let length = dot(way, way).sqrt();
            let (direction, t) = (unit(way), depth * length);
            let error = depth_error(surfaces, self.scene, pixel, t);
            let path = Path {
                pixel: index,
                seed: random::mixed(pixel as u32 + 1),
                reflections: 0,
                refractions: 0,
                is_straight: true,
                spread: 0.0,
            };
            let ray = Ray { origin, direction, t_min: (t - error).max(view.clip[0] * length).min(t), t_max: t + error };
            self.flights.push(Flight { ray, light: [1.0; 3], path, medium: AIR, purpose: Purpose::Eye });
        }
    }

    /// Finds what the rays meet.
    #[inline(always)]
    fn cast(&mut self, surfaces: &Surfaces<'_>) {
        self.vertices.clear();
        self.next.clear();
        for index in 0..self.flights.len() {
            let flight = self.flights[index];
            let ball = match flight.purpose {
                Purpose::Eye => Some(surfaces.ball[self.pixels[flight.path.pixel] as usize]),
                _ => None,
            };
            let hit = if ball.is_some_and(|ball| ball < 0) { None } else { self.fluid.first_hit(&flight.ray) };
            let mut arrival = None;
            if let Some(hit) = hit {
                arrival = Some(self.on_fluid(&flight, &hit));
            }
            if ball.is_none_or(|ball| ball < 0) {
                let end = arrival.map_or(flight.ray.t_max, |arrival| arrival.t);
                if let Some(met) = self.meshes.hit(&Ray { t_max: end, ..flight.ray }, false) {
                    arrival = Some(on_mesh(self.scene, &flight, &met));
                }
            }
            if flight.purpose == Purpose::Eye {
                arrival = Some(as_found(surfaces, self.scene, self.pixels[flight.path.pixel] as usize, &flight, arrival));
            }
            self.land(flight, arrival);
        }
    }

    #[inline(always)]
    fn on_fluid(&self, flight: &Flight, hit: &Hit) -> Arrival {
        let fluid = &self.scene.fluid;
        let material = fluid.materials.get(hit.ball as usize).map_or(0, |material| *material as u32);
        let base = if fluid.colors.is_empty() || flight.purpose == Purpose::Eye {
            self.scene.materials[material as usize].color
        } else {
            self.fluid.color(hit, plus(flight.ray.origin, hit.t, flight.ray.direction), fluid.colors)
        };
        let normal = double(hit.normal);
        Arrival { t: hit.t, normal, geometric: normal, base, material, lift: f64::from(hit.lift) }
    }

    /// What comes of a ray that met a surface, or none.
    fn land(&mut self, mut flight: Flight, arrival: Option<Arrival>) {
        let pixel = flight.path.pixel;
        if flight.purpose == Purpose::Gather {
            self.see_lights(&flight, arrival.map_or(f64::INFINITY, |arrival| arrival.t));
        }
        let Some(mut arrival) = arrival else {
            return match flight.purpose {
                Purpose::Shadow => add(&mut self.radiance[pixel], absorbed(self.scene, &flight, flight.ray.t_max)),
                _ => self.escape(&flight.path, flight.light, flight.ray.direction),
            };
        };
        let is_within = dot(arrival.geometric, flight.ray.direction) > 0.0;
        if is_within {
            arrival.normal = arrival.normal.map(|c| -c);
            arrival.geometric = arrival.geometric.map(|c| -c);
            if flight.purpose == Purpose::Eye {
                flight.medium = arrival.material;
            }
        }
        flight.light = absorbed(self.scene, &flight, arrival.t);
        let position = plus(flight.ray.origin, arrival.t, flight.ray.direction);
        self.vertices.push(Vertex { flight, arrival, position, is_within });
    }

    /// Adds the lights that a ray sees before it ends.
    fn see_lights(&mut self, flight: &Flight, end: f64) {
        let Ray { origin, direction, .. } = flight.ray;
        for light in self.scene.lights {
            if lights::extent(light, origin) > flight.path.spread {
                let radiance = lights::seen(light, origin, direction, end);
                add(&mut self.radiance[flight.path.pixel], times(flight.light, radiance));
            }
        }
    }

    /// Adds what the world sends; where the film is clear, what lies behind the picture is seen instead.
    fn escape(&mut self, path: &Path, light: [f32; 3], direction: [f64; 3]) {
        if path.is_straight && self.settings.is_film_clear {
            add(&mut self.behind[path.pixel], light);
        } else {
            add(&mut self.radiance[path.pixel], times(light, self.scene.world.radiance(direction)));
        }
    }

    /// Adds the light that some vertices send by themselves, and sends rays for the rest.
    #[inline(always)]
    fn shade(&mut self, start: usize, count: usize) {
        let simd = self.simd;
        let block = Block::new(&self.vertices[start..start + count], self.sample, self.scene);
        let point = Facing {
            normal: triples(simd, &block.normal),
            to_eye: triples(simd, &block.to_eye),
            base: triples(simd, &block.base),
        };
        let mut parameters = Parameters::gathered(simd, self.scene.materials, &block.material);
        parameters.turn_inside_out(simd, simd.mask(block.within));
        let Met { reflected, entering } = parameters.meet(simd, simd.load(&block.cosine), simd.load(&block.shown), point.base);
        let matt = parameters.matt(simd, point.base).scaled(entering);
        let [r, g, b] = point.base.0;
        let zero = simd.splat(0.0);
        // A body takes its colour from light in two halves, where this comes in and where it goes out.
        let tint = Triple([r.max(zero).sqrt(), g.max(zero).sqrt(), b.max(zero).sqrt()]);
        let passing = rows::<S>(tint.scaled(entering * parameters.clear()));
        let ambient = rows::<S>(matt);
        let (reflected, emission) = (rows::<S>(reflected), rows::<S>(parameters.emission));
        for lane in 0..count {
            let vertex = self.vertices[start + lane];
            if vertex.flight.purpose == Purpose::Shadow {
                self.pass_shadow(&vertex, passing[lane]);
                continue;
            }
            add(&mut self.radiance[vertex.flight.path.pixel], times(vertex.flight.light, emission[lane]));
            self.gather_world(&vertex, times(vertex.flight.light, ambient[lane]));
            self.send(&vertex, block.facet[lane], reflected[lane], passing[lane]);
        }
        for light in 0..self.scene.lights.len() {
            let shines = self.shines(start, count, light);
            if shines.iter().all(Option::is_none) {
                continue;
            }
            let toward = shines.map(|shine| shine.map_or([0.0; 3], |shine| single(shine.toward)));
            let [diffuse, gloss] = parameters.sent(simd, &point, matt, triples(simd, &toward));
            let (diffuse, gloss) = (rows::<S>(diffuse), rows::<S>(gloss));
            for lane in 0..count {
                if let Some(shine) = shines[lane] {
                    self.light(start + lane, light, &shine, diffuse[lane], gloss[lane]);
                }
            }
        }
    }

    /// What a light sends to some vertices.
    fn shines(&self, start: usize, count: usize, light: usize) -> [Option<Shine>; LANES] {
        let mut shines = [None; LANES];
        for (shine, vertex) in shines.iter_mut().zip(&self.vertices[start..start + count]) {
            if vertex.flight.purpose != Purpose::Shadow {
                let seed = random::branch(vertex.flight.path.seed, LIGHTS + light as u32);
                let sample = random::square(seed, self.sample);
                let found = lights::shine(&self.scene.lights[light], vertex.position, sample);
                *shine = found.filter(|shine| dot(shine.toward, vertex.arrival.normal) > 0.0);
            }
        }
        shines
    }

    /// Adds what a light lets a vertex send, or asks whether anything hides it.
    fn light(&mut self, vertex: usize, light: usize, shine: &Shine, diffuse: [f32; 3], gloss: [f32; 3]) {
        let Vertex { flight, arrival, position, is_within } = &self.vertices[vertex];
        let (source, material) = (&self.scene.lights[light], &self.scene.materials[arrival.material as usize]);
        // From within the light is not where a straight line says; and facets see lights that are wider than what they gather.
        let spread = flight.path.spread.max(alpha(material.roughness));
        let is_gathered = *is_within || lights::extent(source, *position) > spread;
        let sent = if is_gathered { diffuse } else { std::array::from_fn(|channel| diffuse[channel] + gloss[channel]) };
        let light = times(times(flight.light, sent), shine.irradiance);
        if light.iter().all(|channel| *channel <= 0.0) {
            return;
        }
        if !(self.settings.shadows && source.casts_shadow) {
            return add(&mut self.radiance[flight.path.pixel], light);
        }
        let ray = self.vertices[vertex].leaving(shine.toward, shine.distance, false);
        if self.lets_pass {
            let path = Path { refractions: 0, ..flight.path };
            self.next.push(Flight { ray, light, path, medium: flight.medium, purpose: Purpose::Shadow });
        } else {
            self.queries.push((flight.path.pixel, Query::Light { ray, light }));
        }
    }

    /// A ray from a light goes on behind what lets it pass.
    fn pass_shadow(&mut self, vertex: &Vertex, passing: [f32; 3]) {
        let Flight { ray, light, mut path, .. } = vertex.flight;
        let light = times(light, passing);
        if path.refractions >= self.settings.refractions || sum(light) <= 0.0 {
            return;
        }
        path.refractions += 1;
        let ray = vertex.leaving(ray.direction, ray.t_max - vertex.arrival.t, true);
        self.next.push(Flight { ray, light, path, medium: vertex.beyond(), purpose: Purpose::Shadow });
    }

    /// Adds what the world lets a vertex send by its matt part, or asks how much of it is seen.
    fn gather_world(&mut self, vertex: &Vertex, light: [f32; 3]) {
        if light == [0.0; 3] {
            return;
        }
        let Vertex { flight, arrival, .. } = vertex;
        let open = self.scene.world.irradiance(single(arrival.normal));
        if self.settings.occlusion_rays == 0 {
            return add(&mut self.radiance[flight.path.pixel], times(light, open));
        }
        // What is seen in mirrors may be noisier.
        let bounces = (flight.path.reflections + flight.path.refractions).min(8);
        let rays = (self.settings.occlusion_rays >> (2 * bounces)).max(1);
        let Ray { origin, .. } = vertex.leaving(arrival.normal, 0.0, false);
        let seed = random::branch(flight.path.seed, OCCLUSION);
        self.queries.push((flight.path.pixel, Query::World { origin, normal: arrival.normal, open, light, seed, rays }));
    }

    /// Sends rays for what a vertex reflects and lets pass.
    fn send(&mut self, vertex: &Vertex, facet: [f64; 3], reflected: [f32; 3], passing: [f32; 3]) {
        let Flight { light, path, .. } = vertex.flight;
        let mut parts = [times(light, reflected), times(light, passing)];
        if path.reflections + path.refractions >= SPLITS {
            let [mirrored, passed] = parts.map(sum);
            let share = if mirrored + passed > 0.0 { mirrored / (mirrored + passed) } else { 1.0 };
            let [choice, _] = random::square(random::branch(path.seed, CHOICE), self.sample);
            let (kept, dropped, share) = if choice < f64::from(share) { (0, 1, share) } else { (1, 0, 1.0 - share) };
            parts[kept] = parts[kept].map(|channel| channel / share);
            parts[dropped] = [0.0; 3];
        }
        let [mirrored, passed] = parts;
        if sum(mirrored) > 0.0 {
            let direction = mirror(vertex, facet);
            let is_last = path.reflections >= self.settings.reflections;
            let path = Path {
                seed: random::branch(path.seed, REFLECTION),
                reflections: path.reflections + 1,
                is_straight: false,
                ..path
            };
            self.gather(vertex, direction, mirrored, path, is_last, false);
        }
        if sum(passed) > 0.0 {
            let ior = f64::from(self.scene.materials[vertex.arrival.material as usize].ior);
            let direction = refract(vertex, facet, if vertex.is_within { ior } else { 1.0 / ior });
            let is_last = path.refractions >= self.settings.refractions;
            let path = Path { seed: random::branch(path.seed, REFRACTION), refractions: path.refractions + 1, ..path };
            self.gather(vertex, direction, passed, path, is_last, true);
        }
    }

    /// A ray for the light from a direction; the last of a path sees lights and world at once.
    fn gather(&mut self, vertex: &Vertex, direction: [f64; 3], light: [f32; 3], mut path: Path, is_last: bool, passes: bool) {
        let ray = vertex.leaving(direction, f64::INFINITY, passes);
        let medium = if passes { vertex.beyond() } else { vertex.flight.medium };
        let roughness = self.scene.materials[vertex.arrival.material as usize].roughness;
        if !(passes || vertex.is_within) {
            path.spread = path.spread.max(alpha(roughness));
        }
        let flight = Flight { ray, light, path, medium, purpose: Purpose::Gather };
        if is_last || is_dim(light) {
            self.see_lights(&flight, f64::INFINITY);
            self.escape(&path, light, direction);
        } else {
            self.next.push(flight);
        }
    }

    /// Answers what was asked.
    #[inline(always)]
    fn answer(&mut self) {
        for index in 0..self.queries.len() {
            let (pixel, query) = self.queries[index];
            let (count, mut hidden) = (if let Query::World { rays, .. } = query { rays } else { 1 }, [0.0; 3]);
            for number in 0..count {
                let ray = self.asking(&query, number);
                if self.fluid.any_hit(&ray) || self.meshes.hit(&ray, true).is_some() {
                    let is_world = matches!(query, Query::World { .. });
                    add(&mut hidden, if is_world { self.scene.world.radiance(ray.direction) } else { [1.0; 3] });
                }
            }
            let sent = match query {
                Query::Light { light, .. } => light.map(|channel| channel * (1.0 - hidden[0])),
                Query::World { open, light, .. } => {
                    std::array::from_fn(|channel| light[channel] * (open[channel] - hidden[channel] / count as f32).max(0.0))
                }
            };
            add(&mut self.radiance[pixel], sent);
        }
        self.queries.clear();
    }

    /// A ray of a query.
    fn asking(&self, query: &Query, number: u32) -> Ray {
        match *query {
            Query::Light { ray, .. } => ray,
            Query::World { origin, normal, seed, rays, .. } => {
                let sample = random::square(seed, self.sample.wrapping_mul(rays).wrapping_add(number));
                let direction = unit(along(normal, random::by_cosine(sample)));
                Ray { origin, direction, t_min: 0.0, t_max: self.settings.occlusion_distance }
            }
        }
    }
}

/// Sixteen vertices or fewer, ready for vectors.
struct Block {
    normal: [[f32; 3]; LANES],
    to_eye: [[f32; 3]; LANES],
    base: [[f32; 3]; LANES],
    material: [usize; LANES],
    within: u16,
    /// Normals of the facets that mirror and let pass, and the cosines of their angles to the eye.
    facet: [[f64; 3]; LANES],
    cosine: Lanes,
    /// The share of what the facets mirror that others do not hide.
    shown: Lanes,
}

impl Block {
    fn new(vertices: &[Vertex], sample: u32, scene: &Scene<'_>) -> Self {
        let mut block = Self {
            normal: [[0.0; 3]; LANES],
            to_eye: [[0.0; 3]; LANES],
            base: [[0.0; 3]; LANES],
            material: [vertices[0].arrival.material as usize; LANES],
            within: 0,
            facet: [[0.0; 3]; LANES],
            cosine: Lanes::splat(1.0),
            shown: Lanes::splat(1.0),
        };
        for (lane, vertex) in vertices.iter().enumerate() {
            let to_eye = vertex.flight.ray.direction.map(|c| -c);
            block.normal[lane] = single(vertex.arrival.normal);
            block.to_eye[lane] = single(to_eye);
            block.base[lane] = vertex.arrival.base;
            block.material[lane] = vertex.arrival.material as usize;
            block.within |= u16::from(vertex.is_within) << lane;
            let roughness = scene.materials[vertex.arrival.material as usize].roughness;
            let is_smooth = roughness <= 0.0 || vertex.flight.purpose == Purpose::Shadow;
            block.facet[lane] = if is_smooth { vertex.arrival.normal } else { facet(vertex, to_eye, roughness, sample) };
            block.cosine.0[lane] = dot(block.facet[lane], to_eye) as f32;
            if !is_smooth {
                block.shown.0[lane] = shown(vertex, block.facet[lane], roughness) as f32;
            }
        }
        block
    }
}

/// The normal of a facet that an eye sees.
fn facet(vertex: &Vertex, to_eye: [f64; 3], roughness: f32, sample: u32) -> [f64; 3] {
    let normal = vertex.arrival.normal;
    let [right, up] = tangents(normal);
    let local = [dot(to_eye, right), dot(to_eye, up), dot(to_eye, normal).max(1e-6)];
    let point = random::square(random::branch(vertex.flight.path.seed, FACET), sample);
    along(normal, random::facet(unit(local), alpha(roughness), point))
}

/// The share of what a facet mirrors that others do not hide, of those that are seen (Smith; Heitz 2014).
fn shown(vertex: &Vertex, facet: [f64; 3], roughness: f32) -> f64 {
    let direction = vertex.flight.ray.direction;
    let normal = vertex.arrival.normal;
    let mirrored = dot(plus(direction, -2.0 * dot(direction, facet), facet), normal);
    if mirrored <= 0.0 {
        return 0.0;
    }
    let squared = alpha(roughness).powi(2);
    let hidden = |cosine: f64| {
        let cosine_squared = cosine.clamp(1e-3, 1.0).powi(2);
        0.5 * ((1.0 + squared * (1.0 - cosine_squared) / cosine_squared).sqrt() - 1.0)
    };
    let seen = 1.0 + hidden(-dot(direction, normal));
    seen / (seen + hidden(mirrored))
}

/// The width of the facets' distribution.
fn alpha(roughness: f32) -> f64 {
    f64::from(roughness * roughness)
}

/// Where a facet mirrors the ray to, always on the side it comes from.
fn mirror(vertex: &Vertex, facet: [f64; 3]) -> [f64; 3] {
    let direction = vertex.flight.ray.direction;
    let mirrored = plus(direction, -2.0 * dot(direction, facet), facet);
    toward_side(mirrored, vertex.arrival.geometric)
}

/// Where a ray goes on behind a facet, always on the other side; `ratio` of the indices of refraction before and behind it. Where
/// nothing passes (total reflection) the direction does not count.
fn refract(vertex: &Vertex, facet: [f64; 3], ratio: f64) -> [f64; 3] {
    let direction = vertex.flight.ray.direction;
    let cosine = -dot(direction, facet);
    let behind = (1.0 - ratio * ratio * (1.0 - cosine * cosine)).max(0.0).sqrt();
    let refracted = plus(direction.map(|c| c * ratio), ratio * cosine - behind, facet);
    toward_side(unit(refracted), vertex.arrival.geometric.map(|c| -c))
}

/// The direction, or its mirror image on the side of a normal.
fn toward_side(direction: [f64; 3], side: [f64; 3]) -> [f64; 3] {
    let cosine = dot(direction, side);
    unit(if cosine < 0.0 { plus(direction, -2.0 * cosine, side) } else { direction })
}

/// How far from the depth of a pixel its surface may be.
fn depth_error(surfaces: &Surfaces<'_>, scene: &Scene<'_>, pixel: usize, t: f64) -> f64 {
    let of_method = match usize::try_from(surfaces.ball[pixel]) {
        Ok(ball) => METHOD_ERROR * f64::from(scene.fluid.radii[ball]),
        Err(_) => 0.0,
    };
    of_method + DEPTH_ERROR * t
}

/// The surface of a pixel: where it was found again there, else where the image has it; with the image's colours.
fn as_found(surfaces: &Surfaces<'_>, scene: &Scene<'_>, pixel: usize, flight: &Flight, again: Option<Arrival>) -> Arrival {
    let (base, material) = (surfaces.color[pixel], surfaces.material[pixel] as u32);
    if let Some(arrival) = again {
        return Arrival { base, material, ..arrival };
    }
    let normal = unit(double(surfaces.normal[pixel]));
    let lift = depth_error(surfaces, scene, pixel, flight.ray.t_max);
    Arrival { t: flight.ray.t_max - lift, normal, geometric: normal, base, material, lift }
}

fn on_mesh(scene: &Scene<'_>, flight: &Flight, met: &TriangleHit) -> Arrival {
    let material = scene.meshes.materials[met.triangle] as u32;
    let corners = &scene.meshes.normals[met.triangle];
    let [u, v] = met.shares;
    let normal = unit(std::array::from_fn(|axis| {
        let [a, b, c] = [0, 3, 6].map(|corner| f64::from(corners[corner + axis]));
        a + u * (b - a) + v * (c - a)
    }));
    let geometric = if dot(normal, met.normal) < 0.0 { met.normal.map(|c| -c) } else { met.normal };
    let position = plus(flight.ray.origin, met.t, flight.ray.direction);
    let farthest = position.into_iter().chain(flight.ray.origin).fold(0.0, |most: f64, c| most.max(c.abs()));
    let base = scene.materials[material as usize].color;
    Arrival { t: met.t, normal, geometric, base, material, lift: PLANE_ERROR * farthest }
}

/// What is left of a ray's light after a way through its medium (Beer).
fn absorbed(scene: &Scene<'_>, flight: &Flight, length: f64) -> [f32; 3] {
    if flight.medium == AIR || length.is_infinite() {
        return flight.light;
    }
    let absorption = scene.materials[flight.medium as usize].absorption;
    std::array::from_fn(|channel| flight.light[channel] * (-absorption[channel] * length as f32).exp())
}

fn is_dim(light: [f32; 3]) -> bool {
    light.iter().all(|channel| *channel < DIM)
}

fn sum([r, g, b]: [f32; 3]) -> f32 {
    r + g + b
}

fn times(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

fn add(total: &mut [f32; 3], part: [f32; 3]) {
    for (total, part) in total.iter_mut().zip(part) {
        *total += part;
    }
}

/// The vectors of sixteen lanes.
#[inline(always)]
fn rows<S: Simd>(columns: Triple<S>) -> [[f32; 3]; LANES] {
    let [a, b, c] = columns.0;
    let (a, b, c) = (a.lanes().0, b.lanes().0, c.lanes().0);
    let mut rows = [[0.0; 3]; LANES];
    for (lane, row) in rows.iter_mut().enumerate() {
        *row = [a[lane], b[lane], c[lane]];
    }
    rows
}
