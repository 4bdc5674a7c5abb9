//! Surface particles: points that live on the surface of the fluid, spread evenly over it and move with it (van Kooten, van den
//! Bergen and Telea 2007).
//!
//! The paper's particles are placed once, so that liquid which parts from the rest has none. Here points all over the surface
//! are looked at in each frame ([`probes`]), and what no particle is near gets some: those that have lost their place, else
//! those of the densest places.

mod crowd;
pub mod discs;
mod fluid;
mod hash;
mod levels;
mod probes;
mod scatter;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use crate::balls::Balls;
use crate::error::{Error, Result};
use crate::field::Field;
use crate::job::Job;
use crate::memory;
use crate::tracing::random::{any_direction, branch, mixed};
use crate::vectors::{difference, dot, double, plus, single, unit};

use self::crowd::{Crowd, Pressure};
pub use self::fluid::SurfacePoint;
use self::fluid::{Fluid, Sample};
pub use self::hash::{Entry, Level};
use self::probes::{exposed_area, probes};
use self::scatter::{apart, evenly, scattered};

/// Particles at most.
pub const MOST: usize = 1 << 24;

/// Steps of repulsion in a frame at most.
const MOST_STEPS: usize = 1000;

/// How far a particle pushes others, as a share of the distance between neighbours of an even spread: beyond the six nearest.
const REACH: f64 = 2.2;

/// How far pressure moves a particle in a step, in reaches. An even spread is stable up to 0.2: by linear theory the push of
/// twelve neighbours rises by 4.6 a reach, twice that for the stiffest wave.
const PUSH: f64 = 0.1;

/// Repulsion and the way back to the surface move a particle at most so far in a step, in reaches and in influence radii: explicit
/// steps stay stable so.
const LONGEST_STEP: f64 = 0.25;

/// One of so many particles may change its place in a step.
const DISPERSING: u32 = 8;

/// A particle changes its place for one whose density is less by more than this (equations 9 to 12): leaving lessens the
/// density here by that of its own centre, 1, and its coming changes nothing there, since it comes to the rim. So the difference
/// d becomes d - 1, which is less than before where d > 1/2.
const DISPERSION_THRESHOLD: f64 = 0.5;

/// The distance between neighbours where their number is left to the surface, in influence radii: a lone ball of Wyvill's kernel has
/// fifty then, and hardly a pixel is not covered.
const FREE_SPACING: f64 = 0.35;

/// Where as many are left to the surface, those are taken away that are this many times too many.
const TOO_DENSE: f64 = 1.15;

/// What has no particle within so many reaches gets one; the widest gap of an even spread is a quarter.
const GAP: f64 = 0.6;

/// Those that are put into a gap are so far apart, in reaches: random ones are as dense then as an even spread.
const GAP_SPACING: f64 = 0.4;

/// Points that are looked at for gaps are so far apart, in reaches.
const PROBE_SPACING: f64 = 0.3;

/// Probes for each particle from which the first are chosen.
const PROBES_A_PARTICLE: f64 = 4.0;

/// How the particles behave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How many there are at most, up to `MOST`; 0 for as many as the surface asks for.
    pub count: usize,
    /// The side of the spatial hash's cells as a share of a ball's diameter (the paper: a third to a fifth).
    pub cell_share: f64,
    /// Steps of repulsion in each frame.
    pub steps: usize,
    /// Whether particles also leave dense places for thin ones.
    pub disperses: bool,
    /// Whether places without particles get some at once.
    pub fills_gaps: bool,
    /// Another number, another spread.
    pub seed: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self { count: 0, cell_share: 1.0 / 3.0, steps: 4, disperses: true, fills_gaps: true, seed: 0 }
    }
}

/// What happened in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Particles that lost the surface.
    pub lost: usize,
    /// Particles that were placed anew.
    pub placed: usize,
    /// Particles that left a dense place for a thin one.
    pub dispersed: usize,
}

/// A particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Particle {
    /// World space.
    pub position: [f32; 3],
    /// Unit, out of the fluid.
    pub normal: [f32; 3],
    /// Of the surface there, units a second.
    pub velocity: [f32; 3],
    /// How large the balls are there: the mean of their influence radii.
    pub scale: f32,
    /// The distance to its neighbours if they were spread evenly as densely as they are here.
    pub spacing: f32,
    /// Stays with it until it is placed anew.
    pub id: u32,
}

