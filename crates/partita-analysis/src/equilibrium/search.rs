//! Search of an equilibrium by steps on the closed loops: Newton's method, or down the potential.

use super::deflation::deflation;
use super::forces::{failed, travel, Curvatures, Here, Rest};
use crate::error::AnalysisError;
use partita_math::dense::{self, Matrix};
use partita_math::factor;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::manifold::kept_rows::close_kept;
use partita_system::start;
use partita_system::system::Varied;
use partita_system::{ConstrainedSystem, SystemError, SystemRef};

/// Longest step towards an equilibrium. Unit: characteristic displacement. Reason: forces may differ beyond it.
const LONGEST_STEP: f64 = 0.2;
/// Steps before the search ends. Reason: thirty turns at the longest step.
const MOST_STEPS: usize = 1000;
/// Steps before the search for another equilibrium than the known ones ends. Reason: a few turns; beside known positions
/// most searches lead nowhere.
const MOST_STEPS_BESIDE: usize = 100;
/// Steps without a gain before Newton's method ends: it creeps towards a position in which forces are least, not zero, at a
/// force that sets in. Where it turns by the longest steps, this many are half a turn and more.
const STALLED_STEPS: usize = 20;
/// Forces that become smaller by less have gained nothing. Scale: fraction of the deflated forces. Reason: a digit would
/// take two hundred such gains.
const STALLED_GAIN: f64 = 1e-2;
/// Halvings of a step before the search ends. Reason: the step is then rounding.
const MOST_HALVINGS: usize = 40;
/// Likewise beside known positions. Reason: searches that find another one take full steps; others come to rest where
/// the deflated forces are least, not zero.
const MOST_HALVINGS_BESIDE: usize = 8;

/// Part of the expected gain that a step must bring. Scale: fraction of the gain of first order. Reason: the usual one of
/// line searches.
const SUFFICIENT: f64 = 1e-4;
/// First step off an equilibrium that is not the wanted one. Unit: characteristic displacement. Reason: its forces
/// exceed rounding by far.
const OFF: f64 = 0.05;

/// A position where the mechanism stays at rest.
pub struct Equilibrium {
    /// Coordinates.
    pub q: Vec<f64>,
    /// λ.
    pub multipliers: Vec<f64>,
    /// Independent velocities.
    pub independent: Vec<usize>,
    /// K_d (k x k).
    pub stiffness: Matrix,
    /// Eigenvalues of K_d in the natural metric, ascending: real parts where it is not symmetric.
    pub curvatures: Vec<f64>,
    /// Whether K_d is symmetric.
    pub symmetric: bool,
    /// Steps.
    pub iterations: usize,
}

/// A search on the manifold of closed positions.
struct Search<'k, 's, S: ConstrainedSystem + Varied> {
    rest: Rest<'s, S>,
    stable: bool,
    /// Positions that are not wanted.
    known: &'k [Vec<f64>],
}

/// A step in independent displacements, and the curvatures on which it depends.
struct Step {
    z: Vec<f64>,
    curvatures: Curvatures,
    /// Along the least curvature, where that is negative.
    descent: Option<Vec<f64>>,
}

impl<S: ConstrainedSystem + Varied> Search<'_, '_, S> {
    /// The step of Newton's method from here; where a minimum is sought, one that goes down.
    fn step(&self, here: &Here) -> Result<Step, AnalysisError> {
        let k = here.force.len();
        let found = here.curvatures()?;
        let mut force = here.force.clone();
        here.forward(&mut force);
        let small = tolerance::SOLUTION_ROUNDING.sqrt() * found.largest;
        let (curvature_noise, force_noise) = (tolerance::SOLUTION_ROUNDING * found.largest, here.noise(&found));
        let mut z = if found.symmetric || self.stable {
            let mut z = vec![0.0; k];
            for (j, value) in found.values.iter().enumerate() {
                let along: f64 = (0..k).map(|i| found.vectors[(i, j)] * force[i]).sum();
                // down the potential along directions of negative curvature, nowhere along indifferent ones; beside a
                // stiff direction a soft one looks indifferent, but a force along it is left
                let curvature = if self.stable { value.abs() } else { *value };
                let by = if curvature.abs() > small || (curvature.abs() > curvature_noise && along.abs() > force_noise)
                {
                    along / curvature
                } else if along.abs() > force_noise {
                    along.signum() * LONGEST_STEP
                } else {
                    0.0
                };
                (0..k).for_each(|i| z[i] += found.vectors[(i, j)] * by);
            }
            z
        } else {
            factor::solve_dense(&found.natural, &force).map_err(|e| failed(&e))?
        };
        here.backward(&mut z);
        let descent = found.values.first().filter(|x| **x < -small).map(|_| {
            let mut along: Vec<f64> = (0..k).map(|i| OFF * found.vectors[(i, 0)]).collect();
            here.backward(&mut along);
            along
        });
        Ok(Step { z, curvatures: found, descent })
    }

