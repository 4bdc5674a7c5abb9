//! Builds the tree from top to bottom (Gourmel et al. 2010, algorithms 1 and 2).

use crate::error::Result;
use crate::job::Job;
use crate::memory;
use crate::simd::{LANES, Path, Simd, Task};

use super::bounds::Bounds;
use super::density::Density;
use super::discarding::contributors;
use super::hierarchy::{Kind, NO_BALL, Node, Packet, Parts, Tree};
use super::members::{And, BoxLanes, CentreBelow, EIGHTHS, Fails, Member, Members, Span, Test, Touches};
use super::options::{Hierarchy, Options};
use super::split::{Plane, plane_between_centers, plane_through};

/// Nodes with more balls are built by two threads.
const PARALLEL: usize = 16_384;

/// Whether the field can cross the isovalue in a box is asked where at most so many balls touch it: more are never all
/// decided at once.
const RANGE_LIMIT: usize = 256;

/// Whether a box lies within the fluid is asked where at most so many balls touch it.
const FLUID_LIMIT: usize = 768;

/// Nodes that are built between two looks at whether the user gave up.
const NODES_BETWEEN_REPORTS: usize = 256;

/// A path of nodes is no longer, so that traversal stacks have a bound. Halving a float's range takes less.
pub const MAX_DEPTH: usize = 96;

/// What the construction needs everywhere.
#[derive(Clone, Copy)]
pub struct Plan<'a> {
    pub density: &'a Density,
    pub options: &'a Options,
    pub path: Path,
    pub job: &'a Job,
}

/// A node to be: the balls that belong to it come first in its span, then those that reach in from elsewhere. In a fitted
/// tree both are treated alike, and all count as its own.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    pub span: Span,
    pub own: usize,
    /// No surface of this node is outside.
    pub bounds: Bounds,
    pub depth: usize,
}

/// What became of a cell.
enum Outcome {
    Empty,
    Full(Bounds),
    Leaf(Cell),
    /// The node's box, and its children.
    Inner(Bounds, [Cell; 2]),
}

/// Builds the tree of a cell.
///
/// # Errors
/// `OutOfMemory`, `Cancelled`.
pub fn build(plan: &Plan, members: Members, cell: Cell) -> Result<Tree> {
    Tree::joined(build_parts(plan, members, cell)?)
}

fn build_parts(plan: &Plan, mut members: Members, cell: Cell) -> Result<Parts> {
    let division =
        if cell.span.count <= PARALLEL { None } else { plan.path.dispatch(Division { plan, members: &mut members, cell })? };
    let Some((bounds, [left, right])) = division else {
        return plan.path.dispatch(Subtree { plan, members, cell }).map(Parts::Whole);
    };
    let alone = |child: Cell| members.copied(child.span).map(|(members, span)| (members, Cell { span, ..child }));
    let (left, right) = (alone(left)?, alone(right)?);
    drop(members);
    let (left, right) = rayon::join(|| build_parts(plan, left.0, left.1), || build_parts(plan, right.0, right.1));
    Ok(Parts::Inner(bounds, Box::new([left?, right?])))
}

/// The box and the children of a cell that is too large to be proven free of the surface.
struct Division<'a> {
    plan: &'a Plan<'a>,
    members: &'a mut Members,
    cell: Cell,
}

impl Task for Division<'_> {
    type Output = Result<Option<(Bounds, [Cell; 2])>>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let Some(bounds) = fitted_bounds(simd, self.plan, self.members, &self.cell) else {
            return Ok(None);
        };
        let children = divide(simd, self.plan, self.members, &Cell { bounds, ..self.cell })?;
        Ok(children.map(|children| (bounds, children)))
    }
}

/// A whole tree with the instructions of the path.
struct Subtree<'a> {
    plan: &'a Plan<'a>,
    members: Members,
    cell: Cell,
}

/// A cell that waits, and the inner node whose right child it is.
struct Waiting {
    cell: Cell,
    parent: Option<usize>,
}

