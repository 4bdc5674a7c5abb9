//! A band of rows of pixels: its triangles are drawn one after the other, then normals are found where one is seen.

use super::triangle::{Edges, plane_normal};
use super::{NO_TRIANGLE, Triangles, View, dot};
use crate::bands::{BAND, Bins, Centers, Seen};
use crate::error::Result;
use crate::job::Job;
use crate::simd::{Simd, Task};

/// Columns that are tested together before their pixels are looked at.
const SPAN: usize = 32;

/// Triangles after which drawing asks whether the user gave up.
const CHECKED: usize = 256;

/// The rows of the image that make the band.
pub struct Rows<'a> {
    pub depth: &'a mut [f32],
    pub triangle: &'a mut [i32],
    pub normal: &'a mut [[f32; 3]],
}

/// Draws a band.
pub struct Band<'a> {
    pub triangles: &'a Triangles<'a>,
    pub view: &'a View,
    pub bins: &'a Bins,
    pub centers: &'a Centers,
    pub number: usize,
    pub background: f32,
    pub rows: Rows<'a>,
    pub job: &'a Job,
}

impl Task for Band<'_> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<S: Simd>(mut self, _simd: S) -> Result<()> {
        self.rows.depth.fill(self.background);
        self.rows.triangle.fill(NO_TRIANGLE);
        for (count, seen) in self.bins.band(self.number).enumerate() {
            if count % CHECKED == 0 {
                self.job.advance(0)?;
            }
            self.draw(seen);
        }
        for row in 0..self.rows.depth.len() / self.view.width {
            self.finish(row);
        }
        Ok(())
    }
}

impl Band<'_> {
    /// Draws what of a triangle lies in the band.
    #[inline(always)]
    fn draw(&mut self, seen: &Seen) {
        let bottom = self.number * BAND;
        let [first, end] = seen.place.columns.map(usize::from);
        let [low, high] = seen.place.rows.map(usize::from);
        let (low, high) = (low.max(bottom), high.min(bottom + BAND));
        let corners = self.triangles.in_view(seen.index as usize, self.view);
        let triangle =
            Drawn { edges: Edges::new(&corners, self.view.is_perspective), index: seen.index as i32, clip: self.view.clip };
        let rows = [self.centers.rows[low], self.centers.rows[high - 1]];
        for start in (first..end).step_by(SPAN) {
            let stop = (start + SPAN).min(end);
            let columns = &self.centers.columns[start..stop];
            if triangle.edges.miss([columns[0], columns[columns.len() - 1]], rows) {
                continue;
            }
            for row in low..high {
                let line = (row - bottom) * self.view.width;
                let part = line + start..line + stop;
                let (depth, found) = (&mut self.rows.depth[part.clone()], &mut self.rows.triangle[part]);
                triangle.draw(columns, self.centers.rows[row], depth, found);
            }
        }
    }

    /// Writes the normals of a row.
    #[inline(always)]
    fn finish(&mut self, row: usize) {
        let width = self.view.width;
        let pixels = row * width..(row + 1) * width;
        let y = self.centers.rows[self.number * BAND + row];
        let mut last = None;
        let found = self.rows.triangle[pixels.clone()].iter().zip(&self.centers.columns);
        for ((index, x), normal) in found.zip(&mut self.rows.normal[pixels]) {
            let Ok(index) = usize::try_from(*index) else {
                *normal = [0.0; 3];
                continue;
            };
            let facet = match last {
                Some((of, facet)) if of == index => facet,
                _ => Facet::new(self.triangles, index, self.view),
            };
            last = Some((index, facet));
            *normal = facet.normal(&self.triangles.normals[index], [*x, y]);
        }
    }
}

/// A triangle as it is drawn.
struct Drawn {
    edges: Edges,
    index: i32,
    clip: [f64; 2],
}

impl Drawn {
    /// Draws what of it lies in a part of a row, where it is nearer than what is there.
    ///
    /// A plain loop without branches, of which compilers make vectors.
    #[inline(always)]
    fn draw(&self, columns: &[f64], y: f64, depth: &mut [f32], triangle: &mut [i32]) {
        let ([f, g, h], depths) = (&self.edges.functions, &self.edges.depths);
        let up = [f[1] * y, g[1] * y, h[1] * y];
        for ((x, depth), triangle) in columns.iter().zip(depth).zip(triangle) {
            let (a, b, c) = (f[0] * x + up[0] + f[2], g[0] * x + up[1] + g[2], h[0] * x + up[2] + h[2]);
            let is_inside = ((a >= 0.0) & (b >= 0.0) & (c >= 0.0)) | ((a <= 0.0) & (b <= 0.0) & (c <= 0.0));
            // Where all values are 0 this is not a number, and fails each comparison.
            let mean = (a * depths[0] + b * depths[1] + c * depths[2]) / (a + b + c);
            let is_seen = is_inside & (mean >= self.clip[0]) & (mean <= self.clip[1]);
            let found = if is_seen { mean } else { f64::INFINITY } as f32;
            let is_nearer = found < *depth;
            *depth = if is_nearer { found } else { *depth };
            *triangle = if is_nearer { self.index } else { *triangle };
        }
    }
}

/// A triangle whose normals are asked for.
#[derive(Clone, Copy)]
struct Facet {
    edges: Edges,
    plane: [f64; 3],
}

impl Facet {
    #[inline(always)]
    fn new(triangles: &Triangles<'_>, index: usize, view: &View) -> Self {
        let corners = triangles.in_view(index, view);
        Self { edges: Edges::new(&corners, view.is_perspective), plane: plane_normal(&corners, view) }
    }

    /// The normal where the ray of a place in the window meets it, towards the eye; `normals` are those of its corners.
    #[inline(always)]
    fn normal(&self, normals: &[f32; 9], place: [f64; 2]) -> [f32; 3] {
        let [a, b, c] = self.edges.values(place);
        let blend =
            |axis: usize| a * f64::from(normals[axis]) + b * f64::from(normals[3 + axis]) + c * f64::from(normals[6 + axis]);
        let blended = [blend(0), blend(1), blend(2)];
        let length = dot(blended, blended).sqrt();
        if length.is_nan() || length <= 0.0 {
            return [0.0; 3];
        }
        // The values are negative, and the blend is opposite to the mean, where the ray looks against the normal of the plane.
        // The side that is seen decides, as a smooth normal may already point away from the eye.
        let is_turned = (a + b + c < 0.0) != (dot(self.plane, blended) > 0.0);
        let sign = if is_turned { -1.0 } else { 1.0 };
        blended.map(|part| (sign * part / length) as f32)
    }
}
