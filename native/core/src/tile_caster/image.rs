//! The images that casting fills.

use std::sync::atomic::{AtomicU32, Ordering};

use super::occlusion::CELL;
use crate::error::{Error, Result};
use crate::simd::{LANES, Lanes};

/// The number of no ball.
pub const NO_BALL: i32 = -1;

/// Numbers that several threads write, each in places of its own.
struct Plane<'a>(&'a [AtomicU32]);

impl<'a> Plane<'a> {
    fn new<T: Bits>(numbers: &'a mut [T]) -> Self {
        // SAFETY: an atomic has the size and alignment of the number, and nobody else can reach what is borrowed mutably.
        Self(unsafe { std::slice::from_raw_parts(numbers.as_mut_ptr().cast(), numbers.len()) })
    }

    /// Writes numbers, given as bits, one after the other.
    #[inline(always)]
    fn put<const COUNT: usize>(&self, place: usize, bits: [u32; COUNT]) {
        for (number, bits) in self.0[place..place + COUNT].iter().zip(bits) {
            number.store(bits, Ordering::Relaxed);
        }
    }

    /// Writes the same number from `place` on.
    #[inline(always)]
    fn fill(&self, place: usize, count: usize, bits: u32) {
        for number in &self.0[place..place + count] {
            number.store(bits, Ordering::Relaxed);
        }
    }
}

/// Numbers of 32 bits.
trait Bits {}
impl Bits for f32 {}
impl Bits for i32 {}

/// Three numbers a ball that are blended to the surface, each weighted by the ball's share of the density there.
pub struct Attribute<'a> {
    source: &'a [[f32; 3]],
    target: Plane<'a>,
}

impl<'a> Attribute<'a> {
    /// An attribute of the balls and its image (height, width, 3).
    pub fn new(source: &'a [[f32; 3]], target: &'a mut [f32]) -> Self {
        Self { source, target: Plane::new(target) }
    }

    /// How many balls have it.
    pub(crate) fn rows(&self) -> usize {
        self.source.len()
    }

    #[inline(always)]
    pub(crate) fn values(&self, index: u32) -> [f32; 3] {
        self.source[index as usize]
    }
}

/// Images of the view, row 0 at the bottom. They need not be cleared.
pub struct Image<'a> {
    width: usize,
    height: usize,
    background: f32,
    depth: Plane<'a>,
    normal: Plane<'a>,
    ball: Option<Plane<'a>>,
    attributes: Vec<Attribute<'a>>,
}

impl<'a> Image<'a> {
    /// Borrows the targets.
    ///
    /// * `depth` - (height, width): planar depth, `background` where there is nothing.
    /// * `normal` - (height, width, 3): unit, world space, out of the fluid; 0 where there is nothing.
    /// * `ball` - (height, width): index of the ball with the greatest share of the density, [`NO_BALL`] where there is none.
    /// * `attributes` - what else is blended; 0 where there is nothing.
    ///
    /// # Errors
    /// `InvalidInput` where a target has another size.
    pub fn new(
        [width, height]: [usize; 2],
        background: f32,
        depth: &'a mut [f32],
        normal: &'a mut [f32],
        ball: Option<&'a mut [i32]>,
        attributes: Vec<Attribute<'a>>,
    ) -> Result<Self> {
        let pixels = width * height;
        check("depth", depth.len(), pixels)?;
        check("normal", normal.len(), 3 * pixels)?;
        check("ball", ball.as_ref().map_or(pixels, |ball| ball.len()), pixels)?;
        for attribute in &attributes {
            check("attribute", attribute.target.0.len(), 3 * pixels)?;
        }
        let (depth, normal, ball) = (Plane::new(depth), Plane::new(normal), ball.map(Plane::new));
        Ok(Self { width, height, background, depth, normal, ball, attributes })
    }