impl Task for Subtree<'_> {
    type Output = Result<Tree>;

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Result<Tree> {
        let mut tree = Tree::default();
        self.plan.job.expect(self.cell.span.count);
        let mut waiting = vec![Waiting { cell: self.cell, parent: None }];
        while let Some(Waiting { cell, parent }) = waiting.pop() {
            self.members.truncate(cell.span);
            if tree.nodes.len().is_multiple_of(NODES_BETWEEN_REPORTS) {
                self.plan.job.advance(0)?;
            }
            if let Some(parent) = parent {
                tree.nodes[parent].link = tree.nodes.len() as u32;
            }
            memory::reserve(&mut tree.nodes, 1)?;
            match decide(simd, self.plan, &mut self.members, cell)? {
                Outcome::Empty => tree.nodes.push(Node::new(&Bounds::EMPTY, Kind::Empty)),
                Outcome::Full(bounds) => tree.nodes.push(Node::new(&bounds, Kind::Full)),
                Outcome::Leaf(leaf) => push_leaf(simd, self.plan, &mut self.members, &leaf, &mut tree)?,
                Outcome::Inner(bounds, [left, right]) => {
                    let node = tree.nodes.len();
                    tree.nodes.push(Node::new(&bounds, Kind::Inner { right: 0 }));
                    waiting.push(Waiting { cell: right, parent: Some(node) });
                    waiting.push(Waiting { cell: left, parent: None });
                }
            }
        }
        self.plan.job.advance(self.cell.span.count)?;
        Ok(tree)
    }
}

/// What a cell becomes; the balls of its children are appended, those of the left one last.
#[inline(always)]
fn decide<S: Simd>(simd: S, plan: &Plan, members: &mut Members, cell: Cell) -> Result<Outcome> {
    let Some(bounds) = fitted_bounds(simd, plan, members, &cell) else {
        return Ok(Outcome::Empty);
    };
    let bounds = match crossed(simd, plan, members, cell.span, &bounds) {
        Crossed::Nowhere { is_full: true } => return Ok(Outcome::Full(bounds)),
        Crossed::Nowhere { is_full: false } => return Ok(Outcome::Empty),
        Crossed::Within(bounds) => bounds,
    };
    let cell = Cell { bounds, ..cell };
    let children = divide(simd, plan, members, &cell)?;
    Ok(children.map_or(Outcome::Leaf(cell), |children| Outcome::Inner(bounds, children)))
}

/// Where the field may cross the isovalue in a box.
enum Crossed {
    Nowhere { is_full: bool },
    Within(Bounds),
}

/// Where the surface may cross a box: nowhere in one within the fluid, and not in its eighths that are outside.
#[inline(always)]
fn crossed<S: Simd>(simd: S, plan: &Plan, members: &Members, span: Span, bounds: &Bounds) -> Crossed {
    if !plan.options.proves || span.count > FLUID_LIMIT {
        return Crossed::Within(*bounds);
    }
    if span.count > RANGE_LIMIT {
        // Few boxes of dilute fluids would pass the test, which takes long.
        let promises = members.is_above_at(simd, span, bounds.middle(), plan.density, 2.0 * plan.density.isovalue);
        let is_full = promises && members.is_fluid(simd, span, bounds, plan.density);
        return if is_full { Crossed::Nowhere { is_full } } else { Crossed::Within(*bounds) };
    }
    let ranges = members.density_ranges(simd, span, bounds, plan.density);
    if ranges.iter().all(|range| plan.density.is_above(*range)) {
        return Crossed::Nowhere { is_full: true };
    }
    let left = (0..EIGHTHS).filter(|eighth| !plan.density.is_below(ranges[*eighth]));
    let left = left.fold(Bounds::EMPTY, |left, eighth| left.union(&bounds.eighth(eighth)));
    if left.is_empty() { Crossed::Nowhere { is_full: false } } else { Crossed::Within(left) }
}

/// The box of a node: its part of the parent's box, as far as its balls make a surface there; none where they make none.
#[inline(always)]
fn fitted_bounds<S: Simd>(simd: S, plan: &Plan, members: &Members, cell: &Cell) -> Option<Bounds> {
    let mut share = 1.0;
    if plan.options.tightens {
        share = plan.density.reach(members.positive_weight(simd, cell.span))?;
    }
    let [own, _] = Members::split(cell.span, cell.own);
    let bounds = match plan.options.hierarchy {
        Hierarchy::Fitted if !plan.options.fits => cell.bounds,
        Hierarchy::Fitted => cell.bounds.intersection(&members.bounds(simd, own, share)),
        Hierarchy::Overlapping => members.bounds(simd, own, share),
    };
    (!bounds.is_empty()).then_some(bounds)
}

