//! The way of a ray through the tree (Gourmel et al. 2010, section 5.2): near children first.

use crate::simd::{Mask, Simd, Vector};

use super::FittedBvh;
use super::hierarchy::{Kind, Node};
use super::leaf::{Met, Search, Searcher};
use super::ray::{BoxTest, Ray, Segment};
use super::wide::{LEAF, WideNode};

/// Where a ray first crosses the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the ray's origin.
    pub t: f64,
    /// Unit, out of the fluid.
    pub normal: [f32; 3],
    /// The ball with the greatest share of the field.
    pub ball: u32,
    /// So far from the surface, along the normal, a ray begins surely on one side of it.
    pub lift: f32,
    leaf: usize,
}

/// What is counted on the way.
pub trait Counter {
    /// A wide node was visited.
    fn visit(&mut self);
    /// A leaf with so many balls was searched.
    fn search(&mut self, balls: usize);
}

/// Counts nothing.
pub struct Uncounted;

impl Counter for Uncounted {
    #[inline(always)]
    fn visit(&mut self) {}
    #[inline(always)]
    fn search(&mut self, _: usize) {}
}

/// Sums over rays; the columns of table 3 of the paper.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Nodes, of sixteen children each, whose children were tested.
    pub traversals: u64,
    /// Leaves whose balls were searched for the surface.
    pub searches: u64,
    /// Balls in those leaves.
    pub balls: u64,
}

impl std::ops::Add for Counts {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            traversals: self.traversals + other.traversals,
            searches: self.searches + other.searches,
            balls: self.balls + other.balls,
        }
    }
}

impl Counter for Counts {
    fn visit(&mut self) {
        self.traversals += 1;
    }
    fn search(&mut self, balls: usize) {
        self.searches += 1;
        self.balls += balls as u64;
    }
}

/// A child that a segment enters at a distance.
#[derive(Clone, Copy, Debug)]
pub struct Entered {
    /// Distance from the segment's start, or less by rounding.
    pub at: f32,
    /// As in [`WideNode`].
    pub child: u32,
}

/// Where a segment crosses the surface, and in which leaf.
struct Found {
    distance: f64,
    leaf: usize,
    /// Whether the segment leaves the fluid there.
    leaves: bool,
}

/// Casts rays one after another.
pub struct Caster<'a, S: Simd, C> {
    simd: S,
    bvh: &'a FittedBvh,
    searcher: Searcher<'a, S>,
    waiting: Vec<Entered>,
    met: Met,
    pub counter: C,
}

impl<'a, S: Simd, C: Counter> Caster<'a, S, C> {
    #[inline(always)]
    pub fn new(simd: S, bvh: &'a FittedBvh, counter: C) -> Self {
        let searcher = Searcher::new(simd, &bvh.density);
        Self { simd, bvh, searcher, waiting: Vec::with_capacity(256), met: Met::with_room(bvh.largest_leaf), counter }
    }

    /// The first crossing of a ray with the surface, either way.
    #[inline(always)]
    pub fn first_hit(&mut self, ray: &Ray) -> Option<Hit> {
        let segment = Segment::new(ray, &self.bvh.origin, self.bvh.tree.nodes.first()?)?;
        let found = self.find(&segment, false)?;
        let Kind::Leaf { first, count } = self.bvh.tree.nodes[found.leaf].kind() else { return None };
        let packets = self.bvh.tree.packets_of(first, count);
        let facing = segment.direction.map(|c| if found.leaves { c } else { -c } as f32);
        let place = self.searcher.surface(packets, segment.at(found.distance), facing);
        Some(Hit {
            t: segment.t_start + found.distance,
            normal: place.normal,
            ball: self.bvh.tree.ids[first + place.ball],
            lift: place.lift,
            leaf: found.leaf,
        })
    }

    /// The colours of the balls at a hit, each weighted by its share of the field.
    #[inline(always)]
    pub fn color(&self, hit: &Hit, point: [f64; 3], colors: &[[f32; 3]]) -> [f32; 3] {
        let Kind::Leaf { first, count } = self.bvh.tree.nodes[hit.leaf].kind() else { return [0.0; 3] };
        let local = std::array::from_fn(|axis| point[axis] - self.bvh.origin[axis]);
        self.searcher.blend(self.bvh.tree.packets_of(first, count), &self.bvh.tree.ids[first..first + count], local, colors)
    }

