//! Meshes in a tree, in which any rays find their triangles: beside the fitted BVH, whose nodes it shares.
//!
//! The tree is built from top to bottom by the surface area heuristic in bins (Wald 2007). Leaves hold up to sixteen triangles,
//! which are tested at once; no ray passes between two that share an edge (Woop, Benthin, Wald 2013).

use crate::error::{Error, Result};
use crate::fitted_bvh::bounds::Bounds;
use crate::fitted_bvh::hierarchy::{Kind, Node};
use crate::fitted_bvh::ray::{BoxTest, Ray, Segment};
use crate::fitted_bvh::traversal::{Entered, enter_children};
use crate::fitted_bvh::wide::{LEAF, WideNode, widened};
use crate::job::Job;
use crate::memory;
use crate::simd::{LANES, Lanes, Mask, Simd, Vector};

use crate::vectors::{cross, difference, dot};

/// Where a node may be cut along an axis.
const BINS: usize = 16;

/// Deeper nodes are cut in halves, so that no tree is deeper than this and the logarithm of its size.
const MOST_UNEVEN: usize = 48;

/// What the test of a further node costs, in tests of sixteen triangles.
const TRAVERSAL_COST: f32 = 0.7;

/// An id that is none.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// Sixteen triangles: the coordinates of their corners.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
struct Packet([[Lanes; 3]; 3]);

/// A tree over triangles. It keeps their corners.
#[derive(Debug)]
pub struct Triangles {
    /// A box that is larger than all, so that a ray begins before what it meets, also where all is flat.
    room: Option<Node>,
    nodes: Vec<Node>,
    wide: Vec<WideNode>,
    packets: Vec<Packet>,
    ids: Vec<u32>,
    count: usize,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Distance from the ray's origin.
    pub t: f64,
    /// Its number.
    pub triangle: usize,
    /// Unit, as the corners go round.
    pub normal: [f64; 3],
    /// What the second and the third corner count there.
    pub shares: [f64; 2],
}

impl Triangles {
    /// Builds the tree; vertices are in world space, triangles are the numbers of their corners.
    ///
    /// # Errors
    /// `InvalidInput` where there is no such vertex, or one is not finite; `OutOfMemory`, `Cancelled`.
    pub fn build(vertices: &[[f32; 3]], triangles: &[[i32; 3]], job: &Job) -> Result<Self> {
        let is_there = |index: &i32| usize::try_from(*index).is_ok_and(|index| index < vertices.len());
        if !triangles.iter().flatten().all(is_there) {
            return Err(Error::InvalidInput("a triangle has a vertex that does not exist".into()));
        }
        if !vertices.as_flattened().iter().all(|number| number.is_finite()) {
            return Err(Error::InvalidInput("all vertices of triangles must be finite".into()));
        }
        let mut boxes = memory::with_capacity(triangles.len())?;
        for (id, corners) in triangles.iter().enumerate() {
            let corners = corners.map(|corner| vertices[corner as usize]);
            boxes.push(Boxed { bounds: bounds_of(&corners), id: id as u32 });
        }
        let (nodes, wide, packets, ids) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut tree = Self { room: None, nodes, wide, packets, ids, count: triangles.len() };
        if !boxes.is_empty() {
            job.expect(boxes.len());
            Builder { vertices, triangles, job, tree: &mut tree }.build(&mut boxes, 0)?;
            tree.wide = widened(&tree.nodes)?;
            tree.room = tree.nodes.first().map(|root| Node::new(&roomy(&root.bounds()), root.kind()));
        }
        Ok(tree)
    }

    /// How many triangles there are.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The nodes, as those of the fitted BVH; leaves are numbers of `ids`.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The triangles of the leaves. Each leaf's begin at a multiple of sixteen; `NO_TRIANGLE` fills the gaps.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }
}

/// A triangle while the tree is built.
#[derive(Clone, Copy)]
struct Boxed {
    bounds: Bounds,
    id: u32,
}

fn bounds_of(points: &[[f32; 3]]) -> Bounds {
    points.iter().fold(Bounds::EMPTY, |bounds, point| bounds.union(&Bounds { low: *point, high: *point }))
}

fn roomy(bounds: &Bounds) -> Bounds {
    let farthest = bounds.low.iter().chain(&bounds.high).fold(f32::MIN_POSITIVE, |most: f32, c| most.max(c.abs()));
    let more = 1e-5 * farthest;
    Bounds { low: bounds.low.map(|c| c - more), high: bounds.high.map(|c| c + more) }
}

struct Builder<'a> {
    vertices: &'a [[f32; 3]],
    triangles: &'a [[i32; 3]],
    job: &'a Job,
    tree: &'a mut Triangles,
}