/// The children of a cell, none where it is best a leaf.
#[inline(always)]
fn divide<S: Simd>(simd: S, plan: &Plan, members: &mut Members, cell: &Cell) -> Result<Option<[Cell; 2]>> {
    match plan.options.hierarchy {
        _ if cell.depth == MAX_DEPTH => Ok(None),
        Hierarchy::Fitted => divide_space(simd, members, cell),
        Hierarchy::Overlapping => divide_balls(simd, members, cell),
    }
}

/// Cuts the box by a plane; each ball goes to every part that it touches.
#[inline(always)]
fn divide_space<S: Simd>(simd: S, members: &mut Members, cell: &Cell) -> Result<Option<[Cell; 2]>> {
    let Some(Plane { axis, at }) = plane_through(simd, members, cell) else {
        return Ok(None);
    };
    let [left, right] = cell.bounds.cut(axis, at);
    let right = child_in_box(simd, members, cell, right)?;
    Ok(Some([child_in_box(simd, members, cell, left)?, right]))
}

#[inline(always)]
fn child_in_box<S: Simd>(simd: S, members: &mut Members, parent: &Cell, bounds: Bounds) -> Result<Cell> {
    let span = members.append_where(simd, parent.span, &Touches(BoxLanes::new(simd, &bounds)))?;
    Ok(Cell { span, own: span.count, bounds, depth: parent.depth + 1 })
}

/// Parts the node's own balls by their centres; the others go to every part whose balls' box they touch.
#[inline(always)]
fn divide_balls<S: Simd>(simd: S, members: &mut Members, cell: &Cell) -> Result<Option<[Cell; 2]>> {
    let [own, split] = Members::split(cell.span, cell.own);
    let Some(Plane { axis, at }) = plane_between_centers(members, own) else {
        return Ok(None);
    };
    let below = CentreBelow { axis, plane: simd.splat(at) };
    let right = child_of_balls(simd, members, [own, split], &Fails(below), cell.depth)?;
    let left = child_of_balls(simd, members, [own, split], &below, cell.depth)?;
    Ok(Some([left, right]))
}

#[inline(always)]
fn child_of_balls<S: Simd, T: Test<S>>(
    simd: S,
    members: &mut Members,
    [own, split]: [Span; 2],
    belongs: &T,
    depth: usize,
) -> Result<Cell> {
    let mine = members.append_where(simd, own, belongs)?;
    let bounds = members.bounds(simd, mine, 1.0);
    let touches = Touches(BoxLanes::new(simd, &bounds));
    let theirs = members.append_where(simd, own, &And(Fails(belongs), touches))?;
    let reaching = members.append_where(simd, split, &touches)?;
    let span = Members::joined(Members::joined(mine, theirs), reaching);
    Ok(Cell { span, own: mine.count, bounds, depth: depth + 1 })
}

/// Writes the balls that touch the box of a leaf, and its node.
#[inline(always)]
fn push_leaf<S: Simd>(simd: S, plan: &Plan, members: &mut Members, leaf: &Cell, tree: &mut Tree) -> Result<()> {
    let touching = members.append_where(simd, leaf.span, &Touches(BoxLanes::new(simd, &leaf.bounds)))?;
    let first = tree.ids.len();
    let packets = touching.count.div_ceil(LANES);
    memory::reserve(&mut tree.ids, packets * LANES)?;
    memory::reserve(&mut tree.packets, packets)?;
    let kept = contributors(plan, members, touching, &leaf.bounds);
    for ball in (0..touching.count).filter(|index| kept.keeps(*index)).map(|index| members.get(touching, index)) {
        push_ball(tree, &ball);
    }
    let count = tree.ids.len() - first;
    tree.ids.resize(tree.packets.len() * LANES, NO_BALL);
    tree.nodes.push(match count {
        0 => Node::new(&Bounds::EMPTY, Kind::Empty),
        _ => Node::new(&leaf.bounds, Kind::Leaf { first, count }),
    });
    Ok(())
}

fn push_ball(tree: &mut Tree, ball: &Member) {
    let lane = tree.ids.len() % LANES;
    if lane == 0 {
        tree.packets.push(Packet::NONE);
    }
    tree.ids.push(ball.id);
    if let Some(packet) = tree.packets.last_mut() {
        packet.set(lane, ball);
    }
}
