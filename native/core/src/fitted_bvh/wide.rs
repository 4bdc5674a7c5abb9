//! The tree with sixteen children a node, so that one vector operation tests all their boxes against a ray.

use crate::error::Result;
use crate::memory;
use crate::simd::{LANES, Lanes};

use super::hierarchy::{Kind, Node};

/// Marks a child that is a leaf; the other bits are its number among the nodes of the tree.
pub const LEAF: u32 = 1 << 31;

/// Sixteen children.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct WideNode {
    /// Low x, y, z and high x, y, z; children that are missing have empty boxes.
    pub planes: [Lanes; 6],
    /// Numbers of wide nodes, or of leaves.
    pub children: [u32; LANES],
}

/// Puts the nodes of a tree together to wide ones; the first is the root.
///
/// # Errors
/// `OutOfMemory`.
pub fn widened(nodes: &[Node]) -> Result<Vec<WideNode>> {
    let mut wide = Vec::new();
    // The tree's node that each wide node stands for.
    let mut roots = vec![0];
    let mut next = 0;
    while next < roots.len() {
        let children = children_of(nodes, roots[next]);
        memory::reserve(&mut wide, 1)?;
        memory::reserve(&mut roots, children.len())?;
        wide.push(wide_node(nodes, &children, &mut roots));
        next += 1;
    }
    Ok(wide)
}

/// Up to sixteen nodes that together stand for `root`: the largest are opened first.
fn children_of(nodes: &[Node], root: usize) -> Vec<usize> {
    let mut children = Vec::with_capacity(LANES);
    let mut opened = Some(root);
    while let Some(index) = opened {
        children.retain(|child| *child != index);
        match nodes[index].kind() {
            Kind::Inner { right } => {
                children.extend([index + 1, right].into_iter().filter(|child| nodes[*child].kind() != Kind::Empty))
            }
            Kind::Leaf { .. } | Kind::Full => children.push(index),
            Kind::Empty => {}
        }
        opened = if children.len() < LANES { largest_inner(nodes, &children) } else { None };
    }
    children
}

fn largest_inner(nodes: &[Node], children: &[usize]) -> Option<usize> {
    let inner = children.iter().copied().filter(|child| matches!(nodes[*child].kind(), Kind::Inner { .. }));
    inner.max_by(|a, b| nodes[*a].bounds().half_area().total_cmp(&nodes[*b].bounds().half_area()))
}

fn wide_node(nodes: &[Node], children: &[usize], roots: &mut Vec<usize>) -> WideNode {
    let mut node = WideNode { planes: [Lanes::splat(f32::INFINITY); 6], children: [0; LANES] };
    node.planes[3..].fill(Lanes::splat(f32::NEG_INFINITY));
    for (lane, child) in children.iter().enumerate() {
        for axis in 0..3 {
            node.planes[axis].0[lane] = nodes[*child].low[axis];
            node.planes[3 + axis].0[lane] = nodes[*child].high[axis];
        }
        node.children[lane] = match nodes[*child].kind() {
            Kind::Inner { .. } => {
                roots.push(*child);
                roots.len() as u32 - 1
            }
            _ => LEAF | *child as u32,
        };
    }
    node
}