impl Builder<'_> {
    fn build(&mut self, boxes: &mut [Boxed], depth: usize) -> Result<()> {
        let bounds = boxes.iter().fold(Bounds::EMPTY, |bounds, item| bounds.union(&item.bounds));
        if boxes.len() <= LANES && !(boxes.len() > LANES / 2 && cheapest(boxes, &bounds, leaf_cost(boxes.len())).is_some()) {
            return self.push_leaf(boxes, &bounds);
        }
        let cut = if depth < MOST_UNEVEN { cheapest(boxes, &bounds, f32::INFINITY) } else { None };
        let middle = match cut {
            Some(cut) => parted(boxes, |item| cut.bin_of(item) <= cut.bin),
            None => boxes.len() / 2,
        };
        let node = self.tree.nodes.len();
        memory::reserve(&mut self.tree.nodes, 1)?;
        self.tree.nodes.push(Node::new(&bounds, Kind::Inner { right: 0 }));
        let (left, right) = boxes.split_at_mut(middle);
        self.build(left, depth + 1)?;
        self.tree.nodes[node].link = self.tree.nodes.len() as u32;
        self.build(right, depth + 1)
    }

    fn push_leaf(&mut self, boxes: &[Boxed], bounds: &Bounds) -> Result<()> {
        let Triangles { nodes, packets, ids, .. } = &mut *self.tree;
        memory::reserve(nodes, 1)?;
        memory::reserve(packets, 1)?;
        memory::reserve(ids, LANES)?;
        nodes.push(Node::new(bounds, Kind::Leaf { first: ids.len(), count: boxes.len() }));
        // Lanes without triangle hold a point, which no ray meets.
        let mut packet = Packet([[Lanes::splat(0.0); 3]; 3]);
        for (lane, item) in boxes.iter().enumerate() {
            let corners = self.triangles[item.id as usize].map(|corner| self.vertices[corner as usize]);
            for (columns, corner) in packet.0.iter_mut().zip(corners) {
                for (column, number) in columns.iter_mut().zip(corner) {
                    column.0[lane] = number;
                }
            }
        }
        packets.push(packet);
        ids.extend(boxes.iter().map(|item| item.id));
        ids.resize(packets.len() * LANES, NO_TRIANGLE);
        self.job.advance(boxes.len())
    }
}

/// What the leaves of so many triangles cost a ray that meets them.
fn leaf_cost(count: usize) -> f32 {
    count.div_ceil(LANES) as f32
}

/// A plane between two bins across an axis.
#[derive(Clone, Copy)]
struct Cut {
    axis: usize,
    low: f32,
    scale: f32,
    bin: usize,
}

impl Cut {
    fn bin_of(&self, item: &Boxed) -> usize {
        ((item.bounds.middle()[self.axis] - self.low) * self.scale).clamp(0.0, (BINS - 1) as f32) as usize
    }
}

/// The cut that costs least, and less than `least`; none where there is no such one.
fn cheapest(boxes: &[Boxed], bounds: &Bounds, mut least: f32) -> Option<Cut> {
    let middles = boxes.iter().fold(Bounds::EMPTY, |all, item| {
        let middle = item.bounds.middle();
        all.union(&Bounds { low: middle, high: middle })
    });
    let per_area = bounds.half_area().max(f32::MIN_POSITIVE).recip();
    let mut best = None;
    for axis in 0..3 {
        let size = middles.size()[axis];
        let scale = BINS as f32 / size;
        if !(size > 0.0 && scale.is_finite()) {
            continue;
        }
        let cut = Cut { axis, low: middles.low[axis], scale, bin: 0 };
        let mut bins = [(Bounds::EMPTY, 0usize); BINS];
        for item in boxes {
            let bin = &mut bins[cut.bin_of(item)];
            *bin = (bin.0.union(&item.bounds), bin.1 + 1);
        }
        let mut above = [(0.0, 0usize); BINS];
        let mut part = (Bounds::EMPTY, 0);
        for bin in (1..BINS).rev() {
            part = (part.0.union(&bins[bin].0), part.1 + bins[bin].1);
            above[bin - 1] = (part.0.half_area(), part.1);
        }
        part = (Bounds::EMPTY, 0);
        for bin in 0..BINS - 1 {
            part = (part.0.union(&bins[bin].0), part.1 + bins[bin].1);
            if part.1 == 0 || above[bin].1 == 0 {
                continue;
            }
            let both = part.0.half_area() * leaf_cost(part.1) + above[bin].0 * leaf_cost(above[bin].1);
            let cost = TRAVERSAL_COST + both * per_area;
            if cost < least {
                (best, least) = (Some(Cut { bin, ..cut }), cost);
            }
        }
    }
    best
}

/// Brings what passes a test to the front, and gives the number of those.
fn parted(boxes: &mut [Boxed], passes: impl Fn(&Boxed) -> bool) -> usize {
    let mut front = 0;
    for index in 0..boxes.len() {
        if passes(&boxes[index]) {
            boxes.swap(front, index);
            front += 1;
        }
    }
    front
}

/// Casts rays at triangles, one after another.
pub struct TriangleCaster<'a, S: Simd> {
    simd: S,
    triangles: &'a Triangles,
    waiting: Vec<Entered>,
}

impl<'a, S: Simd> TriangleCaster<'a, S> {
    #[inline(always)]
    pub fn new(simd: S, triangles: &'a Triangles) -> Self {
        Self { simd, triangles, waiting: Vec::with_capacity(256) }
    }

