//! A tile of the image: its balls in the order in which they begin, its packets of rays, and where results go.

use super::bins::{Bins, GREATEST_TILE, front_of_entry};
use super::image::{Image, Pixels};
use super::occlusion::{CELL, Occlusion};
use super::project::{DISTANCE_ERROR, set_bits};
use super::view::View;
use crate::balls::bounded_weight;
use crate::error::Result;
use crate::memory::{prefetch, reserve};
use crate::simd::{LANES, Lanes, Mask, Simd, Vector};

/// A coordinate that no cone of rays touches.
const NOWHERE: f32 = 1e30;

/// How many balls before they are needed they are asked for; memory is slower than a packet.
const AHEAD: usize = 3 * LANES;

/// A ball as one ray after another needs it.
#[derive(Clone, Copy)]
struct Entry {
    center: [f32; 3],
    curvature: f32,
    weight: f32,
    radius: f32,
    front: f32,
    back: f32,
    index: u32,
}

/// Sixteen balls as the test against a bundle of rays needs them.
#[derive(Clone, Copy)]
struct Group {
    center: [Lanes; 3],
    radius: Lanes,
    distance: Lanes,
}

/// The balls of a tile, sorted by where their influence spheres begin, then by index. They are fetched from memory only when
/// a packet comes to them; most packets meet the surface before.
#[derive(Default)]
pub struct Entries {
    sorted: Vec<u64>,
    /// Those that have been fetched.
    entries: Vec<Entry>,
    groups: Vec<Group>,
}

impl Entries {
    /// Takes in the balls of a tile.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn fill(&mut self, bins: &Bins, tile: usize) -> Result<()> {
        let entries = bins.tile(tile);
        let count = entries.len();
        self.sorted.clear();
        self.entries.clear();
        self.groups.clear();
        reserve(&mut self.sorted, count)?;
        reserve(&mut self.entries, count)?;
        reserve(&mut self.groups, count.div_ceil(LANES))?;
        self.sorted.extend(entries);
        self.sorted.sort_unstable();
        self.sorted.iter().take(AHEAD).for_each(|entry| prefetch(bins.ball(*entry)));
        Ok(())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.sorted.is_empty()
    }

    /// Fetches the balls of the next group of sixteen.
    #[inline(always)]
    fn fetch_group(&mut self, bins: &Bins) {
        let first = self.entries.len();
        let end = (first + LANES).min(self.sorted.len());
        let ahead = self.sorted.iter().skip(first + AHEAD).take(LANES);
        ahead.for_each(|entry| prefetch(bins.ball(*entry)));
        for entry in &self.sorted[first..end] {
            let ball = bins.ball(*entry);
            let front = front_of_entry(*entry);
            let distance = front + ball.radius;
            self.entries.push(Entry {
                center: ball.center,
                curvature: 1.0 / (ball.radius * ball.radius),
                weight: bounded_weight(ball.weight, ball.radius),
                radius: ball.radius,
                front,
                back: distance + distance.abs() * (4.0 * DISTANCE_ERROR) + ball.radius,
                index: ball.index,
            });
        }
        self.groups.push(group_of(&self.entries[first..end]));
    }

    /// Whether a ball of this group of sixteen, or of a later one, begins before `end`.
    #[inline(always)]
    pub fn begins_before(&self, group: usize, end: f32) -> bool {
        self.sorted.get(group * LANES).is_some_and(|entry| front_of_entry(*entry) < end)
    }

    /// A bit for each ball of a group of sixteen that may touch a ray of the bundle.
    #[inline(always)]
    pub fn touching<S: Simd>(&mut self, simd: S, bins: &Bins, group: usize, bundle: &Bundle) -> u16 {
        if group == self.groups.len() {
            self.fetch_group(bins);
        }
        let group = &self.groups[group];
        let [x, y, z] = group.center.each_ref().map(|axis| simd.load(axis));
        let [ax, ay, az] = bundle.axis.map(|number| simd.splat(number));
        let (x, y) = (x - simd.splat(bundle.origin[0]), y - simd.splat(bundle.origin[1]));
        let along = x.mul_add(ax, y.mul_add(ay, z * az));
        let (px, py, pz) = (along.neg_mul_add(ax, x), along.neg_mul_add(ay, y), along.neg_mul_add(az, z));
        let apart_2 = px.mul_add(px, py.mul_add(py, pz * pz));
        let widened = simd.load(&group.radius) + simd.splat(bundle.radius);
        let reach = simd.load(&group.distance).mul_add(simd.splat(bundle.spread), widened);
        apart_2.lt(reach * reach).bits()
    }

    #[inline(always)]
    pub fn center(&self, entry: usize) -> [f32; 3] {
        self.entries[entry].center
    }

    #[inline(always)]
    pub fn curvature(&self, entry: usize) -> f32 {
        self.entries[entry].curvature
    }

    #[inline(always)]
    pub fn weight(&self, entry: usize) -> f32 {
        self.entries[entry].weight
    }

    #[inline(always)]
    pub fn radius(&self, entry: usize) -> f32 {
        self.entries[entry].radius
    }

    #[inline(always)]
    pub fn front(&self, entry: usize) -> f32 {
        self.entries[entry].front
    }

    #[inline(always)]
    pub fn back(&self, entry: usize) -> f32 {
        self.entries[entry].back
    }

    /// Which of the given balls it is.
    #[inline(always)]
    pub fn index(&self, entry: usize) -> u32 {
        self.entries[entry].index
    }
}