/// Particles that follow a fluid from frame to frame.
#[derive(Debug)]
pub struct SurfaceParticles {
    options: Options,
    fluid: Option<Fluid>,
    particles: Vec<Particle>,
    /// h, in influence radii.
    reach: f64,
    next_id: u32,
    step: u32,
}

impl SurfaceParticles {
    /// No particles yet.
    ///
    /// # Errors
    /// `InvalidInput` where an option is out of its range.
    pub fn new(options: Options) -> Result<Self> {
        if options.count > MOST {
            return Err(Error::InvalidInput(format!("there can be at most {MOST} surface particles, not {}", options.count)));
        }
        if !(0.05..=1.0).contains(&options.cell_share) {
            return Err(Error::InvalidInput(format!("the cell size must be 0.05 to 1 diameters, not {}", options.cell_share)));
        }
        if options.steps > MOST_STEPS {
            return Err(Error::InvalidInput(format!("there can be 0 to {MOST_STEPS} steps in a frame, not {}", options.steps)));
        }
        Ok(Self { options, fluid: None, particles: Vec::new(), reach: 0.0, next_id: 0, step: 0 })
    }

    /// The particles, in no order.
    pub fn particles(&self) -> &[Particle] {
        &self.particles
    }

    /// Places all particles anew on the surface of these balls, all over it.
    ///
    /// # Errors
    /// `InvalidInput` where velocities are not one finite vector for each ball; `OutOfMemory`; `Cancelled`. The particles are
    /// gone then.
    pub fn seed(&mut self, balls: &Balls<'_>, velocities: Option<&[[f32; 3]]>, field: Field, job: &Job) -> Result<Report> {
        let fluid = self.started(balls, velocities, field)?;
        let points = self.first_points(&fluid, job)?;
        self.add(&points)?;
        let placed = self.particles.len();
        self.finish_frame(fluid, Report { placed, ..Report::default() }, job)
    }

    /// Places particles at given points, `count` of them at most, and moves them onto the surface; those for which that fails
    /// are left out.
    ///
    /// # Errors
    /// Those of [`Self::seed`].
    pub fn seed_at(
        &mut self,
        points: &[[f32; 3]],
        balls: &Balls<'_>,
        velocities: Option<&[[f32; 3]]>,
        field: Field,
        job: &Job,
    ) -> Result<Report> {
        let fluid = self.started(balls, velocities, field)?;
        let points = points.iter().take(self.most());
        let places: Vec<SurfacePoint> = points.filter_map(|point| fluid.projected(double(*point))).collect();
        // How far apart they will be in the end.
        self.first_points(&fluid, job)?;
        self.add(&places)?;
        self.finish_frame(fluid, Report { placed: places.len(), ..Report::default() }, job)
    }

    /// The balls, to begin anew on.
    fn started(&mut self, balls: &Balls<'_>, velocities: Option<&[[f32; 3]]>, field: Field) -> Result<Fluid> {
        self.particles.clear();
        self.fluid = None;
        Fluid::new(balls, velocities, field, self.options.cell_share)
    }

    /// Follows the fluid of the frame before to these balls, some seconds later; earlier where these are negative.
    ///
    /// # Errors
    /// Those of [`Self::seed`].
    pub fn follow(
        &mut self,
        balls: &Balls<'_>,
        velocities: Option<&[[f32; 3]]>,
        field: Field,
        seconds: f64,
        job: &Job,
    ) -> Result<Report> {
        let Some(before) = self.fluid.take().filter(|_| !self.particles.is_empty()) else {
            return self.seed(balls, velocities, field, job);
        };
        self.flow(&before, seconds);
        drop(before);
        let fluid = Fluid::new(balls, velocities, field, self.options.cell_share)?;
        let mut report = Report { lost: self.project(&fluid), ..Report::default() };
        if self.options.fills_gaps {
            report.placed = self.fill_gaps(&fluid, job)?;
        }
        self.finish_frame(fluid, report, job)
    }

