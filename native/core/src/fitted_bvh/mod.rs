//! The fitted bounding volume hierarchy for metaballs (Gourmel, Pajot, Paulin, Barthe, Poulin 2010): any rays, also
//! incoherent ones, against the surface. `docs/fitted_bvh.md` derives what goes beyond the paper.

pub(crate) mod bounds;
mod cast;
mod construction;
mod density;
mod discarding;
pub(crate) mod hierarchy;
mod leaf;
mod members;
mod options;
pub(crate) mod ray;
mod split;
pub(crate) mod traversal;
pub(crate) mod wide;

use crate::balls::{Balls, bounded_weight};
use crate::error::Result;
use crate::field::Field;
use crate::job::Job;
use crate::simd::Path;

use bounds::Bounds;
use construction::{Cell, Plan, build};
use density::Density;
use members::{Member, Members};

pub use cast::{FirstHits, Rays};
pub use hierarchy::{Kind, NO_BALL, Node, Tree};
pub use options::{Hierarchy, Options};
pub use traversal::{Counts, Hit};

/// A tree over balls, in which rays find the surface. It keeps what it needs of the balls.
///
/// Scene coordinates are world coordinates less `origin`, which is chosen so that centres lose no digit.
#[derive(Debug)]
pub struct FittedBvh {
    tree: Tree,
    wide: Vec<wide::WideNode>,
    density: Density,
    origin: [f64; 3],
    path: Path,
    largest_leaf: usize,
}

impl FittedBvh {
    /// Builds the tree, with all threads of the current rayon pool.
    ///
    /// # Errors
    /// `OutOfMemory`, `Cancelled`; `InvalidInput` where the environment asks for a SIMD path that is not there.
    pub fn build(balls: &Balls, field: &Field, options: &Options, job: &Job) -> Result<Self> {
        let path = Path::chosen()?;
        let density = Density::new(field);
        let origin = balls.exact_origin();
        let (members, span) = Members::new((0..balls.len()).map(|index| member(balls, index, &origin)))?;
        let plan = Plan { density: &density, options, path, job };
        let bounds = bounds_of(&members, span);
        let tree = build(&plan, members, Cell { span, own: span.count, bounds, depth: 0 })?;
        let wide = wide::widened(&tree.nodes)?;
        let largest_leaf = tree.nodes.iter().map(leaf_size).max().unwrap_or(0);
        Ok(Self { tree, wide, density, origin, path, largest_leaf })
    }

    /// The tree as flat arrays, in scene coordinates.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Where scene coordinates are 0, world space.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.tree.nodes.as_slice())
            + size_of_val(self.tree.ids.as_slice())
            + size_of_val(self.tree.packets.as_slice())
            + size_of_val(self.wide.as_slice())
    }
}

fn leaf_size(node: &Node) -> usize {
    if let Kind::Leaf { count, .. } = node.kind() { count } else { 0 }
}

fn member(balls: &Balls, index: usize, origin: &[f64; 3]) -> Member {
    let (position, radius) = (balls.positions()[index], balls.radii()[index]);
    Member {
        center: std::array::from_fn(|axis| (f64::from(position[axis]) - origin[axis]) as f32),
        radius,
        weight: bounded_weight(balls.weights()[index], radius),
        id: index as u32,
    }
}

fn bounds_of(members: &Members, span: members::Span) -> Bounds {
    (0..span.count).fold(Bounds::EMPTY, |bounds, index| {
        let Member { center, radius, .. } = members.get(span, index);
        bounds.union(&Bounds { low: center.map(|c| c - radius), high: center.map(|c| c + radius) }.widened())
    })
}

#[cfg(test)]
mod tests;
