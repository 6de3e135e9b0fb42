//! Positions at rest: the reduced forces vanish on the manifold of closed loops.
//!
//! ```text
//! h_d(z) = 0      K_d dz = h_d      K_d = D (−h − Cᵀ λ)_q Dᵀ      C_Dᵀ λ = (−h)_D
//! ```
//!
//! λ is that of rest, so K_d is the derivative of −h_d at any position, not only where it vanishes.

use crate::error::AnalysisError;
use partita_math::dense::{self, Matrix};
use partita_math::factor;
use partita_math::tolerance;
use partita_system::manifold::kept_rows::close_kept;
use partita_system::reduction::Reduction;
use partita_system::start;
use partita_system::system::{At, Changes, Directions, Varied};
use partita_system::{ConstrainedSystem, SystemError, SystemRef};

/// Longest step towards an equilibrium. Unit: characteristic displacement. Reason: forces may differ beyond it.
const LONGEST_STEP: f64 = 0.2;
/// Steps before the search ends. Reason: thirty turns at the longest step.
const MOST_STEPS: usize = 1000;
/// Halvings of a step before the search ends. Reason: the step is then rounding.
const MOST_HALVINGS: usize = 40;

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

/// Forces and stiffness at a position.
struct Here {
    force: Vec<f64>,
    /// Sums of the absolute forces that add up to `force`.
    pull: Vec<f64>,
    stiffness: Matrix,
    /// Dᵀ weighed by characteristic displacements: the natural metric (k x k).
    metric: Matrix,
    /// Size of the force in this metric.
    size: f64,
    multipliers: Vec<f64>,
    independent: Vec<usize>,
    dt: Vec<f64>,
}

/// A search on the manifold of closed positions.
struct Search<'s, S: ConstrainedSystem + Varied> {
    reduction: Reduction<'s, S>,
    t: f64,
    stable: bool,
    /// Characteristic displacement of each velocity.
    displacement: Vec<f64>,
}

/// A step in independent displacements, and the curvatures on which it depends.
struct Step {
    z: Vec<f64>,
    curvatures: Vec<f64>,
    symmetric: bool,
    /// Along the least curvature, where that is negative.
    descent: Option<Vec<f64>>,
}

/// Natural size of a vector z: its largest displacement, and the step that size allows.
fn travel(dt: &[f64], displacement: &[f64], z: &[f64]) -> f64 {
    let k = z.len();
    displacement.iter().enumerate().fold(0.0, |m: f64, (l, d)| m.max(dense::dot(&dt[l * k..(l + 1) * k], z).abs() / d))
}

