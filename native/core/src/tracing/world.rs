//! Light that comes from far away.

use std::f64::consts::{PI, TAU};

use crate::error::{Error, Result};
use crate::memory;

use crate::vectors::{dot, double};

/// Columns and rows of what surfaces of every direction get; the error of lines between is a thousandth.
const IRRADIANCE: [usize; 2] = [64, 32];

/// Columns and rows of the image of which that is made.
const COARSE: [usize; 2] = [128, 64];

/// An equirectangular image of the world, and the light that matt surfaces have of it.
#[derive(Debug)]
pub struct WorldImage {
    pixels: Map,
    irradiance: Map,
}

/// The world as rays see it.
#[derive(Clone, Copy, Debug)]
pub struct World<'a> {
    /// Radiance from everywhere, where there is no image.
    pub color: [f32; 3],
    /// Radiance by direction, and the rows of the rotation into its space.
    pub image: Option<(&'a WorldImage, [[f64; 3]; 3])>,
}

impl World<'_> {
    /// What comes from a direction.
    #[inline(always)]
    pub fn radiance(&self, direction: [f64; 3]) -> [f32; 3] {
        match self.image {
            None => self.color,
            Some((image, turn)) => image.pixels.at(turn.map(|row| dot(row, direction))),
        }
    }

    /// The irradiance of a surface with this normal, divided by pi.
    #[inline(always)]
    pub fn irradiance(&self, normal: [f32; 3]) -> [f32; 3] {
        match self.image {
            None => self.color,
            Some((image, turn)) => image.irradiance.at(turn.map(|row| dot(row, double(normal)))),
        }
    }
}

impl WorldImage {
    /// Takes the pixels, row 0 at the bottom.
    ///
    /// # Errors
    /// `InvalidInput` where there are none, or another number than `width` times `height`; `OutOfMemory`.
    pub fn new(pixels: Vec<[f32; 3]>, width: usize, height: usize) -> Result<Self> {
        if width == 0 || height == 0 || pixels.len() != width * height {
            return Err(Error::InvalidInput("an image of the world must have pixels".into()));
        }
        let pixels = Map { pixels, width, height };
        let irradiance = irradiance_of(&pixels.shrunk()?)?;
        Ok(Self { pixels, irradiance })
    }

    /// Light that matt surfaces have, by their normals: an image like that of the world, with its width and height.
    pub fn irradiance(&self) -> (&[[f32; 3]], usize, usize) {
        (&self.irradiance.pixels, self.irradiance.width, self.irradiance.height)
    }
}

/// An equirectangular image: the middle is seen along x, a quarter of the width along y, the top row along z.
#[derive(Debug)]
struct Map {
    pixels: Vec<[f32; 3]>,
    width: usize,
    height: usize,
}

impl Map {
    /// Between the centres of pixels.
    #[inline(always)]
    fn at(&self, [x, y, z]: [f64; 3]) -> [f32; 3] {
        let column = (0.5 - y.atan2(x) / TAU) * self.width as f64 - 0.5;
        let row = ((1.0 - z.clamp(-1.0, 1.0).acos() / PI) * self.height as f64 - 0.5).clamp(0.0, (self.height - 1) as f64);
        let (left, low) = (column.floor(), row.floor());
        let (across, up) = ((column - left) as f32, (row - low) as f32);
        // From -1 to the width.
        let left = (left as isize).rem_euclid(self.width as isize) as usize;
        let right = if left + 1 == self.width { 0 } else { left + 1 };
        let (low, high) = (low as usize, (low as usize + 1).min(self.height - 1));
        let pixel = |column: usize, row: usize| self.pixels[row * self.width + column];
        let corners = [pixel(left, low), pixel(right, low), pixel(left, high), pixel(right, high)];
        std::array::from_fn(|channel| {
            let [a, b, c, d] = corners.map(|corner| corner[channel]);
            let (below, above) = (a + (b - a) * across, c + (d - c) * across);
            below + (above - below) * up
        })
    }

    /// The unit direction in which the centre of a pixel is seen, and the solid angle that it takes.
    fn direction(&self, column: usize, row: usize) -> ([f64; 3], f64) {
        let azimuth = TAU * (0.5 - (column as f64 + 0.5) / self.width as f64);
        let height = PI * ((row as f64 + 0.5) / self.height as f64 - 0.5);
        let (sine, cosine) = height.sin_cos();
        let size = TAU / self.width as f64 * PI / self.height as f64 * cosine;
        ([cosine * azimuth.cos(), cosine * azimuth.sin(), sine], size)
    }

