//! The tree as flat arrays.

use crate::error::Result;
use crate::memory;
use crate::simd::{LANES, Lanes};

use super::bounds::Bounds;
use super::members::Member;

/// `count` of a node that has children.
const INNER: u32 = u32::MAX;

/// `count` of a node within the fluid.
const FULL: u32 = u32::MAX - 1;

/// A node of the tree, 32 bytes: two vectors of four on a GPU. A node's left child follows it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Node {
    /// Least corner.
    pub low: [f32; 3],
    /// Of an inner node its right child, of a leaf the first of its ids.
    pub link: u32,
    /// Greatest corner.
    pub high: [f32; 3],
    /// Of an inner node 2^32 - 1, of a leaf how many ids it has, 2^32 - 2 of one that lies wholly within the fluid, 0 of one
    /// without surface, whose box is empty.
    pub count: u32,
}

/// What a node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// It has children: the next node, and this one.
    Inner {
        /// The right child.
        right: usize,
    },
    /// Some of the tree's ids are those of all balls that count in it.
    Leaf {
        /// Where they begin.
        first: usize,
        /// How many they are.
        count: usize,
    },
    /// It lies wholly within the fluid.
    Full,
    /// There is neither fluid nor surface.
    Empty,
}

impl Node {
    /// A node in this box.
    pub fn new(bounds: &Bounds, kind: Kind) -> Self {
        let (link, count) = match kind {
            Kind::Inner { right } => (right as u32, INNER),
            Kind::Leaf { first, count } => (first as u32, count as u32),
            Kind::Full => (0, FULL),
            Kind::Empty => (0, 0),
        };
        Self { low: bounds.low, link, high: bounds.high, count }
    }

    /// Its box.
    pub fn bounds(&self) -> Bounds {
        Bounds { low: self.low, high: self.high }
    }

    /// The node as eight numbers; those that are whole are the bits of a float.
    pub fn numbers(&self) -> [f32; 8] {
        let ([a, b, c], [d, e, f]) = (self.low, self.high);
        [a, b, c, f32::from_bits(self.link), d, e, f, f32::from_bits(self.count)]
    }

    /// The same node behind so many others, its ids behind so many others.
    fn moved(&self, nodes: usize, ids: usize) -> Self {
        let kind = match self.kind() {
            Kind::Inner { right } => Kind::Inner { right: right + nodes },
            Kind::Leaf { first, count } => Kind::Leaf { first: first + ids, count },
            kind => kind,
        };
        Self::new(&self.bounds(), kind)
    }

    /// What it is.
    pub fn kind(&self) -> Kind {
        match self.count {
            INNER => Kind::Inner { right: self.link as usize },
            FULL => Kind::Full,
            0 => Kind::Empty,
            count => Kind::Leaf { first: self.link as usize, count: count as usize },
        }
    }
}

/// Sixteen balls of a leaf, ready for vector loads.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Packet {
    /// Centres in scene coordinates.
    pub center: [Lanes; 3],
    /// `1 / R^2`.
    pub inverse_square: Lanes,
    /// q.
    pub weight: Lanes,
}

impl Packet {
    /// Balls that no ray meets, because they are too far away.
    pub const NONE: Self =
        Self { center: [Lanes::splat(f32::MAX); 3], inverse_square: Lanes::splat(1.0), weight: Lanes::splat(0.0) };
}

impl Packet {
    /// Puts a ball into a lane.
    pub fn set(&mut self, lane: usize, ball: &Member) {
        for (axis, lanes) in self.center.iter_mut().enumerate() {
            lanes.0[lane] = ball.center[axis];
        }
        self.inverse_square.0[lane] = 1.0 / (ball.radius * ball.radius);
        self.weight.0[lane] = ball.weight;
    }
}

/// A tree: nodes in depth-first order, and what the leaves hold.
#[derive(Debug, Default)]
pub struct Tree {
    /// The root is the first; there is none where there is no surface.
    pub nodes: Vec<Node>,
    /// The balls of the leaves. Each leaf's begin at a multiple of sixteen; `NO_BALL` fills the gaps.
    pub ids: Vec<u32>,
    /// The same balls, sixteen ids a packet.
    pub packets: Vec<Packet>,
}

/// Trees that were built apart, and the inner nodes above them.
pub enum Parts {
    /// One of them.
    Whole(Tree),
    /// A node, and what is below it.
    Inner(Bounds, Box<[Parts; 2]>),
}

impl Parts {
    /// How many nodes and packets there are.
    fn sizes(&self) -> [usize; 2] {
        match self {
            Self::Whole(tree) => [tree.nodes.len(), tree.packets.len()],
            Self::Inner(_, children) => {
                let [left, right] = [children[0].sizes(), children[1].sizes()];
                [1 + left[0] + right[0], left[1] + right[1]]
            }
        }
    }
}

/// An id that is none.
pub const NO_BALL: u32 = u32::MAX;

impl Tree {
    /// One tree of trees that were built apart.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn joined(parts: Parts) -> Result<Self> {
        let mut tree = match parts {
            Parts::Whole(tree) => return Ok(tree),
            Parts::Inner(..) => Self::default(),
        };
        let [nodes, packets] = parts.sizes();
        memory::reserve(&mut tree.nodes, nodes)?;
        memory::reserve(&mut tree.ids, packets * LANES)?;
        memory::reserve(&mut tree.packets, packets)?;
        tree.push(parts);
        Ok(tree)
    }

    /// Appends what there is room for.
    fn push(&mut self, parts: Parts) {
        match parts {
            Parts::Whole(part) => {
                let (nodes, ids) = (self.nodes.len(), self.ids.len());
                self.nodes.extend(part.nodes.iter().map(|node| node.moved(nodes, ids)));
                self.ids.extend_from_slice(&part.ids);
                self.packets.extend_from_slice(&part.packets);
            }
            Parts::Inner(bounds, children) => {
                let [left, right] = *children;
                let node = self.nodes.len();
                self.nodes.push(Node::new(&bounds, Kind::Inner { right: 0 }));
                self.push(left);
                self.nodes[node].link = self.nodes.len() as u32;
                self.push(right);
            }
        }
    }

    /// The packets of a leaf.
    #[inline(always)]
    pub fn packets_of(&self, first: usize, count: usize) -> &[Packet] {
        &self.packets[first / LANES..(first + count).div_ceil(LANES)]
    }
}