#[inline(always)]
fn group_of(balls: &[Entry]) -> Group {
    let mut group = Group { center: [Lanes::splat(NOWHERE); 3], radius: Lanes::splat(0.0), distance: Lanes::splat(0.0) };
    for (lane, ball) in balls.iter().enumerate() {
        for axis in 0..3 {
            group.center[axis].0[lane] = ball.center[axis];
        }
        group.radius.0[lane] = ball.radius;
        group.distance.0[lane] = (ball.front + ball.radius).abs() * (1.0 + 4.0 * DISTANCE_ERROR);
    }
    group
}

/// A cone or a cylinder that holds the rays of a packet.
pub struct Bundle {
    /// Unit.
    axis: [f32; 3],
    origin: [f32; 2],
    /// Sine of the cone's opening angle.
    spread: f32,
    /// Radius of the cylinder.
    radius: f32,
}

/// The rays of a packet, in camera space.
pub struct Rays {
    /// Unit.
    pub direction: [Lanes; 3],
    /// x and y; the depth of every origin is 0.
    pub origin: [Lanes; 2],
    /// Where the rays begin at the near clip plane.
    pub start: Lanes,
    /// Where they end at the far one.
    pub end: Lanes,
    /// Those that are in the image.
    pub lanes: u16,
    /// What begins farther away is hidden from all of them.
    pub visible_end: f32,
    pub bundle: Bundle,
}

/// Where in the window the pixel centres of each column and row lie.
pub struct PixelCenters {
    columns: Vec<f32>,
    rows: Vec<f32>,
}

impl PixelCenters {
    pub fn new(view: &View) -> Self {
        // Packets at the image's border have rays beyond it.
        let side = |count: usize| count.next_multiple_of(GREATEST_TILE) + GREATEST_TILE;
        Self {
            columns: (0..side(view.width)).map(|column| view.pixel_center(column, 0)[0] as f32).collect(),
            rows: (0..side(view.height)).map(|row| view.pixel_center(0, row)[1] as f32).collect(),
        }
    }
}

/// The pixels of a packet: 4 x 4, `stride` apart.
#[derive(Clone, Copy)]
pub struct PacketPixels {
    /// The lower left of the pixels that the packet stands for.
    pub x: usize,
    pub y: usize,
    pub stride: usize,
}

impl PacketPixels {
    /// The pixel that a ray goes through: the middle one of those that it stands for.
    #[inline(always)]
    fn pixel(&self, ray: usize) -> [usize; 2] {
        let [x, y] = self.corner(ray);
        [x + self.stride / 2, y + self.stride / 2]
    }