    /// An image of at most the size that irradiance is made of; each pixel is the mean of those that it holds.
    fn shrunk(&self) -> Result<Self> {
        let (width, height) = (self.width.min(COARSE[0]), self.height.min(COARSE[1]));
        let mut sums = memory::filled([0.0f64; 4], width * height)?;
        for row in 0..self.height {
            let (_, size) = self.direction(0, row);
            for column in 0..self.width {
                let target = &mut sums[row * height / self.height * width + column * width / self.width];
                for (sum, channel) in target.iter_mut().zip(self.pixels[row * self.width + column]) {
                    *sum += size * f64::from(channel);
                }
                target[3] += size;
            }
        }
        let mut pixels = memory::with_capacity(width * height)?;
        pixels.extend(sums.into_iter().map(|[r, g, b, size]| [r, g, b].map(|sum| (sum / size) as f32)));
        Ok(Self { pixels, width, height })
    }
}

/// The irradiance by direction, divided by pi: of an even world exactly its radiance.
fn irradiance_of(world: &Map) -> Result<Map> {
    let [width, height] = IRRADIANCE;
    let mut map = Map { pixels: memory::filled([0.0; 3], width * height)?, width, height };
    let mut sources = memory::with_capacity(world.pixels.len())?;
    sources.extend((0..world.pixels.len()).map(|index| world.direction(index % world.width, index / world.width)));
    for index in 0..map.pixels.len() {
        let (normal, _) = map.direction(index % width, index / width);
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for ((direction, size), pixel) in sources.iter().zip(&world.pixels) {
            let share = dot(normal, *direction).max(0.0) * size;
            total += share;
            for (channel, radiance) in sum.iter_mut().zip(pixel) {
                *channel += share * f64::from(*radiance);
            }
        }
        map.pixels[index] = sum.map(|channel| if total > 0.0 { (channel / total) as f32 } else { 0.0 });
    }
    Ok(map)
}

#[cfg(test)]
mod tests {
    use super::*;

    const UPRIGHT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    #[test]
    fn directions_are_seen_where_blender_sees_them() {
        let pixels = (0..8 * 4).map(|index| [(index % 8) as f32, (index / 8) as f32, 1.0]).collect();
        let image = WorldImage::new(pixels, 8, 4).unwrap();
        let world = World { color: [0.0; 3], image: Some((&image, UPRIGHT)) };
        let near = |direction: [f64; 3], expected: [f32; 2]| {
            let [column, row, _] = world.radiance(direction);
            assert!((column - expected[0]).abs() < 1e-5 && (row - expected[1]).abs() < 1e-5, "{direction:?}: {column}, {row}");
        };
        near([1.0, 0.0, 0.0], [3.5, 1.5]);
        near([0.0, 1.0, 0.0], [1.5, 1.5]);
        near([0.0, -1.0, 0.0], [5.5, 1.5]);
        // The border wraps.
        near([-1.0, 0.0, 0.0], [3.5, 1.5]);
        assert_eq!([world.radiance([0.0, 0.0, 1.0])[1], world.radiance([0.0, 0.0, -1.0])[1]], [3.0, 0.0]);
    }

    #[test]
    #[cfg_attr(miri, ignore = "too slow")]
    fn irradiance_is_that_of_the_sphere() {
        // A world whose radiance is 2 + z gives pi (2 + 2 z / 3).
        let pixels =
            (0..256 * 128).map(|index| [2.0 + (PI * (f64::from(index / 256) + 0.5) / 128.0 - PI / 2.0).sin() as f32; 3]);
        let image = WorldImage::new(pixels.collect(), 256, 128).unwrap();
        let turned = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let world = World { color: [0.0; 3], image: Some((&image, turned)) };
        for height in [-1.0f32, -0.5, 0.0, 0.3, 0.9, 1.0] {
            let [light, ..] = world.irradiance([(1.0 - height * height).sqrt(), height, 0.0]);
            assert!((light - (2.0 + height / 1.5)).abs() < 3e-3, "{height}: {light}");
        }
    }

    #[test]
    fn images_without_pixels_are_refused() {
        assert!(WorldImage::new(Vec::new(), 0, 0).is_err());
        assert!(WorldImage::new(vec![[0.0; 3]], 2, 1).is_err());
    }
}