impl<S: ConstrainedSystem + Varied> Search<'_, S> {
    /// Evaluate at q, with the best choice of coordinates there.
    fn look(&mut self, q: &[f64]) -> Result<Here, AnalysisError> {
        let (t, r) = (self.t, &mut self.reduction);
        start::choose_partition(r, t, q, None, None)?;
        let size = r.size();
        let (n, k) = (size.nv, r.k());
        let rest = vec![0.0; n];
        r.v.fill(0.0);
        r.velocity(t, q)?;
        let system = r.system.clone();
        let mut forces = vec![0.0; n];
        system.inverse_dynamics(t, q, &rest, &rest, &mut r.scratch, &mut forces)?;
        let (mut work, mut multipliers) = (vec![0.0; r.rank()], vec![0.0; size.rows]);
        r.multipliers_of(&forces, &mut work, &mut multipliers); // C_Dᵀ λ = (−h)_D
        let mut dq = vec![0.0; n * k];
        (0..n).for_each(|i| (0..k).for_each(|j| dq[j * n + i] = r.dt[i * k + j]));
        let none = vec![0.0; n * k];
        let mut changes = Changes::new(size.rows, n, k);
        let at = At { t, q, v: &rest, vdot: &rest, multipliers: &multipliers };
        system.vary(&at, &Directions { count: k, q: &dq, v: &none, vdot: &none }, &mut changes)?;
        let mut stiffness = Matrix::new(k, k);
        let mut metric = Matrix::new(k, k);
        let displacement = &self.displacement;
        for i in 0..k {
            for j in 0..k {
                let of = |l: usize| r.dt[l * k + i];
                stiffness[(i, j)] = (0..n).map(|l| of(l) * changes.forces[j * n + l]).sum();
                metric[(i, j)] = (0..n).map(|l| of(l) * r.dt[l * k + j] / displacement[l].powi(2)).sum();
            }
        }
        let sum = |f: &dyn Fn(f64) -> f64, i: usize| (0..n).map(|l| f(-r.dt[l * k + i] * forces[l])).sum::<f64>();
        let force: Vec<f64> = (0..k).map(|i| sum(&|x| x, i)).collect();
        let (mut l, mut along) = (metric.data().to_vec(), force.clone());
        dense::cholesky(&mut l, k).map_err(|e| SystemError::Mass {
            name: system.velocity_name(r.partition.independent[e.index]),
            pivot: e.pivot,
        })?;
        dense::cholesky_forward(&l, k, &mut along);
        Ok(Here {
            size: dense::dot(&along, &along).sqrt(),
            force,
            pull: (0..k).map(|i| sum(&f64::abs, i)).collect(),
            stiffness,
            metric,
            multipliers,
            independent: r.partition.independent.clone(),
            dt: r.dt.clone(),
        })
    }

    /// The step of Newton's method from here; where a minimum is sought, one that goes down.
    fn step(&self, here: &Here) -> Result<Step, AnalysisError> {
        let k = here.force.len();
        let mut l = here.metric.data().to_vec();
        dense::cholesky(&mut l, k).map_err(|e| SystemError::Mass {
            name: self.reduction.system.velocity_name(here.independent[e.index]),
            pivot: e.pivot,
        })?;
        // K in the natural metric
        let columns = |x: &Matrix| {
            let mut out = Matrix::new(k, k);
            for j in 0..k {
                let mut column: Vec<f64> = (0..k).map(|i| x[(i, j)]).collect();
                dense::cholesky_forward(&l, k, &mut column);
                (0..k).for_each(|i| out[(i, j)] = column[i]);
            }
            out
        };
        let natural = columns(&columns(&here.stiffness).transpose());
        let natural = natural.transpose();
        let largest = natural.data().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let skew = (0..k * k).fold(0.0, |m: f64, e| m.max((natural[(e / k, e % k)] - natural[(e % k, e / k)]).abs()));
        let symmetric = skew <= tolerance::CLOSED_IN_RUN * largest;
        let failed = |e: factor::FactorError| AnalysisError::Argument { argument: "near", message: e.to_string() };
        let mut force = here.force.clone();
        dense::cholesky_forward(&l, k, &mut force);
        let mean = Matrix::from_vec(
            k,
            k,
            (0..k * k).map(|e| 0.5 * (natural[(e / k, e % k)] + natural[(e % k, e / k)])).collect::<Vec<f64>>(),
        );
        let (values, vectors) = factor::symmetric_eigen(&mean).map_err(failed)?;
        let small = tolerance::SOLUTION_ROUNDING.sqrt() * largest;
        let mut z = if symmetric || self.stable {
            let mut z = vec![0.0; k];
            for (j, value) in values.iter().enumerate() {
                let along: f64 = (0..k).map(|i| vectors[(i, j)] * force[i]).sum();
                // down the potential along directions of negative curvature, nowhere along indifferent ones
                let curvature = if self.stable { value.abs() } else { *value };
                if curvature.abs() > small {
                    (0..k).for_each(|i| z[i] += vectors[(i, j)] * along / curvature);
                } else if along.abs() > small {
                    (0..k).for_each(|i| z[i] += vectors[(i, j)] * along.signum() * LONGEST_STEP);
                }
            }
            z
        } else {
            factor::solve_dense(&natural, &force).map_err(failed)?
        };
        dense::cholesky_backward(&l, k, &mut z);
        let descent = values.first().filter(|x| **x < -small).map(|_| {
            let mut along: Vec<f64> = (0..k).map(|i| OFF * vectors[(i, 0)]).collect();
            dense::cholesky_backward(&l, k, &mut along);
            along
        });
        Ok(Step { z, curvatures: values, symmetric, descent })
    }
}

