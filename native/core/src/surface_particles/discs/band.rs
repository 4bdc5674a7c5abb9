//! A band of rows of pixels: how far the nearest disc of each pixel is, and the surface that the discs show.

use super::disc::{BLEND_BEHIND, Disc, Meeting, Ray};
use crate::bands::{BAND, Bins, Centers, Place};
use crate::error::Result;
use crate::memory;
use crate::simd::{Simd, Task};
use crate::surface_particles::fluid::Fluid;
use crate::tile_caster::{Image, NO_BALL, View};
use crate::vectors::{dot, double, plus, single, unit};

/// How often a point is moved along its ray, how far at most in influence radii, and how near it must come.
const STEPS: usize = 12;
const LONGEST_STEP: f64 = 0.1;
const NEAR: f64 = 1e-5;

/// Where a ray hardly rises through the densities, it is taken to rise by this share of their slope.
const LEAST_RISE: f64 = 0.01;

/// How far beyond the front that was tried the next disc is looked for, in influence radii.
const BEYOND: f64 = 0.02;

/// Fronts of a pixel that are tried, one after the other, for one that leads to the surface.
const MOST_FRONTS: usize = 8;

/// Where no disc is looked for any more: farther than all of them.
const DONE: f64 = f64::INFINITY;

/// What is drawn into a band.
pub struct Band<'a> {
    pub fluid: &'a Fluid,
    pub view: &'a View,
    pub bins: &'a Bins,
    pub centers: &'a Centers,
    /// World space.
    pub discs: &'a [Disc],
    pub number: usize,
    pub can_start_inside: bool,
    pub is_exact: bool,
}

/// Draws a band into an image.
pub struct Drawing<'a> {
    band: Band<'a>,
    image: &'a Image<'a>,
}

/// A sum over the discs of a pixel, each by its weight.
#[derive(Clone, Copy, Default)]
struct Blend {
    weight: f64,
    /// Behind the front.
    distance: f64,
    normal: [f64; 3],
}

/// A point of the surface on a ray.
struct Shown {
    distance: f64,
    /// Unit, world space.
    normal: [f64; 3],
}