    /// Moves the particles with the balls of the frame before (equations 2 and 3). With the balls around it a particle goes as
    /// far as these; only what keeps it on a surface that changes its shape is bounded.
    fn flow(&mut self, fluid: &Fluid, seconds: f64) {
        self.particles.par_iter_mut().for_each(|particle| {
            let position = double(particle.position);
            let sample = fluid.sample(position);
            let velocity = sample.constrained(sample.velocity, fluid.field().isovalue, 0.0);
            let correction = difference(velocity, sample.velocity).map(|c| c * seconds);
            let moved = plus(position, seconds, sample.velocity);
            particle.position = single(plus(moved, 1.0, within(correction, sample.scale)));
        });
    }

    /// Makes these balls those that particles are to be on, which are moved elsewhere.
    ///
    /// # Errors
    /// Those of [`Self::seed`].
    pub fn stand_on(&mut self, balls: &Balls<'_>, velocities: Option<&[[f32; 3]]>, field: Field) -> Result<()> {
        self.fluid = Some(Fluid::new(balls, velocities, field, self.options.cell_share)?);
        Ok(())
    }

    /// Which of the balls reach a point; nothing where there are no balls yet.
    pub fn levels(&self) -> &[Level] {
        self.fluid.as_ref().map_or(&[], |fluid| fluid.hash().levels())
    }

    /// Takes particles that are on the present balls in place of its own, and fills the gaps between them; `reach` and `step`
    /// become its own. Says how many were placed; these are behind the others.
    ///
    /// # Errors
    /// `OutOfMemory`; `Cancelled`.
    pub fn refill(
        &mut self,
        places: impl ExactSizeIterator<Item = SurfacePoint>,
        reach: f64,
        step: u32,
        job: &Job,
    ) -> Result<usize> {
        let Some(fluid) = self.fluid.take() else { return Ok(0) };
        (self.reach, self.step) = (reach, step.wrapping_sub(1));
        self.particles.clear();
        let places: Vec<SurfacePoint> = places.collect();
        self.add(&places)?;
        let placed = if self.options.fills_gaps { self.fill_gaps(&fluid, job)? } else { 0 };
        self.fluid = Some(fluid);
        Ok(placed)
    }

    /// h, how far particles push one another, in influence radii.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Moves the particles onto the surface; those for which that fails are gone. How many.
    fn project(&mut self, fluid: &Fluid) -> usize {
        let before = self.particles.len();
        let moved = self.particles.par_iter().filter_map(|particle| on(fluid, *particle, double(particle.position)));
        self.particles = moved.collect();
        before - self.particles.len()
    }

    /// Particles at most.
    fn most(&self) -> usize {
        if self.options.count == 0 { MOST } else { self.options.count }
    }

    /// Places for particles on a surface that has none.
    fn first_points(&mut self, fluid: &Fluid, job: &Job) -> Result<Vec<SurfacePoint>> {
        let seed = branch(self.options.seed, self.step);
        if self.options.count == 0 {
            self.reach = REACH * FREE_SPACING;
            let points = probes(fluid, FREE_SPACING / PROBES_A_PARTICLE.sqrt(), |_| true, mixed(seed), job)?;
            return evenly(&points, FREE_SPACING, MOST, seed);
        }
        let area = exposed_area(fluid, self.options.seed)?;
        if area == 0.0 {
            return Ok(Vec::new());
        }
        let spacing = (area / (PROBES_A_PARTICLE * self.options.count as f64)).sqrt();
        let points = probes(fluid, spacing, |_| true, mixed(seed), job)?;
        let (chosen, distance) = scattered(&points, &[], self.options.count, even_distance(area, self.options.count), seed)?;
        self.reach = REACH * distance;
        Ok(chosen)
    }

    /// Puts particles where there is none nearby, and takes them from the densest places where there are no others. How many.
    fn fill_gaps(&mut self, fluid: &Fluid, job: &Job) -> Result<usize> {
        self.step = self.step.wrapping_add(1);
        let crowd = self.crowd()?;
        let is_bare = |point: &SurfacePoint| !crowd.is_near(point, GAP);
        let seed = branch(self.options.seed, self.step);
        let has_spare = self.options.count > self.particles.len();
        let points = probes(fluid, PROBE_SPACING * self.reach, |point| has_spare || is_bare(point), seed, job)?;
        let bare: Vec<SurfacePoint> = points.par_iter().filter(|point| is_bare(point)).copied().collect();
        let chosen = apart(&bare, GAP_SPACING * self.reach, self.most())?;
        let surplus = self.surplus(&crowd)?.max((chosen.len() + self.particles.len()).saturating_sub(self.most()));
        if surplus > 0 {
            self.remove_densest(&crowd, surplus)?;
        }
        self.add(&chosen)?;
        Ok(chosen.len() + self.place_spare(&points)?)
    }