/// The equilibrium that a search from the closed position q arrives at; with `stable` it goes down the potential, never
/// to a saddle.
///
/// # Errors
/// Singular positions, drives that move, a search that arrives nowhere.
pub fn equilibrium<'s, S: ConstrainedSystem + Varied + 's>(
    system: impl Into<SystemRef<'s, S>>,
    t: f64,
    q: &[f64],
    stable: bool,
) -> Result<Equilibrium, AnalysisError> {
    let system = system.into();
    let found = start::analyse(&*system, t, q)?;
    let n = system.size().nv;
    let displacement: Vec<f64> = (0..n).map(|l| system.characteristic_displacement(l)).collect();
    let mut search = Search {
        reduction: Reduction::dense(system.clone(), found.rank),
        t,
        stable,
        displacement: displacement.clone(),
    };
    let mut q = q.to_vec();
    let mut here = search.look(&q)?;
    let moving = (0..n).max_by(|&a, &b| {
        (search.reduction.gamma[a] / displacement[a])
            .abs()
            .total_cmp(&(search.reduction.gamma[b] / displacement[b]).abs())
    });
    if let Some(i) = moving.filter(|&i| search.reduction.gamma[i] != 0.0) {
        let message = format!(
            "drives move at t = {t} s: {} at {:.3e} per second; an equilibrium needs a time at which they rest",
            system.velocity_name(i),
            search.reduction.gamma[i]
        );
        return Err(AnalysisError::Argument { argument: "t", message });
    }
    let mut left = f64::INFINITY;
    for iterations in 0..MOST_STEPS {
        let Step { mut z, curvatures, symmetric, descent } = search.step(&here)?;
        let length = travel(&here.dt, &displacement, &z);
        let rounding = here.force.iter().zip(&here.pull).all(|(f, p)| f.abs() <= tolerance::ROUNDING * p);
        // once steps are rounding, they do not shrink any more
        let arrived = rounding
            || length <= tolerance::CLOSED
            || (length < tolerance::CLOSED_IN_RUN && tolerance::DOUBLED * length > left);
        let off = if stable && arrived { descent } else { None };
        if arrived && off.is_none() {
            return Ok(Equilibrium {
                q,
                multipliers: here.multipliers,
                independent: here.independent,
                stiffness: here.stiffness,
                curvatures,
                symmetric,
                iterations,
            });
        }
        left = if off.is_some() { f64::INFINITY } else { length };
        z = off.unwrap_or(z);
        let mut part = (LONGEST_STEP / travel(&here.dt, &displacement, &z)).min(1.0);
        let mut halvings = 0;
        loop {
            if let Some((next, there)) = search.moved(&q, &here, &z, part)? {
                (q, here) = (next, there);
                break;
            }
            part *= 0.5;
            halvings += 1;
            if halvings > MOST_HALVINGS {
                return Err(no_equilibrium(&*system, &here, iterations));
            }
        }
    }
    Err(no_equilibrium(&*system, &here, MOST_STEPS))
}

fn no_equilibrium<S: ConstrainedSystem>(system: &S, here: &Here, steps: usize) -> AnalysisError {
    let most = (0..here.force.len()).max_by(|&a, &b| here.force[a].abs().total_cmp(&here.force[b].abs()));
    let rest = most.map_or(String::new(), |i| {
        format!("; there the effort {:.3e} along {} is left", here.force[i], system.velocity_name(here.independent[i]))
    });
    let message = format!(
        "no equilibrium was found from here after {steps} steps{rest}; give another state near=..., or add what holds \
         the mechanism"
    );
    AnalysisError::Argument { argument: "near", message }
}

impl<S: ConstrainedSystem + Varied> Search<'_, S> {
    /// The position a part of a step on, if it closes and is better.
    fn moved(
        &mut self,
        q: &[f64],
        here: &Here,
        z: &[f64],
        part: f64,
    ) -> Result<Option<(Vec<f64>, Here)>, AnalysisError> {
        let (k, n) = (z.len(), self.reduction.size().nv);
        let dv: Vec<f64> = (0..n).map(|l| part * dense::dot(&here.dt[l * k..(l + 1) * k], z)).collect();
        let mut next = q.to_vec();
        self.reduction.system.step(&mut next, &dv);
        match close_kept(&mut self.reduction, self.t, &mut next) {
            Ok(closed) if closed.is_closed() => {}
            Ok(_) | Err(SystemError::Singular { .. }) => {
                start::choose_partition(&mut self.reduction, self.t, q, None, None)?;
                return Ok(None);
            }
            Err(e) => return Err(e.into()),
        }
        let there = match self.look(&next) {
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
            there.size <= here.size * (1.0 - SUFFICIENT * part)
        };
        let rounding = part * travel(&here.dt, &self.displacement, z) <= tolerance::CLOSED_IN_RUN;
        Ok((better || rounding).then_some((next, there)))
    }
}
