//! Which balls are one liquid: the connected parts of the fluid, as Mueller, Grottel and Ertl 2007 colour them.
//!
//! Two balls are joined where the straight way between their centres lies within the fluid. Where their kernel spheres meet it
//! does, whatever else is there; only the ways between parts that are not joined yet are followed.

mod sets;
#[cfg(test)]
mod tests;
mod ways;

use rayon::prelude::*;

use crate::balls::Balls;
use crate::cells::Cells;
use crate::error::Result;
use crate::field::Field;
use crate::job::Job;
use crate::memory;

use self::sets::Sets;
use self::ways::Ways;

/// The number of a ball whose centre is not in the fluid.
pub const NONE: i32 = -1;

/// Balls that a thread looks at together.
const PART: usize = 1024;

/// The connected parts of a fluid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Clusters {
    /// The part that each ball belongs to, `NONE` where its centre is not in the fluid. Parts are numbered in the order of
    /// their first balls.
    pub labels: Vec<i32>,
    /// How many balls each part has.
    pub sizes: Vec<u32>,
}

/// Finds the connected parts of a fluid.
///
/// # Errors
/// `OutOfMemory`, `Cancelled`.
pub fn clusters(balls: &Balls, field: &Field, job: &Job) -> Result<Clusters> {
    let influence = Cells::new(balls.positions(), balls.radii())?;
    let kernels = kernel_radii(balls, field, &influence)?;
    let sets = Sets::new(balls.len())?;
    let kernel_cells = Cells::new(balls.positions(), &kernels)?;
    kernel_cells.for_pairs_within(job, |_, _| false, |one, other| sets.join(one, other))?;
    // Most cells are in one set by now: one pair that touches joins two of them.
    let roots = kernel_cells.common(|ball| sets.root(ball))?;
    let are_joined = |one: usize, other: usize| match (roots[one], roots[other]) {
        (Some(one), Some(other)) => sets.are_joined(one as usize, other as usize),
        _ => false,
    };
    kernel_cells.for_pairs_between(job, are_joined, |one, other| sets.join(one, other))?;
    let ways = Ways::new(balls, field, &influence);
    let mut is_wet = memory::filled(false, balls.len())?;
    is_wet.par_iter_mut().enumerate().for_each(|(ball, is_wet)| *is_wet = kernels[ball] > 0.0 || ways.begins_in_fluid(ball));
    let roots = influence.common(|ball| sets.root(ball))?;
    let is_one = |one: usize, other: usize| roots[one].is_some() && roots[one] == roots[other];
    let join = |one: usize, other: usize| {
        if is_wet[one] && is_wet[other] && !sets.are_joined(one, other) && ways.lies_in_fluid(one, other) {
            sets.join(one, other);
        }
    };
    influence.for_pairs_within(job, is_one, join)?;
    influence.for_pairs_between(job, is_one, join)?;
    labelled(&sets, &is_wet)
}

/// The radii of the kernel spheres that are surely within the fluid: 0 for those that a ball that carves reaches.
fn kernel_radii(balls: &Balls, field: &Field, influence: &Cells) -> Result<Vec<f32>> {
    let mut kernels = memory::filled(0.0f32, balls.len())?;
    kernels.par_chunks_mut(PART).zip(balls.weights().par_chunks(PART)).zip(balls.radii().par_chunks(PART)).for_each(
        |((kernels, weights), radii)| {
            let (mut weight, mut share) = (0.0, 0.0);
            for ((kernel, own_weight), radius) in kernels.iter_mut().zip(weights).zip(radii) {
                if *own_weight != weight {
                    (weight, share) = (*own_weight, field.kernel_radius_share(f64::from(*own_weight)) as f32);
                }
                *kernel = share * radius;
            }
        },
    );
    for (ball, _) in balls.weights().iter().enumerate().filter(|(_, weight)| **weight < 0.0) {
        let (center, radius) = (balls.positions()[ball].map(f64::from), f64::from(balls.radii()[ball]));
        influence.for_near(center.map(|c| c - radius), center.map(|c| c + radius), |other| kernels[other] = 0.0);
    }
    Ok(kernels)
}

fn labelled(sets: &Sets, is_wet: &[bool]) -> Result<Clusters> {
    let mut labels = memory::filled(NONE, is_wet.len())?;
    let mut sizes = Vec::new();
    for ball in (0..is_wet.len()).filter(|ball| is_wet[*ball]) {
        // The root of a set is its first ball.
        let root = sets.root(ball) as usize;
        if root == ball {
            memory::reserve(&mut sizes, 1)?;
            labels[ball] = sizes.len() as i32;
            sizes.push(0);
        }
        labels[ball] = labels[root];
        sizes[labels[root] as usize] += 1;
    }
    Ok(Clusters { labels, sizes })
}