    /// Width and height.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    pub(crate) fn attributes(&self) -> &[Attribute<'a>] {
        &self.attributes
    }

    /// Whether the balls' shares of the density matter.
    pub(crate) fn wants_shares(&self) -> bool {
        self.ball.is_some() || !self.attributes.is_empty()
    }

    /// Writes a packet's 4 x 4 pixels; `blended` are the attributes.
    #[inline(always)]
    pub(super) fn put_packet(&self, [x, y]: [usize; 2], pixels: &Pixels, blended: &[[Lanes; 3]]) {
        for row in 0..CELL {
            let (place, first) = ((y + row) * self.width + x, row * CELL);
            let depth: [u32; CELL] = std::array::from_fn(|column| pixels.depth.0[first + column].to_bits());
            self.depth.put(place, depth);
            self.normal.put(3 * place, interleaved(&pixels.normal, first));
            for (attribute, vectors) in self.attributes.iter().zip(blended) {
                attribute.target.put(3 * place, interleaved(vectors, first));
            }
            if let Some(balls) = &self.ball {
                let ball: [u32; CELL] = std::array::from_fn(|column| pixels.ball[first + column] as u32);
                balls.put(place, ball);
            }
        }
    }

    /// Writes a pixel; `blended` are the attributes.
    pub(crate) fn put_pixel(&self, [x, y]: [usize; 2], depth: f32, normal: [f32; 3], ball: i32, blended: &[[f32; 3]]) {
        let place = y * self.width + x;
        self.depth.put(place, [depth.to_bits()]);
        self.normal.put(3 * place, normal.map(f32::to_bits));
        if let Some(balls) = &self.ball {
            balls.put(place, [ball as u32]);
        }
        for (attribute, vector) in self.attributes.iter().zip(blended) {
            attribute.target.put(3 * place, vector.map(f32::to_bits));
        }
    }

    /// Writes a square of pixels of side `side`, as far as it lies in the image; they are all like one of a packet.
    pub(super) fn put_square(&self, corner: [usize; 2], side: usize, pixels: &Pixels, blended: &[[Lanes; 3]], pixel: usize) {
        let bits = |vectors: &[Lanes; 3]| vectors.each_ref().map(|axis| axis.0[pixel].to_bits());
        for (place, count) in self.rows(corner, side) {
            self.depth.fill(place, count, pixels.depth.0[pixel].to_bits());
            for place in place..place + count {
                self.normal.put(3 * place, bits(&pixels.normal));
                for (attribute, vectors) in self.attributes.iter().zip(blended) {
                    attribute.target.put(3 * place, bits(vectors));
                }
            }
            if let Some(balls) = &self.ball {
                balls.fill(place, count, pixels.ball[pixel] as u32);
            }
        }
    }

    /// Writes that there is nothing in a square of pixels of side `side`, as far as it lies in the image.
    pub(crate) fn put_background(&self, corner: [usize; 2], side: usize) {
        for (place, count) in self.rows(corner, side) {
            self.depth.fill(place, count, self.background.to_bits());
            self.normal.fill(3 * place, 3 * count, 0);
            if let Some(balls) = &self.ball {
                balls.fill(place, count, NO_BALL as u32);
            }
            for attribute in &self.attributes {
                attribute.target.fill(3 * place, 3 * count, 0);
            }
        }
    }

    /// The first pixel of each row of a square, and how many of the row lie in the image.
    fn rows(&self, [x, y]: [usize; 2], side: usize) -> impl Iterator<Item = (usize, usize)> {
        let (width, count) = (self.width, side.min(self.width - x));
        (y..(y + side).min(self.height)).map(move |row| (row * width + x, count))
    }
}

/// What a packet's pixels show.
pub struct Pixels {
    pub depth: Lanes,
    pub normal: [Lanes; 3],
    pub ball: [i32; LANES],
}

impl Pixels {
    /// Pixels that show nothing.
    #[inline(always)]
    pub fn background(image: &Image) -> Self {
        let zero = Lanes::splat(0.0);
        Self { depth: Lanes::splat(image.background), normal: [zero; 3], ball: [NO_BALL; LANES] }
    }
}

/// Bits of the vectors of a packet's four pixels from `first` on, one vector after the other.
#[inline(always)]
fn interleaved(vectors: &[Lanes; 3], first: usize) -> [u32; 3 * CELL] {
    std::array::from_fn(|number| vectors[number % 3].0[first + number / 3].to_bits())
}

fn check(name: &str, found: usize, wanted: usize) -> Result<()> {
    if found == wanted {
        return Ok(());
    }
    Err(Error::InvalidInput(format!("the image '{name}' must have {wanted} numbers, not {found}")))
}
