//! The images that casting fills.

use std::sync::atomic::{AtomicU32, Ordering};

use crate::error::{Error, Result};

/// The number of no ball.
pub const NO_BALL: i32 = -1;

/// Numbers that several threads write, each in places of its own.
struct Plane<'a>(&'a [AtomicU32]);

impl<'a> Plane<'a> {
    fn new<T: Bits>(numbers: &'a mut [T]) -> Self {
        // SAFETY: an atomic has the size and alignment of the number, and nobody else can reach what is borrowed mutably.
        Self(unsafe { std::slice::from_raw_parts(numbers.as_mut_ptr().cast(), numbers.len()) })
    }

    #[inline(always)]
    fn put(&self, place: usize, bits: u32) {
        self.0[place].store(bits, Ordering::Relaxed);
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

    #[inline(always)]
    pub(super) fn values(&self, index: u32) -> [f32; 3] {
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

    pub(super) fn attributes(&self) -> &[Attribute<'a>] {
        &self.attributes
    }

    /// Whether the balls' shares of the density matter.
    pub(super) fn wants_shares(&self) -> bool {
        self.ball.is_some() || !self.attributes.is_empty()
    }

    /// Writes a square of pixels of side `stride`, as far as it lies in the image.
    #[inline(always)]
    pub(super) fn put(&self, corner: [usize; 2], stride: usize, depth: f32, normal: [f32; 3], ball: i32) {
        if stride == 1 {
            self.put_pixel(corner[1] * self.width + corner[0], depth, normal, ball);
        } else {
            self.square(corner, stride).for_each(|pixel| self.put_pixel(pixel, depth, normal, ball));
        }
    }

    #[inline(always)]
    fn put_pixel(&self, pixel: usize, depth: f32, normal: [f32; 3], ball: i32) {
        self.depth.put(pixel, depth.to_bits());
        for (channel, number) in normal.into_iter().enumerate() {
            self.normal.put(3 * pixel + channel, number.to_bits());
        }
        if let Some(balls) = &self.ball {
            balls.put(pixel, ball as u32);
        }
    }

    #[inline(always)]
    pub(super) fn put_attribute(&self, number: usize, corner: [usize; 2], stride: usize, values: [f32; 3]) {
        for pixel in self.square(corner, stride) {
            for (channel, value) in values.into_iter().enumerate() {
                self.attributes[number].target.put(3 * pixel + channel, value.to_bits());
            }
        }
    }

    /// Writes that there is nothing in a square of pixels of side `side`, as far as it lies in the image.
    #[inline(always)]
    pub(super) fn put_background(&self, corner: [usize; 2], side: usize) {
        self.put(corner, side, self.background, [0.0; 3], NO_BALL);
        for number in 0..self.attributes.len() {
            self.put_attribute(number, corner, side, [0.0; 3]);
        }
    }

    #[inline(always)]
    fn square(&self, [x, y]: [usize; 2], stride: usize) -> impl Iterator<Item = usize> {
        let columns = x..(x + stride).min(self.width);
        (y..(y + stride).min(self.height)).flat_map(move |row| columns.clone().map(move |column| row * self.width + column))
    }
}

fn check(name: &str, found: usize, wanted: usize) -> Result<()> {
    if found == wanted {
        return Ok(());
    }
    Err(Error::InvalidInput(format!("the image '{name}' must have {wanted} numbers, not {found}")))
}