    /// η and the factor of steps beside known positions.
    fn beside(&self, q: &[f64], here: &Here, z: &[f64]) -> (f64, f64) {
        if self.known.is_empty() {
            return (1.0, 1.0);
        }
        let k = z.len();
        let by: Vec<f64> = here
            .dt
            .chunks_exact(k)
            .zip(&self.rest.displacement)
            .map(|(row, displacement)| dense::dot(row, z) / displacement)
            .collect();
        let (eta, slope) = deflation(&*self.rest.reduction.system, q, self.known, &by);
        (eta, 1.0 / (1.0 - slope))
    }

    /// The position a part of a step on, if it closes and is better; `eta` is that of the present one.
    fn moved(
        &mut self,
        (q, eta): (&[f64], f64),
        here: &Here,
        z: &[f64],
        part: f64,
    ) -> Result<Option<(Vec<f64>, Here)>, AnalysisError> {
        let r = &mut self.rest.reduction;
        let (t, k, n) = (self.rest.t, z.len(), r.size().nv);
        let dv: Vec<f64> = (0..n).map(|l| part * dense::dot(&here.dt[l * k..(l + 1) * k], z)).collect();
        let mut next = q.to_vec();
        r.system.step(&mut next, &dv);
        match close_kept(r, t, &mut next) {
            Ok(closed) if closed.is_closed() => {}
            Ok(_) | Err(SystemError::Singular { .. }) => {
                start::choose_partition(r, t, q, None, None)?;
                return Ok(None);
            }
            Err(e) => return Err(e.into()),
        }
        let there = match self.rest.look(&next) {
            Ok(there) => there,
            Err(AnalysisError::System(SystemError::Singular { .. })) => return Ok(None),
            Err(e) => return Err(e),
        };
        let better = if self.stable {
            // mean work of the forces along the way: downhill
            let ahead: f64 = there.force.iter().zip(&there.independent).map(|(f, &i)| f * dv[i]).sum();
            let before: f64 = here.force.iter().zip(&here.independent).map(|(f, &i)| f * dv[i]).sum();
            let mean = 0.5 * (before + ahead);
            mean >= SUFFICIENT * before
        } else {
            self.beside(&next, &there, &vec![0.0; there.force.len()]).0 * there.size
                <= eta * here.size * (1.0 - SUFFICIENT * part)
        };
        let rounding = travel(&here.dt, &self.rest.displacement, z) <= tolerance::CLOSED_IN_RUN;
        Ok((better || rounding).then_some((next, there)))
    }
}

fn finished(q: Vec<f64>, here: Here, found: Curvatures, iterations: usize) -> Equilibrium {
    Equilibrium {
        q,
        multipliers: here.multipliers,
        independent: here.independent,
        stiffness: here.stiffness,
        curvatures: found.values,
        symmetric: found.symmetric,
        iterations,
    }
}

/// What is known of the closed position q as one of rest, without a search.
///
/// # Errors
/// Singular positions.
pub fn describe(model: &Model, t: f64, q: &[f64]) -> Result<Equilibrium, AnalysisError> {
    let system = SystemRef::from(model);
    let rank = start::analyse(&*system, t, q)?.rank;
    let mut rest = Rest::new(system, rank, t);
    let here = rest.look(q)?;
    let found = here.curvatures()?;
    Ok(finished(q.to_vec(), here, found, 0))
}

/// The equilibrium that a search from the closed position q arrives at; with `stable` it goes down the potential, never
/// to a saddle, and it does so too where Newton's method arrives nowhere. Positions that are `known` are not found
/// again, where it does not go down.
///
/// # Errors
/// Singular positions, drives that move, a search that arrives nowhere.
pub fn equilibrium(
    model: &Model,
    t: f64,
    q: &[f64],
    stable: bool,
    known: &[Vec<f64>],
) -> Result<Equilibrium, AnalysisError> {
    match search(model, t, q, stable, known) {
        // a stop, or another force that sets in: the forces before it lead away from the equilibrium behind it
        Err(e @ AnalysisError::Argument { argument: "near", .. }) if !stable && known.is_empty() => {
            search(model, t, q, true, known).map_err(|_| e)
        }
        found => found,
    }
}

