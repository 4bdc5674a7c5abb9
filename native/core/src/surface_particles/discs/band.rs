//! A band of rows of pixels: the fronts of its pixels, what is blended there, and the surface that this shows.

use super::disc::{BLEND_BEHIND, Disc, Meeting, Ray};
use crate::bands::{BAND, Bins, Centers, Place};
use crate::error::Result;
use crate::memory;
use crate::simd::{Simd, Task};
use crate::surface_particles::fluid::Fluid;
use crate::tile_caster::{Image, NO_BALL, View};
use crate::vectors::{dot, double, plus, single};

/// How often a point is moved along its ray, how far at most in influence radii, and how near it must come.
const STEPS: usize = 6;
const LONGEST_STEP: f64 = 0.1;
const NEAR: f64 = 1e-5;

/// Where a ray hardly rises through the densities, it is taken to rise by this share of their slope.
const LEAST_RISE: f64 = 0.05;

/// How far beyond the middle of what was tried the next sheet begins, in influence radii.
const BEYOND: f64 = 0.02;

/// Sheets of a pixel that are looked at, one after the other, for one that leads to the surface.
const MOST_SHEETS: usize = 8;

/// Where no sheet is looked for any more: farther than all of them.
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
#[derive(Clone, Copy)]
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
                let [column, row] = self.place(pixel);
                let ray = self.ray(column, row);
                *is_inside = self.fluid.is_inside(self.point(&ray, self.view.clip[0] / ray.direction[2]));
            }
        }
        Ok(insides)
    }

    /// Visits each meeting of a disc and a ray that lies beyond what was tried before: the pixel in the band, and the disc's radius.
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
                    let meeting = disc.meeting(&self.ray(column, row), insides[pixel], self.view.clip);
                    if let Some(meeting) = meeting.filter(|meeting| meeting.distance > beyonds[pixel]) {
                        visit(pixel, disc.radius, meeting);
                    }
                }
            }
        }
    }

    /// The nearest sheet of each pixel beyond what was tried before: how far its front is, and the blend there.
    #[inline(always)]
    fn sheet(&self, discs: &[(Disc, Place)], insides: &[bool], beyonds: &[f64]) -> Result<(Vec<f64>, Vec<Blend>)> {
        let mut fronts = memory::filled(f64::INFINITY, self.pixels())?;
        self.for_meetings(discs, insides, beyonds, |pixel, _, meeting| fronts[pixel] = fronts[pixel].min(meeting.distance));
        let mut blends = memory::filled(Blend::default(), self.pixels())?;
        self.for_meetings(discs, insides, beyonds, |pixel, radius, meeting| {
            let behind = meeting.distance - fronts[pixel];
            if behind <= BLEND_BEHIND * radius {
                blends[pixel].add(&meeting, behind);
            }
        });
        Ok((fronts, blends))
    }

    /// Where a ray meets the surface near a distance, between the clip depths; else from where on it may be looked for.
    fn surface_near(&self, ray: &Ray, near: f64, starts_inside: bool) -> std::result::Result<Shown, f64> {
        let side = if starts_inside { -1.0 } else { 1.0 };
        let direction = self.turned(ray.direction, [0.0; 3]);
        let (mut distance, mut radius) = (near, 0.0);
        for _ in 0..STEPS {
            let sample = self.fluid.sample(self.point(ray, distance));
            let slope = dot(sample.gradient, sample.gradient).sqrt();
            let (rise, missing) =
                (side * dot(sample.gradient, direction), side * (self.fluid.field().isovalue - sample.density));
            radius = sample.radius.max(radius);
            if slope == 0.0 {
                break;
            }
            if missing.abs() <= NEAR * slope * sample.radius && rise > 0.0 {
                let shown = Shown { distance, normal: sample.gradient.map(|c| -c / slope) };
                return if self.is_between_clips(ray, distance) { Ok(shown) } else { Err(near + BEYOND * radius) };
            }
            let longest = LONGEST_STEP * sample.radius;
            distance += (missing / rise.max(LEAST_RISE * slope)).clamp(-longest, longest);
        }
        Err(near + BEYOND * radius)
    }

    fn is_between_clips(&self, ray: &Ray, distance: f64) -> bool {
        let depth = distance * ray.direction[2];
        depth >= self.view.clip[0] && depth <= self.view.clip[1]
    }

    /// What a sheet shows; where that is nothing, from where on the next one may be looked for.
    fn shown(&self, ray: &Ray, front: f64, blend: &Blend, starts_inside: bool) -> std::result::Result<Shown, f64> {
        let distance = front + blend.distance / blend.weight;
        if self.is_exact {
            return self.surface_near(ray, distance, starts_inside);
        }
        let length = dot(blend.normal, blend.normal).sqrt();
        Ok(Shown { distance, normal: self.turned(blend.normal.map(|c| c / length), [0.0; 3]) })
    }
}