    /// The first triangle that a ray meets from either side; any one where that is enough.
    #[inline(always)]
    pub fn hit(&mut self, ray: &Ray, any: bool) -> Option<TriangleHit> {
        let room = self.triangles.room.as_ref()?;
        let segment = Segment::new(ray, &[0.0; 3], room)?;
        let boxes = BoxTest::new(self.simd, &segment, room);
        let sheared = Sheared::new(self.simd, &segment);
        let mut end = segment.length;
        let mut met = None;
        self.waiting.clear();
        self.waiting.push(Entered { at: 0.0, child: 0 });
        while let Some(entered) = self.waiting.pop() {
            if f64::from(entered.at) > end {
                continue;
            }
            if entered.child & LEAF == 0 {
                let node = &self.triangles.wide[entered.child as usize];
                enter_children(self.simd, &boxes, node, end as f32, &mut self.waiting);
                continue;
            }
            let Kind::Leaf { first, .. } = self.triangles.nodes[(entered.child & !LEAF) as usize].kind() else { continue };
            let packet = &self.triangles.packets[first / LANES];
            let mut candidates = sheared.meets(self.simd, packet).bits();
            while candidates != 0 {
                let lane = candidates.trailing_zeros() as usize;
                candidates &= candidates - 1;
                if let Some(found) = exact(packet, lane, &segment, end) {
                    end = found.t;
                    met = Some(TriangleHit {
                        t: segment.t_start + found.t,
                        triangle: self.triangles.ids[first + lane] as usize,
                        ..found
                    });
                }
            }
            if any && met.is_some() {
                break;
            }
        }
        met
    }
}

/// Where a line that passes through a triangle meets its plane, if within [0, `end`].
#[inline(always)]
fn exact(packet: &Packet, lane: usize, segment: &Segment, end: f64) -> Option<TriangleHit> {
    let corner = |number: usize| -> [f64; 3] { std::array::from_fn(|axis| f64::from(packet.0[number][axis].0[lane])) };
    let first = corner(0);
    let (a, b) = (difference(corner(1), first), difference(corner(2), first));
    let normal = cross(a, b);
    let toward = difference(first, segment.start);
    let slope = dot(normal, segment.direction);
    let t = dot(toward, normal) / slope;
    if !(0.0..=end).contains(&t) {
        return None;
    }
    // Cramer's rule (Möller and Trumbore 1997).
    let across = cross(segment.direction, toward);
    let shares = [-dot(across, b) / slope, dot(across, a) / slope];
    let length = dot(normal, normal).sqrt();
    Some(TriangleHit { t, triangle: 0, normal: normal.map(|c| c / length), shares })
}

/// A ray in the space where it goes along z (Woop, Benthin, Wald 2013).
struct Sheared<S: Simd> {
    axes: [usize; 3],
    coarse: [S::Vector; 3],
    fine: [S::Vector; 3],
    shear: [S::Vector; 2],
}

impl<S: Simd> Sheared<S> {
    #[inline(always)]
    fn new(simd: S, segment: &Segment) -> Self {
        let [x, y, z] = segment.direction.map(f64::abs);
        let along = if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        };
        let axes = [(along + 1) % 3, (along + 2) % 3, along];
        let coarse = axes.map(|axis| segment.start[axis] as f32);
        let fine = axes.map(|axis| (segment.start[axis] - f64::from(segment.start[axis] as f32)) as f32);
        let slope = |axis: usize| (segment.direction[axes[axis]] / segment.direction[along]) as f32;
        Self {
            axes,
            coarse: [simd.splat(coarse[0]), simd.splat(coarse[1]), simd.splat(coarse[2])],
            fine: [simd.splat(fine[0]), simd.splat(fine[1]), simd.splat(fine[2])],
            shear: [simd.splat(slope(0)), simd.splat(slope(1))],
        }
    }

    /// A corner of sixteen triangles as the ray sees it.
    #[inline(always)]
    fn seen(&self, simd: S, corner: &[Lanes; 3]) -> [S::Vector; 2] {
        let [x, y, z] = self.axes;
        let depth = simd.load(&corner[z]) - self.coarse[2] - self.fine[2];
        let x = simd.load(&corner[x]) - self.coarse[0] - self.fine[0];
        let y = simd.load(&corner[y]) - self.coarse[1] - self.fine[1];
        [depth.neg_mul_add(self.shear[0], x), depth.neg_mul_add(self.shear[1], y)]
    }

    /// The triangles that the line goes through. Neighbours compute the same of an edge that they share, but for the sign: each
    /// product is rounded by itself.
    #[inline(always)]
    fn meets(&self, simd: S, packet: &Packet) -> S::Mask {
        let [[ax, ay], [bx, by], [cx, cy]] =
            [self.seen(simd, &packet.0[0]), self.seen(simd, &packet.0[1]), self.seen(simd, &packet.0[2])];
        let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
        let zero = simd.splat(0.0);
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        (zero.le(least) | most.le(zero)) & (least.lt(zero) | zero.lt(most))
    }
}