    /// How many particles are too many for the surface, where it says how many there are.
    fn surplus(&self, crowd: &Crowd) -> Result<usize> {
        if self.options.count > 0 || self.particles.is_empty() {
            return Ok(0);
        }
        let excess = (mean_count(&self.pressures(crowd)?) + 1.0) / even_count(REACH);
        Ok(if excess > TOO_DENSE { (self.particles.len() as f64 * (1.0 - 1.0 / excess)) as usize } else { 0 })
    }

    /// Puts particles that have no place between the others. How many.
    fn place_spare(&mut self, points: &[SurfacePoint]) -> Result<usize> {
        let spare = self.options.count.saturating_sub(self.particles.len());
        if spare == 0 {
            return Ok(0);
        }
        let taken = self.places()?;
        let (chosen, _) = scattered(points, &taken, spare, GAP_SPACING * self.reach, branch(self.options.seed, self.step))?;
        self.add(&chosen)?;
        Ok(chosen.len())
    }

    fn remove_densest(&mut self, crowd: &Crowd, count: usize) -> Result<()> {
        let pressures = self.pressures(crowd)?;
        let mut order: Vec<usize> = (0..self.particles.len()).collect();
        order.sort_by(|one, other| pressures[*other].density.total_cmp(&pressures[*one].density));
        order.truncate(count);
        order.sort_unstable();
        order.into_iter().rev().for_each(|particle| {
            self.particles.swap_remove(particle);
        });
        Ok(())
    }

    /// Adds particles on points of the surface.
    fn add(&mut self, points: &[SurfacePoint]) -> Result<()> {
        memory::reserve(&mut self.particles, points.len())?;
        for point in points {
            let id = self.next_id;
            self.next_id = id.wrapping_add(1);
            let (position, normal, scale) = (single(point.position), single(point.normal), point.scale as f32);
            self.particles.push(Particle { position, normal, velocity: [0.0; 3], scale, spacing: 0.0, id });
        }
        Ok(())
    }

    /// Spreads the particles, and notes what they show.
    fn finish_frame(&mut self, fluid: Fluid, mut report: Report, job: &Job) -> Result<Report> {
        job.expect(self.options.steps);
        if self.options.fills_gaps && self.options.steps > 0 && self.options.count > 0 {
            self.adapt_reach()?;
        }
        for _ in 0..self.options.steps {
            report.dispersed += self.spread(&fluid)?;
            job.advance(1)?;
        }
        if !self.particles.is_empty() {
            let pressures = self.pressures(&self.crowd()?)?;
            let reach = self.reach;
            self.particles.par_iter_mut().zip(&pressures).for_each(|(particle, pressure)| {
                let sample = fluid.sample(double(particle.position));
                particle.velocity = single(sample.constrained(sample.velocity, fluid.field().isovalue, 0.0));
                particle.spacing = even_spacing(pressure.count as f64 + 1.0, reach) as f32 * particle.scale;
            });
        }
        self.fluid = Some(fluid);
        Ok(report)
    }

    /// A step of repulsion and dispersion on a fluid that stands still. How many particles changed their places.
    fn spread(&mut self, fluid: &Fluid) -> Result<usize> {
        if self.particles.is_empty() {
            return Ok(0);
        }
        self.step = self.step.wrapping_add(1);
        let pressures = self.pressures(&self.crowd()?)?;
        let (step, reach) = (branch(self.options.seed, self.step), self.reach);
        let moved = self.particles.par_iter().enumerate().map(|(index, particle)| {
            let target = if self.options.disperses { thinner(step, index, &pressures) } else { None };
            if let Some(target) = target {
                let other = place(&self.particles[target]);
                let direction = any_direction(branch(step, index as u32));
                let tangent = unit(plus(direction, -dot(direction, other.normal), other.normal));
                if let Some(moved) = on(fluid, *particle, plus(other.position, reach * other.scale, tangent)) {
                    return (Some(moved), true);
                }
            }
            (on(fluid, *particle, pushed(fluid, particle, &pressures[index], reach)), false)
        });
        let moved: Vec<(Option<Particle>, bool)> = moved.collect();
        self.particles.clear();
        let mut dispersed = 0;
        for (particle, is_elsewhere) in moved {
            let Some(mut particle) = particle else { continue };
            if is_elsewhere {
                dispersed += 1;
                particle.id = self.next_id;
                self.next_id = self.next_id.wrapping_add(1);
            }
            self.particles.push(particle);
        }
        Ok(dispersed)
    }

