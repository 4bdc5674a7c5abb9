//! What kernel spheres hide (Kanamori et al. 2008, section 5.2), in a coarse depth buffer: for each cell of pixels, a distance
//! at which every one of its rays has surely met the surface. What begins farther away cannot be seen.

use super::project::{MOST_WHOLE, Rectangles, whole_numbers};
use crate::error::Result;
use crate::memory;
use crate::simd::{Lanes, Simd, Vector};

/// Levels of a pyramid; larger rectangles are looked up nowhere.
const LEVELS: usize = 6;

/// Pixels of a cell's side; a packet of rays is a cell.
pub const CELL: usize = 4;

/// Distances along rays (planar for parallel ones), one a cell, infinite where nothing is known.
pub struct Occlusion {
    distances: Vec<f32>,
    columns: usize,
    rows: usize,
}

impl Occlusion {
    pub fn new(distances: Vec<f32>, columns: usize, rows: usize) -> Self {
        Self { distances, columns, rows }
    }

    /// Forgets what is known of rectangles of cells (first and last column, first and last row); whether something was.
    pub fn open(&mut self, rectangles: impl Iterator<Item = [u16; 4]>) -> bool {
        let mut was_known = false;
        for [x_min, x_max, y_min, y_max] in rectangles.map(|rectangle| rectangle.map(usize::from)) {
            for row in y_min..=y_max {
                let cells = &mut self.distances[row * self.columns..][x_min..=x_max];
                was_known |= cells.iter().any(|distance| distance.is_finite());
                cells.fill(f32::INFINITY);
            }
        }
        was_known
    }

    /// A distance behind which no pixel of a rectangle sees anything; it begins with a cell at `corner`.
    pub fn end(&self, corner: [usize; 2], size: [usize; 2]) -> f32 {
        let cells = |axis: usize, count: usize| corner[axis] / CELL..(corner[axis] + size[axis]).div_ceil(CELL).min(count);
        cells(1, self.rows)
            .flat_map(|row| &self.distances[row * self.columns..][cells(0, self.columns)])
            .fold(0.0, |greatest, distance| distance.max(greatest))
    }

    /// The ends of squares of pixels that a side of the image has so many of, row by row.
    pub fn ends(&self, side: usize, [columns, rows]: [usize; 2]) -> Vec<f32> {
        (0..columns * rows).map(|square| self.end([square % columns * side, square / columns * side], [side; 2])).collect()
    }

    /// What is known of sixteen cells; of others for cells beyond [`MOST_WHOLE`], so it must only decide what is worth drawing.
    #[inline(always)]
    pub fn distances_at<S: Simd>(&self, simd: S, column: S::Vector, row: S::Vector) -> S::Vector {
        look_up(simd, &self.distances, column, row, self.columns)
    }
}

/// Distances behind which nothing can be seen, for squares of 1, 2, 4 ... cells' side.
pub struct Pyramid {
    levels: Vec<Level>,
    /// The first level whose squares can be numbered; not 0 where an image has more than a hundred million pixels.
    first: usize,
}

/// For each square, the greatest distance in it and its neighbours to the right, above and to the right above.
struct Level {
    ends: Vec<f32>,
    columns: usize,
}

impl Pyramid {
    /// The pyramid over cells.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn new(occlusion: &Occlusion) -> Result<Self> {
        let (mut columns, mut rows) = (occlusion.columns, occlusion.rows);
        let mut levels = Vec::with_capacity(LEVELS);
        levels.push(Level { ends: greatest_of_four(&occlusion.distances, [columns, rows], 1)?, columns });
        let mut squares = greatest_of_four(&occlusion.distances, [columns, rows], 2)?;
        for _ in 1..LEVELS {
            (columns, rows) = (columns.div_ceil(2), rows.div_ceil(2));
            levels.push(Level { ends: greatest_of_four(&squares, [columns, rows], 1)?, columns });
            squares = greatest_of_four(&squares, [columns, rows], 2)?;
        }
        let first = levels.iter().position(|level| level.ends.len() <= MOST_WHOLE).unwrap_or(LEVELS);
        Ok(Self { levels, first })
    }

    /// Distances behind which no pixel of those of sixteen rectangles that are in `lanes` sees anything.
    #[inline(always)]
    pub fn ends<S: Simd>(&self, simd: S, rectangles: &Rectangles, lanes: u16) -> S::Vector {
        let [x_min, x_max, y_min, y_max] = rectangles.sides().map(|side| simd.load(side));
        let sides = (x_max - x_min).max(y_max - y_min).select(simd.mask(lanes), simd.splat(0.0));
        let cells = sides.reduce_max() as usize / CELL;
        // A side of so many cells reaches into two squares at most.
        let level = ((usize::BITS - cells.leading_zeros()) as usize).max(self.first);
        let Some(squares) = self.levels.get(level) else { return simd.splat(f32::INFINITY) };
        let per_square = simd.splat(1.0 / (CELL << level) as f32);
        let (column, row) = ((x_min * per_square).floor(), (y_min * per_square).floor());
        look_up(simd, &squares.ends, column, row, squares.columns)
    }
}

