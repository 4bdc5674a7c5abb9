//! A band of rows of pixels: its glyphs are drawn from front to back, then normals are found where one is seen.

use super::shape::{Ray, Rays, Row};
use super::{Glyphs, NO_GLYPH, View, dot};
use crate::bands::{BAND, Bins, Centers, Seen};
use crate::error::Result;
use crate::job::Job;
use crate::memory;
use crate::simd::{Simd, Task};

/// Glyphs after which drawing asks whether the user gave up.
const CHECKED: usize = 256;

/// The rows of the image that make the band.
pub struct Rows<'a> {
    pub depth: &'a mut [f32],
    pub glyph: &'a mut [i32],
    pub normal: &'a mut [[f32; 3]],
}

/// Draws a band.
pub struct Band<'a> {
    pub glyphs: &'a Glyphs<'a>,
    pub view: &'a View,
    pub bins: &'a Bins,
    pub centers: &'a Centers,
    pub number: usize,
    pub background: f32,
    pub rows: Rows<'a>,
    pub job: &'a Job,
}

/// Columns of a block: a part of the band of which is known how far it is covered.
const BLOCK: usize = 32;

/// Glyphs that are drawn into a block before it is asked again how far it is covered.
const DRAWN: u32 = 8;

/// How far the pixels of a block are covered.
#[derive(Clone, Copy)]
struct Block {
    /// Nothing behind this planar depth is seen in it.
    farthest: f32,
    /// Glyphs that were drawn since.
    drawn: u32,
}

/// A glyph of the band, in front of which there is nothing of it before `front`.
struct Entry<'a> {
    front: f32,
    seen: &'a Seen,
}

impl Task for Band<'_> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<S: Simd>(mut self, _simd: S) -> Result<()> {
        self.rows.depth.fill(self.background);
        self.rows.glyph.fill(NO_GLYPH);
        let mut blocks = memory::filled(Block { farthest: f32::INFINITY, drawn: 0 }, self.view.width.div_ceil(BLOCK))?;
        for (count, Entry { front, seen }) in
            in_order(self.glyphs, self.bins.band(self.number), self.view)?.into_iter().enumerate()
        {
            if count % CHECKED == 0 {
                self.job.advance(0)?;
            }
            let [first, end] = seen.place.columns.map(usize::from);
            let touched = first / BLOCK..end.div_ceil(BLOCK);
            if blocks[touched.clone()].iter().all(|block| front >= block.farthest) {
                continue;
            }
            self.draw(seen);
            for block in touched {
                blocks[block].drawn += 1;
                if blocks[block].drawn >= DRAWN {
                    blocks[block] = Block { farthest: self.farthest(block), drawn: 0 };
                }
            }
        }
        for row in 0..self.rows.depth.len() / self.view.width {
            self.finish(row);
        }
        Ok(())
    }
}

impl Band<'_> {
    /// The greatest depth in a block.
    #[inline(always)]
    fn farthest(&self, block: usize) -> f32 {
        let (first, end) = (block * BLOCK, ((block + 1) * BLOCK).min(self.view.width));
        let rows = self.rows.depth.chunks_exact(self.view.width);
        rows.map(|row| row[first..end].iter().fold(f32::NEG_INFINITY, |a, b| if *b > a { *b } else { a }))
            .fold(f32::NEG_INFINITY, |a, b| if b > a { b } else { a })
    }

    /// Draws what of a glyph lies in the band.
    #[inline(always)]
    fn draw(&mut self, seen: &Seen) {
        let bottom = self.number * BAND;
        let [first, end] = seen.place.columns.map(usize::from);
        let [low, high] = seen.place.rows.map(usize::from);
        let rays = Rays::new(&self.glyphs.in_view(seen.index as usize, self.view), self.view.is_perspective);
        let columns = &self.centers.columns[first..end];
        let middle = columns[columns.len() / 2];
        for row in low.max(bottom)..high.min(bottom + BAND) {
            let line = (row - bottom) * self.view.width;
            let part = line + first..line + end;
            let (depth, glyph) = (&mut self.rows.depth[part.clone()], &mut self.rows.glyph[part]);
            draw_row(&rays.row(middle, self.centers.rows[row]), columns, self.view.clip, seen.index, depth, glyph);
        }
    }

    /// Writes the normals of a row.
    #[inline(always)]
    fn finish(&mut self, row: usize) {
        let width = self.view.width;
        let pixels = row * width..(row + 1) * width;
        let y = self.centers.rows[self.number * BAND + row];
        let mut last = None;
        let found = self.rows.glyph[pixels.clone()].iter().zip(&self.rows.depth[pixels.clone()]).zip(&self.centers.columns);
        for (((index, depth), x), normal) in found.zip(&mut self.rows.normal[pixels]) {
            let Ok(index) = usize::try_from(*index) else {
                *normal = [0.0; 3];
                continue;
            };
            let rays = match last {
                Some((of, rays)) if of == index => rays,
                _ => Rays::new(&self.glyphs.in_view(index, self.view), self.view.is_perspective),
            };
            last = Some((index, rays));
            *normal = normal_at(&rays, &rays.at(*x, y), *depth, self.view);
        }
    }
}

/// Glyphs from front to back, so that those behind need not be drawn; of equals the first one first.
#[inline(always)]
fn in_order<'a>(glyphs: &Glyphs<'_>, band: impl Iterator<Item = &'a Seen>, view: &View) -> Result<Vec<Entry<'a>>> {
    let mut entries = Vec::new();
    for seen in band {
        let front = glyphs.in_view(seen.index as usize, view).front();
        memory::reserve(&mut entries, 1)?;
        // Not behind the depths that are written, which are floats, too.
        entries.push(Entry { front: (front - front.abs() * f64::from(f32::EPSILON)) as f32, seen });
    }
    entries
        .sort_unstable_by(|one, other| one.front.total_cmp(&other.front).then_with(|| one.seen.index.cmp(&other.seen.index)));
    Ok(entries)
}

/// The normal where a ray meets its glyph: unit, world space.
#[inline(always)]
fn normal_at(rays: &Rays, ray: &Ray, depth: f32, view: &View) -> [f32; 3] {
    let normal = rays.normal(ray, ray.crossing_near(f64::from(depth)));
    let length = dot(normal, normal).sqrt();
    let rows = &view.camera_from_world;
    [0, 1, 2].map(|axis| (dot(normal, [rows[0][axis], rows[1][axis], rows[2][axis]]) / length) as f32)
}

/// Draws what of a glyph lies in a part of a row, where it is nearer than what is there.
///
/// A plain loop without branches, of which compilers make vectors.
#[inline(always)]
fn draw_row(row: &Row, columns: &[f64], clip: [f64; 2], index: u32, depth: &mut [f32], glyph: &mut [i32]) {
    for ((x, depth), glyph) in columns.iter().zip(depth).zip(glyph) {
        let found = row.crossing(*x, clip) as f32;
        let is_nearer = found < *depth;
        *depth = if is_nearer { found } else { *depth };
        *glyph = if is_nearer { index as i32 } else { *glyph };
    }
}
