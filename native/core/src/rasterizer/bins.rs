//! Which triangles each band of rows may see: counted, then filled, by parts of the triangles that work apart.

use rayon::prelude::*;

use super::band::BAND;
use super::triangle::Place;
use super::{CHUNK, Triangles, View};
use crate::error::Result;
use crate::job::Job;
use crate::memory;
use crate::simd::{Path, Simd, Task};

/// Parts for each thread, and in all.
const PARTS_A_THREAD: usize = 4;
const MOST_PARTS: usize = 32;

/// A triangle that may be seen.
#[derive(Clone, Copy)]
pub struct Seen {
    pub index: u32,
    pub place: Place,
}

/// The triangles of each band, in their order.
pub struct Bins(Vec<Part>);

impl Bins {
    /// Sorts the triangles into bands.
    ///
    /// # Errors
    /// `Cancelled`, `OutOfMemory`.
    pub fn new(path: Path, triangles: &Triangles<'_>, view: &View, job: &Job) -> Result<Self> {
        let count = triangles.corners.len();
        let parts = (PARTS_A_THREAD * rayon::current_num_threads()).min(MOST_PARTS);
        let length = count.div_ceil(parts).next_multiple_of(CHUNK);
        let part = |part: usize| {
            let [first, end] = [part * length, ((part + 1) * length).min(count)];
            path.dispatch(PartTask { triangles, view, first, end, job })
        };
        let parts = (0..count.div_ceil(length.max(1))).into_par_iter().map(part).collect::<Result<_>>()?;
        Ok(Self(parts))
    }

    /// The triangles of a band.
    #[inline(always)]
    pub fn band(&self, band: usize) -> impl Iterator<Item = &Seen> {
        self.0.iter().flat_map(move |part| {
            let entries = &part.entries[part.starts[band]..part.starts[band + 1]];
            entries.iter().map(|entry| &part.seen[*entry as usize])
        })
    }
}

/// Triangles that follow one another.
struct Part {
    seen: Vec<Seen>,
    /// Where each band's entries begin, and where the last one's end.
    starts: Vec<usize>,
    /// Places in `seen`.
    entries: Vec<u32>,
}

/// Makes the part of the triangles from `first` to before `end`.
struct PartTask<'a> {
    triangles: &'a Triangles<'a>,
    view: &'a View,
    first: usize,
    end: usize,
    job: &'a Job,
}

impl Task for PartTask<'_> {
    type Output = Result<Part>;

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) -> Result<Part> {
        let mut seen = memory::with_capacity(self.end - self.first)?;
        for start in (self.first..self.end).step_by(CHUNK) {
            self.job.advance(1)?;
            for index in start..(start + CHUNK).min(self.end) {
                if let Some(place) = Place::of(&self.triangles.in_view(index, self.view), self.view) {
                    seen.push(Seen { index: index as u32, place });
                }
            }
        }
        binned(seen, self.view.height.div_ceil(BAND))
    }
}

/// The bands that a triangle may be seen in.
#[inline(always)]
fn bands(place: &Place) -> std::ops::RangeInclusive<usize> {
    usize::from(place.rows[0]) / BAND..=usize::from(place.rows[1] - 1) / BAND
}

/// Counts the entries of each band, then fills them in.
#[inline(always)]
fn binned(seen: Vec<Seen>, band_count: usize) -> Result<Part> {
    // Counted two places farther on, so that filling leaves each band's start where it belongs.
    let mut starts = memory::filled(0usize, band_count + 2)?;
    for triangle in &seen {
        bands(&triangle.place).for_each(|band| starts[band + 2] += 1);
    }
    for band in 0..=band_count {
        starts[band + 1] += starts[band];
    }
    let mut entries = memory::filled(0u32, starts[band_count + 1])?;
    for (place, triangle) in seen.iter().enumerate() {
        for band in bands(&triangle.place) {
            entries[starts[band + 1]] = place as u32;
            starts[band + 1] += 1;
        }
    }
    Ok(Part { seen, starts, entries })
}