fn search(model: &Model, t: f64, q: &[f64], stable: bool, known: &[Vec<f64>]) -> Result<Equilibrium, AnalysisError> {
    let system = SystemRef::from(model);
    let rank = start::analyse(&*system, t, q)?.rank;
    let mut search = Search { rest: Rest::new(system.clone(), rank, t), stable, known };
    let displacement = search.rest.displacement.clone();
    let mut q = q.to_vec();
    let mut here = search.rest.look(&q)?;
    at_rest(&search.rest)?;
    let mut left = f64::INFINITY;
    let mut stalled = (0, f64::INFINITY);
    let (most, most_halvings) = match known.is_empty() {
        true => (MOST_STEPS, MOST_HALVINGS),
        false => (MOST_STEPS_BESIDE, MOST_HALVINGS_BESIDE),
    };
    for iterations in 0..most {
        let Step { mut z, curvatures, descent } = search.step(&here)?;
        let length = travel(&here.dt, &displacement, &z);
        // once steps are rounding, they do not shrink any more
        let arrived = here.rests()
            || length <= tolerance::CLOSED
            || (length < tolerance::CLOSED_IN_RUN && tolerance::DOUBLED * length > left);
        let off = if stable && arrived { descent } else { None };
        if arrived && off.is_none() {
            return Ok(finished(q, here, curvatures, iterations));
        }
        left = if off.is_some() { f64::INFINITY } else { length };
        z = off.unwrap_or(z);
        let (eta, by) = search.beside(&q, &here, &z);
        if !by.is_finite() || !eta.is_finite() {
            return Err(no_equilibrium(&*system, &here, &displacement, iterations));
        }
        if eta * here.size <= (1.0 - STALLED_GAIN) * stalled.1 {
            stalled = (iterations, eta * here.size);
        }
        if !stable && iterations > stalled.0 + STALLED_STEPS {
            return Err(no_equilibrium(&*system, &here, &displacement, iterations));
        }
        z.iter_mut().for_each(|x| *x *= by);
        let mut part = (LONGEST_STEP / travel(&here.dt, &displacement, &z)).min(1.0);
        let mut halvings = 0;
        loop {
            if let Some((next, there)) = search.moved((&q, eta), &here, &z, part)? {
                (q, here) = (next, there);
                break;
            }
            part *= 0.5;
            halvings += 1;
            if halvings > most_halvings {
                return Err(no_equilibrium(&*system, &here, &displacement, iterations));
            }
        }
    }
    Err(no_equilibrium(&*system, &here, &displacement, most))
}

/// Refuse drives that move.
fn at_rest<S: ConstrainedSystem + Varied>(rest: &Rest<S>) -> Result<(), AnalysisError> {
    let rate = |i: usize| (rest.reduction.at.gamma[i] / rest.displacement[i]).abs();
    let fastest = (0..rest.displacement.len()).max_by(|&a, &b| rate(a).total_cmp(&rate(b)));
    if let Some(i) = fastest.filter(|&i| rest.reduction.at.gamma[i] != 0.0) {
        let message = format!(
            "drives move at t = {} s: {} at {:.3e} per second; an equilibrium needs a time at which they rest",
            rest.t,
            rest.reduction.system.structure().velocities[i].name,
            rest.reduction.at.gamma[i]
        );
        return Err(AnalysisError::Argument { argument: "t", message });
    }
    let Some((i, growth)) = rest.accelerated() else { return Ok(()) };
    let message = format!(
        "drives rest at t = {} s, but accelerate: {} by {growth:.3e} per second squared; an equilibrium needs a time at \
         which they stay at rest",
        rest.t,
        rest.reduction.system.structure().velocities[i].name,
    );
    Err(AnalysisError::Argument { argument: "t", message })
}

fn no_equilibrium<S: ConstrainedSystem>(system: &S, here: &Here, displacement: &[f64], steps: usize) -> AnalysisError {
    let rest = here.most(displacement).map_or(String::new(), |(i, effort)| {
        format!("; there the effort {effort:.3e} along {} is left", system.structure().velocities[i].name)
    });
    let message = format!(
        "no equilibrium was found from here after {steps} steps{rest}; give another state near=..., or add what holds \
         the mechanism"
    );
    AnalysisError::Argument { argument: "near", message }
}