    /// Whether a ray crosses the surface.
    #[inline(always)]
    pub fn any_hit(&mut self, ray: &Ray) -> bool {
        let Some(root) = self.bvh.tree.nodes.first() else { return false };
        let Some(segment) = Segment::new(ray, &self.bvh.origin, root) else { return false };
        self.find(&segment, true).is_some()
    }

    /// The first crossing; any one where that is enough.
    #[inline(always)]
    fn find(&mut self, segment: &Segment, any: bool) -> Option<Found> {
        let boxes = BoxTest::new(self.simd, segment, &self.bvh.tree.nodes[0]);
        let mut begins_inside = None;
        let mut end = segment.length;
        let mut found = None;
        self.waiting.clear();
        self.waiting.push(Entered { at: 0.0, child: 0 });
        while let Some(entered) = self.waiting.pop() {
            if f64::from(entered.at) > end {
                continue;
            }
            if entered.child & LEAF == 0 {
                self.counter.visit();
                let node = &self.bvh.wide[entered.child as usize];
                enter_children(self.simd, &boxes, node, end as f32, &mut self.waiting);
                continue;
            }
            let leaf = (entered.child & !LEAF) as usize;
            if begins_inside.is_none() {
                begins_inside = self.begins_inside(segment, entered, leaf);
            }
            let Some(inside) = begins_inside else { continue };
            if any && !inside && self.bvh.tree.nodes[leaf].kind() == Kind::Full {
                return Some(Found { distance: f64::from(entered.at), leaf, leaves: false });
            }
            if let Some(distance) = self.search(segment, leaf, end, Search { inside, any }) {
                end = distance;
                found = Some(Found { distance, leaf, leaves: inside });
                if any {
                    break;
                }
            }
        }
        found
    }

    /// Whether a segment begins within the fluid, if it begins in this leaf or in no box that waits. Otherwise the leaf must
    /// wait for such a box.
    #[inline(always)]
    fn begins_inside(&mut self, segment: &Segment, entered: Entered, leaf: usize) -> Option<bool> {
        let node = &self.bvh.tree.nodes[leaf];
        if contains(node, &segment.start) {
            let Kind::Leaf { first, count } = node.kind() else { return Some(node.kind() == Kind::Full) };
            return Some(self.searcher.is_inside(self.bvh.tree.packets_of(first, count), segment.start));
        }
        let Some(place) = self.waiting.iter().rposition(|waiting| waiting.at == 0.0) else {
            return Some(false);
        };
        let nearer = std::mem::replace(&mut self.waiting[place], Entered { at: entered.at.max(f32::MIN_POSITIVE), ..entered });
        self.waiting.push(nearer);
        None
    }

    #[inline(always)]
    fn search(&mut self, segment: &Segment, leaf: usize, end: f64, search: Search) -> Option<f64> {
        let node = &self.bvh.tree.nodes[leaf];
        // Within the fluid no surface is crossed.
        let Kind::Leaf { first, count } = node.kind() else { return None };
        let interval = segment.interval_in(node, end)?;
        self.counter.search(count);
        let packets = self.bvh.tree.packets_of(first, count);
        self.searcher.crossing(packets, segment, interval, search, &mut self.met)
    }
}

fn contains(node: &Node, point: &[f64; 3]) -> bool {
    (0..3).all(|axis| f64::from(node.low[axis]) <= point[axis] && point[axis] <= f64::from(node.high[axis]))
}

/// Puts the children that a segment meets before `end` onto the stack, the nearest on top.
#[inline(always)]
pub fn enter_children<S: Simd>(simd: S, boxes: &BoxTest<S>, node: &WideNode, end: f32, waiting: &mut Vec<Entered>) {
    let (meets, enters) = boxes.meets(simd, node, simd.splat(end));
    let mut rest = meets.bits();
    let enters = enters.lanes().0;
    let bottom = waiting.len();
    while rest != 0 {
        let lane = rest.trailing_zeros() as usize;
        rest &= rest - 1;
        let entered = Entered { at: enters[lane], child: node.children[lane] };
        waiting.push(entered);
        let mut place = waiting.len() - 1;
        while place > bottom && waiting[place - 1].at < entered.at {
            waiting[place] = waiting[place - 1];
            place -= 1;
        }
        waiting[place] = entered;
    }
}