impl Task for Drawing<'_> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) -> Result<()> {
        let Self { band, image } = self;
        let (discs, insides) = (band.discs()?, band.insides()?);
        for pixel in 0..band.pixels() {
            image.put_background(band.place(pixel), 1);
        }
        let mut beyonds = memory::filled(f64::NEG_INFINITY, band.pixels())?;
        let mut carried = memory::filled([0.0; 3], image.attributes().len())?;
        for _ in 0..MOST_SHEETS {
            let (fronts, blends) = band.sheet(&discs, &insides, &beyonds)?;
            for (pixel, beyond) in beyonds.iter_mut().enumerate().filter(|(_, beyond)| **beyond != DONE) {
                if blends[pixel].weight == 0.0 {
                    *beyond = DONE;
                    continue;
                }
                let place = band.place(pixel);
                let ray = band.ray(place[0], place[1]);
                let shown = band.shown(&ray, fronts[pixel], &blends[pixel], insides[pixel]);
                if let Ok(shown) = shown {
                    put(&band, image, place, &ray, &shown, &mut carried);
                }
                *beyond = shown.err().unwrap_or(DONE);
            }
            if beyonds.iter().all(|beyond| *beyond == DONE) {
                break;
            }
        }
        Ok(())
    }
}

impl Blend {
    fn add(&mut self, meeting: &Meeting, behind: f64) {
        self.weight += meeting.weight;
        self.distance += meeting.weight * behind;
        self.normal = plus(self.normal, meeting.weight, meeting.normal);
    }
}

/// Writes a pixel; `carried` is room for the attributes.
fn put(band: &Band<'_>, image: &Image<'_>, place: [usize; 2], ray: &Ray, shown: &Shown, carried: &mut [[f32; 3]]) {
    let ball = if image.wants_shares() { carry(band.fluid, image, band.point(ray, shown.distance), carried) } else { NO_BALL };
    image.put_pixel(place, (shown.distance * ray.direction[2]) as f32, single(shown.normal), ball, carried);
}

/// Finds the attributes at a point, of the balls by their share of the density there; and the ball with the greatest, of equals
/// the first.
fn carry(fluid: &Fluid, image: &Image<'_>, point: [f64; 3], carried: &mut [[f32; 3]]) -> i32 {
    let (mut density, mut greatest, mut dominant) = (0.0, 0.0, NO_BALL);
    fluid.for_shares(point, |ball, share| {
        density += share;
        let ball = ball as i32;
        if share > greatest || (share == greatest && ball < dominant) {
            (greatest, dominant) = (share, ball);
        }
    });
    for (attribute, value) in image.attributes().iter().zip(carried) {
        let mut sum = [0.0; 3];
        fluid.for_shares(point, |ball, share| sum = plus(sum, share, double(attribute.values(ball as u32))));
        *value = single(sum.map(|c| if density == 0.0 { 0.0 } else { c / density }));
    }
    dominant
}