    fn adapt_reach(&mut self) -> Result<()> {
        if !self.particles.is_empty() {
            let pressures = self.pressures(&self.crowd()?)?;
            self.reach = adapted_reach(mean_count(&pressures), self.reach);
        }
        Ok(())
    }

    fn crowd(&self) -> Result<Crowd> {
        Crowd::new(&self.places()?, self.reach)
    }

    fn pressures(&self, crowd: &Crowd) -> Result<Vec<Pressure>> {
        crowd.pressures(&self.places()?)
    }

    /// Where the particles are.
    fn places(&self) -> Result<Vec<SurfacePoint>> {
        let mut places = memory::with_capacity(self.particles.len())?;
        places.extend(self.particles.iter().map(place));
        Ok(places)
    }
}

/// Where a particle is.
fn place(particle: &Particle) -> SurfacePoint {
    SurfacePoint { position: double(particle.position), normal: double(particle.normal), scale: f64::from(particle.scale) }
}

/// How many others a particle has within its reach, on average.
fn mean_count(pressures: &[Pressure]) -> f64 {
    pressures.iter().map(|pressure| pressure.count as f64).sum::<f64>() / pressures.len() as f64
}

/// Points of a hexagonal lattice within a circle, whose radius is given in distances between neighbours.
fn even_count(radius: f64) -> f64 {
    2.0 * std::f64::consts::PI / 3f64.sqrt() * radius * radius
}

/// The reach that an even spread of as many particles over as much surface would have, or nearer to it; `company` is how many
/// others are within the present reach, on average.
pub fn adapted_reach(company: f64, reach: f64) -> f64 {
    (REACH * even_spacing(company + 1.0, reach)).clamp(0.8 * reach, 1.25 * reach)
}

/// A place of the surface where a particle has less company, if it should go there in this step (section 7.4).
fn thinner(step: u32, index: usize, pressures: &[Pressure]) -> Option<usize> {
    let number = branch(step, index as u32);
    if !number.is_multiple_of(DISPERSING) {
        return None;
    }
    let other = mixed(number) as usize % pressures.len();
    (pressures[index].density - pressures[other].density > DISPERSION_THRESHOLD).then_some(other)
}

/// Where a particle goes that is pushed by others for a step in time that is as long as its feedback (equations 2 and 8).
fn pushed(fluid: &Fluid, particle: &Particle, pressure: &Pressure, reach: f64) -> [f64; 3] {
    let position = double(particle.position);
    let sample = Sample { rate: 0.0, ..fluid.sample(position) };
    let reach = reach * f64::from(particle.scale);
    let desired = within(pressure.force.map(|c| PUSH * reach * c), reach);
    plus(position, 1.0, within(sample.constrained(desired, fluid.field().isovalue, 1.0), sample.scale))
}

/// The particle moved onto the surface near a point.
fn on(fluid: &Fluid, particle: Particle, point: [f64; 3]) -> Option<Particle> {
    let place = fluid.projected(point)?;
    let (position, normal, scale) = (single(place.position), single(place.normal), place.scale as f32);
    Some(Particle { position, normal, scale, ..particle })
}

/// A motion that is not too long for a length.
fn within(motion: [f64; 3], length: f64) -> [f64; 3] {
    let longest = LONGEST_STEP * length;
    let squared = dot(motion, motion);
    if squared > longest * longest { motion.map(|c| c * longest / squared.sqrt()) } else { motion }
}

/// The distance between neighbours of a hexagonal lattice that has so many points within a circle.
fn even_spacing(count: f64, radius: f64) -> f64 {
    radius * (even_count(1.0) / count).sqrt()
}

/// The distance between neighbours of a hexagonal lattice of so many points on so much surface.
fn even_distance(area: f64, count: usize) -> f64 {
    (2.0 * area / (3f64.sqrt() * count as f64)).sqrt()
}
