//! Bands of rows of pixels, and which things each of them may see: counted, then filled, by parts of the things that work
//! apart.

use rayon::prelude::*;

use crate::error::Result;
use crate::job::Job;
use crate::memory;
use crate::simd::{Path, Simd, Task};
use crate::tile_caster::View;

/// Rows of a band.
pub const BAND: usize = 16;

/// Things after which work asks whether the user gave up.
pub const CHUNK: usize = 4096;

/// Pixels by which rounding may place a border wrongly.
const PIXEL_MARGIN: f64 = 0.01;

/// Parts for each thread, and in all.
const PARTS_A_THREAD: usize = 4;
const MOST_PARTS: usize = 32;

/// The pixels that a thing may cover: columns and rows, first and behind the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    pub columns: [u16; 2],
    pub rows: [u16; 2],
}

impl Place {
    /// The pixels whose centres lie in a rectangle of the window, given by its ranges of x and y, if there are any.
    #[inline(always)]
    pub fn of_window([x, y]: [[f64; 2]; 2], view: &View) -> Option<Self> {
        let size = view.pixel_size();
        let columns = pixels(x, view.window[0], size[0], view.width)?;
        Some(Self { columns, rows: pixels(y, view.window[2], size[1], view.height)? })
    }
}

/// Pixels whose centres lie in a range of the window: the first and the one behind the last, if there are any.
#[inline(always)]
fn pixels([low, high]: [f64; 2], start: f64, size: f64, count: usize) -> Option<[u16; 2]> {
    let first = ((low - start) / size - (0.5 + PIXEL_MARGIN)).ceil().max(0.0);
    let end = ((high - start) / size + (0.5 + PIXEL_MARGIN)).floor().min(count as f64);
    (first < end).then_some([first as u16, end as u16])
}

/// Where in the window the pixel centres of each column and row lie.
pub struct Centers {
    pub columns: Vec<f64>,
    pub rows: Vec<f64>,
}

impl Centers {
    /// Of a view's pixels.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn new(view: &View) -> Result<Self> {
        let (mut columns, mut rows) = (memory::with_capacity(view.width)?, memory::with_capacity(view.height)?);
        columns.extend((0..view.width).map(|column| view.pixel_center(column, 0)[0]));
        rows.extend((0..view.height).map(|row| view.pixel_center(0, row)[1]));
        Ok(Self { columns, rows })
    }
}

/// Things that have places in an image.
pub trait Placed: Sync {
    /// How many there are, less than 2^32.
    fn count(&self) -> usize;
    /// The pixels that one may cover, if there are any; to be inlined always.
    fn place(&self, index: usize, view: &View) -> Option<Place>;
}

/// A thing that may be seen.
#[derive(Clone, Copy)]
pub struct Seen {
    pub index: u32,
    pub place: Place,
}

/// The things of each band, in their order.
pub struct Bins(Vec<Part>);

impl Bins {
    /// Sorts the things into bands; a piece of work is done for each [`CHUNK`].
    ///
    /// # Errors
    /// `Cancelled`, `OutOfMemory`.
    pub fn new(path: Path, things: &impl Placed, view: &View, job: &Job) -> Result<Self> {
        let count = things.count();
        let parts = (PARTS_A_THREAD * rayon::current_num_threads()).min(MOST_PARTS);
        let length = count.div_ceil(parts).next_multiple_of(CHUNK);
        let part = |part: usize| {
            let [first, end] = [part * length, ((part + 1) * length).min(count)];
            path.dispatch(PartTask { things, view, first, end, job })
        };
        let parts = (0..count.div_ceil(length.max(1))).into_par_iter().map(part).collect::<Result<_>>()?;
        Ok(Self(parts))
    }

    /// The things of a band.
    #[inline(always)]
    pub fn band(&self, band: usize) -> impl Iterator<Item = &Seen> {
        self.0.iter().flat_map(move |part| {
            let entries = &part.entries[part.starts[band]..part.starts[band + 1]];
            entries.iter().map(|entry| &part.seen[*entry as usize])
        })
    }
}

/// Things that follow one another.
struct Part {
    seen: Vec<Seen>,
    /// Where each band's entries begin, and where the last one's end.
    starts: Vec<usize>,
    /// Places in `seen`.
    entries: Vec<u32>,
}

/// Makes the part of the things from `first` to before `end`.
struct PartTask<'a, T> {
    things: &'a T,
    view: &'a View,
    first: usize,
    end: usize,
    job: &'a Job,
}

impl<T: Placed> Task for PartTask<'_, T> {
    type Output = Result<Part>;

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) -> Result<Part> {
        let mut seen = memory::with_capacity(self.end - self.first)?;
        for start in (self.first..self.end).step_by(CHUNK) {
            self.job.advance(1)?;
            for index in start..(start + CHUNK).min(self.end) {
                if let Some(place) = self.things.place(index, self.view) {
                    seen.push(Seen { index: index as u32, place });
                }
            }
        }
        binned(seen, self.view.height.div_ceil(BAND))
    }
}

/// The bands that a thing may be seen in.
#[inline(always)]
fn bands(place: &Place) -> std::ops::RangeInclusive<usize> {
    usize::from(place.rows[0]) / BAND..=usize::from(place.rows[1] - 1) / BAND
}

/// Counts the entries of each band, then fills them in.
#[inline(always)]
fn binned(seen: Vec<Seen>, band_count: usize) -> Result<Part> {
    // Counted two places farther on, so that filling leaves each band's start where it belongs.
    let mut starts = memory::filled(0usize, band_count + 2)?;
    for thing in &seen {
        bands(&thing.place).for_each(|band| starts[band + 2] += 1);
    }
    for band in 0..=band_count {
        starts[band + 1] += starts[band];
    }
    let mut entries = memory::filled(0u32, starts[band_count + 1])?;
    for (place, thing) in seen.iter().enumerate() {
        for band in bands(&thing.place) {
            entries[starts[band + 1]] = place as u32;
            starts[band + 1] += 1;
        }
    }
    Ok(Part { seen, starts, entries })
}