    /// A bit for each ray whose pixels begin left of `right` and below `top`.
    #[inline(always)]
    fn lanes_before(&self, [right, top]: [usize; 2]) -> u16 {
        let side = CELL * self.stride;
        if self.x + side <= right && self.y + side <= top {
            return u16::MAX;
        }
        let is_before = |ray: usize| {
            let [x, y] = self.corner(ray);
            x < right && y < top
        };
        (0..LANES).fold(0, |lanes, ray| lanes | u16::from(is_before(ray)) << ray)
    }

    /// The lower left of the pixels that a ray stands for.
    #[inline(always)]
    pub fn corner(&self, ray: usize) -> [usize; 2] {
        [self.x + ray % CELL * self.stride, self.y + ray / CELL * self.stride]
    }
}

impl Rays {
    /// The rays through those of the pixels that lie left of `right` and below `top`.
    #[inline(always)]
    pub fn new<S: Simd>(
        simd: S,
        view: &View,
        centers: &PixelCenters,
        occlusion: &Occlusion,
        pixels: PacketPixels,
        [right, top]: [usize; 2],
    ) -> Self {
        let (mut across, mut up) = (Lanes::splat(0.0), Lanes::splat(0.0));
        for ray in 0..LANES {
            let [x, y] = pixels.pixel(ray);
            across.0[ray] = centers.columns[x];
            up.0[ray] = centers.rows[y];
        }
        let lanes = pixels.lanes_before([right, top]);
        let (zero, one) = (Lanes::splat(0.0), Lanes::splat(1.0));
        let (direction, origin, stretch) = if view.is_perspective {
            let (x, y) = (simd.load(&across), simd.load(&up));
            let stretch = x.mul_add(x, y.mul_add(y, simd.splat(1.0))).sqrt();
            let shrink = simd.splat(1.0) / stretch;
            ([(x * shrink).lanes(), (y * shrink).lanes(), shrink.lanes()], [zero, zero], stretch)
        } else {
            ([zero, zero, one], [across, up], simd.splat(1.0))
        };
        let start = (stretch * simd.splat(view.clip[0] as f32)).lanes();
        let end = (stretch * simd.splat(view.clip[1] as f32)).lanes();
        let visible_end = occlusion.end([pixels.x, pixels.y], [CELL * pixels.stride; 2]);
        let bundle = Bundle::around(&direction, &origin);
        Self { direction, origin, start, end, lanes, visible_end, bundle }
    }
}

impl Bundle {
    /// The first and the last ray are those at opposite corners.
    #[inline(always)]
    fn around(direction: &[Lanes; 3], origin: &[Lanes; 2]) -> Self {
        const CORNERS: [usize; 4] = [0, CELL - 1, LANES - CELL, LANES - 1];
        let middle = |lanes: &Lanes| 0.5 * (lanes.0[0] + lanes.0[LANES - 1]);
        let axis = direction.each_ref().map(middle);
        let length = axis.iter().map(|number| number * number).sum::<f32>().sqrt();
        let axis = axis.map(|number| number / length);
        let middle = origin.each_ref().map(middle);
        let farthest = |lanes: &[Lanes], center: &[f32]| {
            let apart = |corner: &usize| lanes.iter().zip(center).map(|(axis, c)| (axis.0[*corner] - c).powi(2)).sum::<f32>();
            CORNERS.iter().map(apart).fold(0.0, f32::max).sqrt()
        };
        // Chords are longer than sines; the rest is for rounding.
        let spread = farthest(direction, &axis) * 1.001 + 2.0 * DISTANCE_ERROR;
        Self { axis, origin: middle, spread, radius: farthest(origin, &middle) * 1.001 }
    }
}