/// The numbers of sixteen squares, infinite for those that are not there.
#[inline(always)]
fn look_up<S: Simd>(simd: S, squares: &[f32], column: S::Vector, row: S::Vector, columns: usize) -> S::Vector {
    let places = whole_numbers(simd, row.mul_add(simd.splat(columns as f32), column));
    let mut numbers = Lanes::splat(f32::INFINITY);
    for (number, place) in numbers.0.iter_mut().zip(places) {
        *number = squares.get(place).copied().unwrap_or(f32::INFINITY);
    }
    simd.load(&numbers)
}

/// The greatest of every `step`-th square and its neighbours to the right, above and to the right above.
fn greatest_of_four(squares: &[f32], [columns, rows]: [usize; 2], step: usize) -> Result<Vec<f32>> {
    let mut greatest = memory::with_capacity(columns.div_ceil(step) * rows.div_ceil(step))?;
    for y in (0..rows).step_by(step) {
        let (row, above) = (&squares[y * columns..][..columns], &squares[(y + 1).min(rows - 1) * columns..][..columns]);
        greatest.extend((0..columns).step_by(step).map(|x| {
            let right = (x + 1).min(columns - 1);
            row[x].max(row[right]).max(above[x].max(above[right]))
        }));
    }
    Ok(greatest)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::simd::{LANES, Path, Task};

    struct EndsTask<'a> {
        pyramid: &'a Pyramid,
        rectangles: &'a Rectangles,
        lanes: u16,
    }

    impl Task for EndsTask<'_> {
        type Output = Lanes;

        fn run<S: Simd>(self, simd: S) -> Lanes {
            self.pyramid.ends(simd, self.rectangles, self.lanes).lanes()
        }
    }

    const CELLS: [usize; 2] = [37, 22];

    /// First and last pixel of a rectangle along an axis.
    fn any_side(cells: usize) -> impl Strategy<Value = [u16; 2]> {
        let last = (cells * CELL - 1) as u16;
        (0..=last, 0..=last, 1..100u16).prop_map(|(a, b, part)| {
            let side = a.abs_diff(b) / part;
            [a.min(b), a.min(b) + side]
        })
    }

    #[test]
    #[cfg_attr(miri, ignore = "too many cells for Miri")]
    fn cells_beyond_those_that_floats_can_number_are_found() {
        let (side, corner) = (3000, [2999.0 * CELL as f32; 2]);
        let mut distances = vec![1.0; side * side];
        distances[side * side - 1] = 50.0;
        let pyramid = Pyramid::new(&Occlusion::new(distances, side, side)).expect("memory");
        let [x, y] = corner.map(Lanes::splat);
        let rectangles = Rectangles { x_min: x, x_max: x, y_min: y, y_max: y };
        for path in Path::available() {
            let ends = path.dispatch(EndsTask { pyramid: &pyramid, rectangles: &rectangles, lanes: u16::MAX });
            assert_eq!(ends, Lanes::splat(50.0));
        }
    }

    proptest! {
        /// What is hidden behind a rectangle's squares is hidden behind each of its cells.
        #[test]
        #[cfg_attr(miri, ignore = "nothing unsafe on the path that Miri takes")]
        fn no_cell_of_a_rectangle_ends_later(
            distances in prop::collection::vec(1.0..100.0f32, CELLS[0] * CELLS[1]),
            sides in prop::collection::vec((any_side(CELLS[0]), any_side(CELLS[1])), LANES),
            lanes in any::<u16>(),
        ) {
            let occlusion = Occlusion::new(distances, CELLS[0], CELLS[1]);
            let pyramid = Pyramid::new(&occlusion).expect("memory");
            let pixel = |axis: usize, end: usize| Lanes(std::array::from_fn(|lane| {
                let (x, y) = sides[lane];
                f32::from([x, y][axis][end])
            }));
            let rectangles = Rectangles { x_min: pixel(0, 0), x_max: pixel(0, 1), y_min: pixel(1, 0), y_max: pixel(1, 1) };
            for path in Path::available() {
                let ends = path.dispatch(EndsTask { pyramid: &pyramid, rectangles: &rectangles, lanes });
                for (lane, (x, y)) in sides.iter().enumerate().filter(|(lane, _)| lanes >> lane & 1 == 1) {
                    let corner = [x[0], y[0]].map(|pixel| usize::from(pixel) / CELL * CELL);
                    let size = [usize::from(x[1]) + 1 - corner[0], usize::from(y[1]) + 1 - corner[1]];
                    prop_assert!(occlusion.end(corner, size) <= ends.0[lane], "{x:?} {y:?}");
                }
            }
        }
    }
}