impl<'a> Band<'a> {
    pub fn drawn_into(self, image: &'a Image<'a>) -> Drawing<'a> {
        Drawing { band: self, image }
    }

    fn rows(&self) -> std::ops::Range<usize> {
        self.number * BAND..((self.number + 1) * BAND).min(self.view.height)
    }

    fn pixels(&self) -> usize {
        self.rows().len() * self.view.width
    }

    /// Column and row of a pixel in the image.
    fn place(&self, pixel: usize) -> [usize; 2] {
        [pixel % self.view.width, self.rows().start + pixel / self.view.width]
    }

    /// Its discs in camera space, in their order.
    fn discs(&self) -> Result<Vec<(Disc, Place)>> {
        let mut discs = Vec::new();
        for seen in self.bins.band(self.number) {
            memory::reserve(&mut discs, 1)?;
            discs.push((self.discs[seen.index as usize].in_view(self.view), seen.place));
        }
        Ok(discs)
    }

    /// The ray of a pixel in camera space.
    #[inline(always)]
    fn ray(&self, column: usize, row: usize) -> Ray {
        let [x, y] = [self.centers.columns[column], self.centers.rows[row]];
        if !self.view.is_perspective {
            return Ray { start: [x, y, 0.0], direction: [0.0, 0.0, 1.0] };
        }
        let inverse = 1.0 / (x * x + y * y + 1.0).sqrt();
        Ray { start: [0.0; 3], direction: [x * inverse, y * inverse, inverse] }
    }

    fn ray_of(&self, pixel: usize) -> Ray {
        let [column, row] = self.place(pixel);
        self.ray(column, row)
    }

    /// A point of a ray in world space.
    fn point(&self, ray: &Ray, distance: f64) -> [f64; 3] {
        self.turned(plus(ray.start, distance, ray.direction), self.view.eye)
    }

    /// A vector of camera space in world space, added to another.
    fn turned(&self, vector: [f64; 3], to: [f64; 3]) -> [f64; 3] {
        let rows = &self.view.camera_from_world;
        [0, 1, 2].map(|axis| to[axis] + dot(vector, [rows[0][axis], rows[1][axis], rows[2][axis]]))
    }

    /// Whether each ray starts inside the fluid, at the near clip distance.
    fn insides(&self) -> Result<Vec<bool>> {
        let mut insides = memory::filled(false, self.pixels())?;
        if self.can_start_inside {
            for (pixel, is_inside) in insides.iter_mut().enumerate() {
                let ray = self.ray_of(pixel);
                *is_inside = self.fluid.is_inside(self.point(&ray, self.view.clip[0] / ray.direction[2]));
            }
        }
        Ok(insides)
    }

    /// Visits each meeting of a disc and a ray that still looks for one: the pixel in the band, and the disc's radius.
    #[inline(always)]
    fn for_meetings(
        &self,
        discs: &[(Disc, Place)],
        insides: &[bool],
        beyonds: &[f64],
        mut visit: impl FnMut(usize, f64, Meeting),
    ) {
        let rows = self.rows();
        for (disc, place) in discs {
            let [first, end] = place.columns.map(usize::from);
            let [low, high] = place.rows.map(usize::from);
            for row in low.max(rows.start)..high.min(rows.end) {
                let line = (row - rows.start) * self.view.width;
                for column in first..end {
                    let pixel = line + column;
                    if beyonds[pixel] == DONE {
                        continue;
                    }
                    if let Some(meeting) = disc.meeting(&self.ray(column, row), insides[pixel], self.view.clip) {
                        visit(pixel, disc.radius, meeting);
                    }
                }
            }
        }
    }

    /// How far the nearest disc of each pixel is of those that are farther than `beyonds`; infinite where there is none.
    #[inline(always)]
    fn fronts(&self, discs: &[(Disc, Place)], insides: &[bool], beyonds: &[f64]) -> Result<Vec<f64>> {
        let mut fronts = memory::filled(f64::INFINITY, self.pixels())?;
        self.for_meetings(discs, insides, beyonds, |pixel, _, meeting| {
            if meeting.distance > beyonds[pixel] && meeting.distance < fronts[pixel] {
                fronts[pixel] = meeting.distance;
            }
        });
        Ok(fronts)
    }

    /// What the discs of each pixel show that are met at its front.
    #[inline(always)]
    fn blends(&self, discs: &[(Disc, Place)], insides: &[bool], fronts: &[f64]) -> Result<Vec<Blend>> {
        let mut blends = memory::filled(Blend::default(), self.pixels())?;
        self.for_meetings(discs, insides, fronts, |pixel, radius, meeting| {
            let behind = meeting.distance - fronts[pixel];
            if behind <= BLEND_BEHIND * radius {
                blends[pixel].add(&meeting, behind);
            }
        });
        Ok(blends)
    }

    /// Where a ray meets the surface near a front, between the clip depths; else from where on another front may be looked for.
    fn surface_near(&self, ray: &Ray, front: f64, starts_inside: bool) -> std::result::Result<Shown, f64> {
        let side = if starts_inside { -1.0 } else { 1.0 };
        let direction = self.turned(ray.direction, [0.0; 3]);
        let (mut distance, mut scale) = (front, 0.0);
        for _ in 0..STEPS {
            let sample = self.fluid.sample(self.point(ray, distance));
            let slope = dot(sample.gradient, sample.gradient).sqrt();
            let (rise, missing) =
                (side * dot(sample.gradient, direction), side * (self.fluid.field().isovalue - sample.density));
            scale = sample.scale.max(scale);
            if slope == 0.0 {
                break;
            }
            if missing.abs() <= NEAR * slope * sample.scale && rise > 0.0 {
                if self.is_between_clips(ray, distance) {
                    return Ok(Shown { distance, normal: sample.gradient.map(|c| -c / slope) });
                }
                break;
            }
            let longest = LONGEST_STEP * sample.scale;
            distance += (missing / rise.max(LEAST_RISE * slope)).clamp(-longest, longest);
        }
        Err(front + BEYOND * scale)
    }

    fn is_between_clips(&self, ray: &Ray, distance: f64) -> bool {
        let depth = distance * ray.direction[2];
        depth >= self.view.clip[0] && depth <= self.view.clip[1]
    }

    /// Draws the surface that the discs lead to.
    #[inline(always)]
    fn draw_surface(&self, discs: &[(Disc, Place)], insides: &[bool], image: &mut Writer<'_>) -> Result<()> {
        let mut beyonds = memory::filled(f64::NEG_INFINITY, self.pixels())?;
        for _ in 0..MOST_FRONTS {
            let fronts = self.fronts(discs, insides, &beyonds)?;
            for (pixel, beyond) in beyonds.iter_mut().enumerate().filter(|(pixel, _)| fronts[*pixel] < f64::INFINITY) {
                let found = self.surface_near(&self.ray_of(pixel), fronts[pixel], insides[pixel]);
                if let Ok(shown) = &found {
                    image.put(self, pixel, shown);
                }
                *beyond = found.err().unwrap_or(DONE);
            }
            // No disc is beyond where none was found.
            beyonds
                .iter_mut()
                .zip(&fronts)
                .filter(|(_, front)| **front == f64::INFINITY)
                .for_each(|(beyond, _)| *beyond = DONE);
            if beyonds.iter().all(|beyond| *beyond == DONE) {
                break;
            }
        }
        Ok(())
    }

    /// Draws the discs as they blend.
    #[inline(always)]
    fn draw_discs(&self, discs: &[(Disc, Place)], insides: &[bool], image: &mut Writer<'_>) -> Result<()> {
        let fronts = self.fronts(discs, insides, &memory::filled(f64::NEG_INFINITY, self.pixels())?)?;
        let blends = self.blends(discs, insides, &fronts)?;
        for (pixel, blend) in blends.iter().enumerate().filter(|(_, blend)| blend.weight > 0.0) {
            let distance = fronts[pixel] + blend.distance / blend.weight;
            image.put(self, pixel, &Shown { distance, normal: self.turned(unit(blend.normal), [0.0; 3]) });
        }
        Ok(())
    }
}