/// Takes what a packet finds to the image.
pub struct Surface<'a> {
    image: &'a Image<'a>,
    /// Rows: right, up and forward in world space.
    camera_from_world: [[f32; 3]; 3],
    place: PacketPixels,
    /// The rays whose pixels are in the image.
    lanes: u16,
    pixels: Pixels,
    /// Sum of the balls' shares of the density.
    total: Lanes,
    blends: &'a mut Blends,
}

/// The attributes of a packet's pixels.
#[derive(Default)]
pub struct Blends {
    /// Weighted by the balls' shares of the density.
    sums: Vec<[Lanes; 3]>,
    values: Vec<[Lanes; 3]>,
}

impl Blends {
    fn clear(&mut self, count: usize) {
        for vectors in [&mut self.sums, &mut self.values] {
            vectors.clear();
            vectors.resize(count, [Lanes::splat(0.0); 3]);
        }
    }
}

impl<'a> Surface<'a> {
    #[inline(always)]
    pub fn new(image: &'a Image<'a>, view: &View, place: PacketPixels, lanes: u16, blends: &'a mut Blends) -> Self {
        let camera_from_world = view.camera_from_world.map(|row| row.map(|number| number as f32));
        blends.clear(image.attributes().len());
        let (pixels, total) = (Pixels::background(image), Lanes::splat(0.0));
        Self { image, camera_from_world, place, lanes, pixels, total, blends }
    }

    /// Whether the balls' shares of the density matter.
    pub fn wants_shares(&self) -> bool {
        self.image.wants_shares()
    }

    pub fn begin_shares(&mut self) {
        self.total = Lanes::splat(0.0);
        self.blends.sums.fill([Lanes::splat(0.0); 3]);
    }

    /// Adds what a ball gives to the attributes of every ray.
    #[inline(always)]
    pub fn add_share<S: Simd>(&mut self, simd: S, index: u32, share: S::Vector) {
        (simd.load(&self.total) + share).store(&mut self.total);
        for (sum, attribute) in self.blends.sums.iter_mut().zip(self.image.attributes()) {
            let values = attribute.values(index);
            for (channel, value) in sum.iter_mut().zip(values) {
                share.mul_add(simd.splat(value), simd.load(channel)).store(channel);
            }
        }
    }

    /// Takes in the rays that are `found`; normals are in camera space, `ball` gives a ray's dominant ball.
    #[inline(always)]
    pub fn put<S: Simd>(
        &mut self,
        simd: S,
        found: S::Mask,
        depth: S::Vector,
        normal: [S::Vector; 3],
        ball: impl Fn(usize) -> u32,
    ) {
        let (zero, pixels) = (simd.splat(0.0), &mut self.pixels);
        depth.select(found, simd.load(&pixels.depth)).store(&mut pixels.depth);
        for (axis, lanes) in pixels.normal.iter_mut().enumerate() {
            let [right, up, forward] = self.camera_from_world.map(|row| simd.splat(row[axis]));
            let turned = normal[0].mul_add(right, normal[1].mul_add(up, normal[2] * forward));
            turned.select(found, simd.load(lanes)).store(lanes);
        }
        if !self.image.wants_shares() {
            return;
        }
        set_bits(found.bits()).for_each(|ray| pixels.ball[ray] = ball(ray) as i32);
        let total = simd.load(&self.total);
        let share = (simd.splat(1.0) / total).select(zero.lt(total), zero);
        for (values, sums) in self.blends.values.iter_mut().zip(&self.blends.sums) {
            for (value, sum) in values.iter_mut().zip(sums) {
                (simd.load(sum) * share).select(found, simd.load(value)).store(value);
            }
        }
    }

    /// Writes the packet's pixels.
    #[inline(always)]
    pub fn finish(self) {
        if self.place.stride == 1 && self.lanes == u16::MAX {
            self.image.put_packet([self.place.x, self.place.y], &self.pixels, &self.blends.values);
        } else {
            for lane in set_bits(self.lanes) {
                self.image.put_square(self.place.corner(lane), self.place.stride, &self.pixels, &self.blends.values, lane);
            }
        }
    }
}
