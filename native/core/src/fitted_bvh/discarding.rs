//! Drops balls of a leaf that touch no surface in it (Gourmel et al. 2010, section 5.3.2).

use super::bounds::Bounds;
use super::construction::Plan;
use super::members::{Member, Members, Span};

/// Larger leaves are left alone: the time goes with the square, and the more balls, the fewer are dropped.
const LIMIT: usize = 32;

/// Which balls of a leaf are needed.
pub struct Kept(u32);

impl Kept {
    /// Whether a ball is.
    pub fn keeps(&self, index: usize) -> bool {
        index >= LIMIT || self.0 >> index & 1 == 1
    }
}

/// The balls of a leaf that can touch a surface in its box.
///
/// Where the field reaches the isovalue, some ball of positive weight is nearer than `reach` times its radius. A ball
/// whose influence sphere meets no such core in the box adds to the field, or takes from it, only where the
/// others stay below the isovalue with and without it.
pub fn contributors(plan: &Plan, members: &Members, span: Span, bounds: &Bounds) -> Kept {
    if !plan.options.discards || span.count > LIMIT {
        return Kept(u32::MAX);
    }
    let balls: Vec<Member> = (0..span.count).map(|index| members.get(span, index)).collect();
    let Some(reach) = plan.density.reach(balls.iter().map(|ball| ball.weight.max(0.0)).sum()) else {
        return Kept(0);
    };
    let cores: Vec<&Member> =
        balls.iter().filter(|ball| ball.weight > 0.0 && touches(ball, reach * ball.radius, bounds)).collect();
    let is_needed =
        |ball: &Member| cores.iter().any(|core| distance_squared(ball, core) < (ball.radius + reach * core.radius).powi(2));
    Kept((0..balls.len()).filter(|index| is_needed(&balls[*index])).map(|index| 1 << index).sum())
}

fn touches(ball: &Member, radius: f32, bounds: &Bounds) -> bool {
    let outside = |axis: usize| {
        let center = ball.center[axis];
        (bounds.low[axis] - center).max(center - bounds.high[axis]).max(0.0)
    };
    (0..3).map(|axis| outside(axis).powi(2)).sum::<f32>() <= radius * radius
}

fn distance_squared(a: &Member, b: &Member) -> f32 {
    (0..3).map(|axis| (a.center[axis] - b.center[axis]).powi(2)).sum()
}