impl Task for Drawing<'_> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) -> Result<()> {
        let Self { band, image } = self;
        for pixel in 0..band.pixels() {
            image.put_background(band.place(pixel), 1);
        }
        let (discs, insides) = (band.discs()?, band.insides()?);
        let mut writer = Writer { image, carried: memory::filled([0.0; 3], image.attributes().len())? };
        if band.is_exact {
            band.draw_surface(&discs, &insides, &mut writer)
        } else {
            band.draw_discs(&discs, &insides, &mut writer)
        }
    }
}

impl Blend {
    fn add(&mut self, meeting: &Meeting, behind: f64) {
        self.weight += meeting.weight;
        self.distance += meeting.weight * behind;
        self.normal = plus(self.normal, meeting.weight, meeting.normal);
    }
}

/// Writes pixels.
struct Writer<'a> {
    image: &'a Image<'a>,
    /// Room for the attributes of one.
    carried: Vec<[f32; 3]>,
}

impl Writer<'_> {
    fn put(&mut self, band: &Band<'_>, pixel: usize, shown: &Shown) {
        let ray = band.ray_of(pixel);
        let ball = if self.image.wants_shares() { self.carry(band.fluid, band.point(&ray, shown.distance)) } else { NO_BALL };
        let depth = (shown.distance * ray.direction[2]) as f32;
        self.image.put_pixel(band.place(pixel), depth, single(shown.normal), ball, &self.carried);
    }

    /// Finds the attributes at a point, of the balls by their share of the density there; and the ball with the greatest, of
    /// equals the first.
    fn carry(&mut self, fluid: &Fluid, point: [f64; 3]) -> i32 {
        let (mut density, mut greatest, mut dominant) = (0.0, 0.0, NO_BALL);
        fluid.for_shares(point, |ball, share| {
            density += share;
            let ball = ball as i32;
            if share > greatest || (share == greatest && ball < dominant) {
                (greatest, dominant) = (share, ball);
            }
        });
        for (attribute, value) in self.image.attributes().iter().zip(&mut self.carried) {
            let mut sum = [0.0; 3];
            fluid.for_shares(point, |ball, share| sum = plus(sum, share, double(attribute.values(ball as u32))));
            *value = single(sum.map(|c| if density == 0.0 { 0.0 } else { c / density }));
        }
        dominant
    }
}
