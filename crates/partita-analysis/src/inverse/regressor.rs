//! The regressor of identification: derivatives of measured efforts and forces with respect to parameters, along a motion.
//!
//! ```text
//! measured coordinates z, u, u' are held, p moves:
//! dq  = −G_h Φ_p dp      dv = −G d(C v + a)      dv' = −G d(C v' + b)                                  (V1 - V3)
//! B dτ = D d(M v' − h − Cᵀ λ)                    λ, τ frozen on the right: D Cᵀ = 0
//! C_Dᵀ dλ = (d(M v' − h − Cᵀ λ) − E dτ)_D                                                              (V4)
//! ```
//!
//! The directions of dp are seeded into dual numbers, eight at a time; reactions follow from dual multipliers.

use super::{Gap, Inverse, InverseScratch};
use crate::error::AnalysisError;
use crate::outputs::{chunk_of, tables, Rows, States, Watch};
use partita_math::dense;
use partita_math::factor;
use partita_math::scalar::{Dual, Scalar};
use partita_model::evaluator::{Evaluator, Scratch};
use partita_model::reaction::{Reactions, Wrench};
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::SystemError;
use serde::Deserialize;
use std::sync::Arc;

/// Directions that are differentiated together.
const TOGETHER: usize = 8;

type Wide = Dual<TOGETHER>;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Channel {
    /// The effort of an actuator.
    Effort(usize),
    /// Force (0 to 2) or moment about the origin (3 to 5) of the ground on the mechanism through its joints, world axes.
    Ground(usize),
    /// Reaction of a joint: force (0 to 2), or moment about the joint's point (3 to 5), world axes.
    Joint(usize, usize),
}

/// Parameters, and directions in which they are changed.
#[derive(Clone, Debug)]
pub struct Directions {
    /// Names, as in [`parameters`](partita_model::parameters).
    pub names: Vec<String>,
    /// Numbers of each.
    pub values: Vec<Vec<f64>>,
    /// The change of all numbers, one after the other, along each direction.
    pub along: Vec<Vec<f64>>,
}

/// Values of the channels along a motion, and their derivatives.
#[derive(Clone, Debug, Default)]
pub struct Regression {
    /// One for each instant and channel.
    pub values: Vec<f64>,
    /// One for each instant, channel and direction.
    pub derivatives: Vec<f64>,
    /// Why an instant has none.
    pub gaps: Vec<Gap>,
}

/// A mechanism with actuators whose parameters carry derivatives.
pub struct Regressor {
    inverse: Arc<Inverse>,
    /// With the same actuators, then the measured coordinates that are none of them.
    seen: Arc<Inverse>,
    /// Which of the actuators of `seen` are the measured coordinates, one for each degree of freedom.
    held: Vec<usize>,
    /// One for each eight directions.
    batches: Vec<Evaluator<Wide>>,
    count: usize,
    channels: Vec<Channel>,
    /// Whether a channel is a reaction.
    reacting: bool,
}

/// Memory of a thread.
struct RegressorScratch {
    own: InverseScratch,
    s: Vec<Scratch<Wide>>,
    q: Vec<Wide>,
    v: Vec<Wide>,
    vdot: Vec<Wide>,
    phi: Vec<Wide>,
    c: Vec<Wide>,
    a: Vec<Wide>,
    b: Vec<Wide>,
    force: Vec<Wide>,
    lambda: Vec<Wide>,
    multipliers: Vec<f64>,
}

/// Whether any derivative is not zero.
fn moves(x: &[Wide]) -> bool {
    x.iter().any(|x| x.eps.iter().any(|e| *e != 0.0))
}

impl Regressor {
    /// # Errors
    /// Unknown parameters, those that cannot be differentiated.
    pub fn new(
        inverse: Arc<Inverse>,
        (seen, held): (Arc<Inverse>, Vec<usize>),
        by: &Directions,
        channels: Vec<Channel>,
    ) -> Result<Self, AnalysisError> {
        let count = by.along.len();
        let mut batches = Vec::with_capacity(count.div_ceil(TOGETHER));
        for directions in by.along.chunks(TOGETHER) {
            let mut first = 0;
            let seeded = by.values.iter().map(|values| {
                let number = |(i, x): (usize, &f64)| {
                    Dual::new(*x, std::array::from_fn(|l| directions.get(l).map_or(0.0, |d| d[first + i])))
                };
                let made = values.iter().enumerate().map(number).collect();
                first += values.len();
                made
            });
            let seeded: Vec<Vec<Wide>> = seeded.collect();
            let changes: Vec<(&str, &[Wide])> =
                by.names.iter().map(String::as_str).zip(seeded.iter().map(Vec::as_slice)).collect();
            batches.push(seen.actuated.over_with(&changes)?);
        }
        let reacting = channels.iter().any(|c| !matches!(c, Channel::Effort(_)));
        Ok(Self { inverse, seen, held, batches, count, channels, reacting })
    }

    fn memory(&self, rank: usize) -> RegressorScratch {
        let (size, inverse) = (self.seen.actuated.size(), &self.inverse);
        let zeros = |n: usize| vec![Wide::zero(); n];
        RegressorScratch {
            own: inverse.memory(rank),
            s: self.batches.iter().map(Evaluator::scratch).collect(),
            q: zeros(size.nq),
            v: zeros(size.nv),
            vdot: zeros(size.nv),
            phi: zeros(size.holonomic),
            c: zeros(self.seen.actuated.pattern().nnz()),
            a: zeros(size.rows),
            b: zeros(size.rows),
            force: zeros(size.nv),
            lambda: zeros(size.rows),
            multipliers: vec![0.0; size.rows],
        }
    }

    /// Channels and their derivatives at the states, which belong to one branch, for the accelerations v'.
    ///
    /// # Errors
    /// `Argument` where the actuators are fewer or more than the degrees of freedom, and for geometry of mechanisms that
    /// roll; errors of `watch`.
    pub fn along(&self, states: &States, vdot: &[f64], watch: Watch) -> Result<Regression, AnalysisError> {
        let inverse = &*self.inverse;
        let rank = inverse.rank(states)?;
        let (n, s, m) = (inverse.released.size().nv, inverse.levers.len(), self.channels.len());
        let k = n - rank;
        // rotations that move nothing else, and have no actuator
        if k < s || k - s > inverse.idle {
            let message = format!(
                "the mechanism has {} degree{} of freedom without its drives{}, and {s} actuator{}: the efforts along a \
                 motion are unique where their numbers are equal; name one actuator for each degree of freedom, a joint \
                 without a motor as well: its effort is 0",
                k - inverse.idle,
                if k - inverse.idle == 1 { "" } else { "s" },
                if inverse.idle > 0 { " and rotations that move nothing else" } else { "" },
                if s == 1 { "" } else { "s" },
            );
            return Err(AnalysisError::Argument { argument: "actuators", message });
        }
        let widths = [m, m * self.count, 1];
        let row = |i: usize, memory: &mut RegressorScratch, out: &mut Rows| {
            let (t, q, v) = states.at(&inverse.released, i);
            let vdot = &vdot[i * n..][..n];
            let gap = if q.iter().chain(v).chain(vdot).all(|x| x.is_finite()) {
                self.instant((t, q, v, vdot), memory, (i, out))?
            } else {
                Gap::Motion
            };
            out.row(2, i)[0] = f64::from(gap as u8);
            if gap != Gap::None {
                out.row(0, i).fill(f64::NAN);
                out.row(1, i).fill(f64::NAN);
            }
            Ok::<(), AnalysisError>(())
        };
        let found = tables(states.len(), &widths, chunk_of(&inverse.released), || self.memory(rank), row, watch)?;
        let mut found = found.into_iter();
        let mut next = || found.next().unwrap_or_default();
        let (values, derivatives, gaps) = (next(), next(), next());
        let gaps =
            gaps.iter().map(|x| [Gap::None, Gap::Constraints, Gap::Actuators, Gap::Motion][*x as usize]).collect();
        Ok(Regression { values, derivatives, gaps })
    }

    /// One instant.
    fn instant(
        &self,
        (t, q, v, vdot): (f64, &[f64], &[f64], &[f64]),
        memory: &mut RegressorScratch,
        (row, out): (usize, &mut Rows),
    ) -> Result<Gap, AnalysisError> {
        let inverse = &*self.inverse;
        let set = match inverse.set(t, q, &mut memory.own) {
            Ok(found) => found,
            Err(AnalysisError::System(SystemError::Singular { .. } | SystemError::SingularStart { .. })) => {
                return Ok(Gap::Constraints);
            }
            Err(e) => return Err(e),
        };
        if !set.is_regular() {
            return Ok(Gap::Actuators);
        }
        let k = set.b().rows();
        // B⁻¹, column by column; with idle rotations, which go on as they will, its left inverse in the metric M_d⁻¹
        let overflow = |_| SystemError::NotFinite { what: "an effort".into(), t };
        let s = inverse.levers.len();
        let (ones, zeros) = (vec![1.0; s], vec![0.0; s]);
        let unit = |i: usize| (0..k).map(|j| if i == j { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
        let columns: Vec<Vec<f64>> =
            (0..k).map(|i| set.efforts(&unit(i), &zeros, &ones)).collect::<Result<_, _>>().map_err(overflow)?;
        let solved = |needed: &[f64]| {
            let mut tau = vec![0.0; s];
            needed.iter().zip(&columns).for_each(|(x, column)| dense::axpy(*x, column, &mut tau));
            tau
        };
        // the motion as it is
        let own = &mut memory.own;
        own.reduction.at.v.copy_from_slice(v);
        own.reduction.velocity(t, q)?;
        let needed = |own: &mut InverseScratch, vdot: &[f64]| {
            let r = &mut own.reduction;
            r.system.inverse_dynamics(t, q, v, vdot, &mut r.scratch, &mut own.residual)?;
            Ok::<_, SystemError>(projected(&own.reduction, k, own.residual.iter().copied()))
        };
        let mut acting = needed(own, vdot)?;
        let tau = solved(&acting);
        let mut moved = vdot.to_vec();
        if s < k {
            // M_d du' = B τ − τ_d
            let mut du: Vec<f64> = set.b().matvec(&tau).iter().zip(&acting).map(|(x, y)| x - y).collect();
            let mut l = own.md.clone();
            factor::cholesky_large(&mut l, k).map_err(overflow)?;
            dense::cholesky_solve(&l, k, &mut du);
            moved.iter_mut().zip(own.reduction.at.dt.chunks_exact(k)).for_each(|(x, d)| *x += dense::dot(d, &du));
            acting = needed(own, &moved)?;
        }
        let (tau, vdot) = (solved(&acting), &moved[..]);
        let change = memory.own.residual.clone();
        let mut found = std::mem::take(&mut memory.multipliers);
        self.multipliers(&tau, change, &memory.own, |row, x| found[row] = x);
        memory.multipliers = found;
        for (c, value) in self.channels.iter().zip(out.row(0, row)) {
            if let Channel::Effort(j) = c {
                *value = tau[*j];
            }
        }
        let time = Wide::constant(t);
        for (batch, e) in self.batches.iter().enumerate() {
            self.residual((time, q, v, vdot), memory, batch)?;
            let r = &memory.own.reduction;
            let directions = TOGETHER.min(self.count - batch * TOGETHER);
            let mut changes = Vec::with_capacity(directions);
            for l in 0..directions {
                changes.push(solved(&projected(r, k, memory.force.iter().map(|x| x.eps[l]))));
            }
            let put = |channel: usize, l: usize, x: f64, out: &mut Rows| {
                out.row(1, row)[channel * self.count + batch * TOGETHER + l] = x;
            };
            for (i, c) in self.channels.iter().enumerate() {
                if let Channel::Effort(j) = c {
                    changes.iter().enumerate().for_each(|(l, tau)| put(i, l, tau[*j], out));
                }
            }
            if !self.reacting {
                continue;
            }
            memory.lambda.iter_mut().zip(&memory.multipliers).for_each(|(x, value)| *x = Wide::constant(*value));
            for (l, tau) in changes.iter().enumerate() {
                let change = memory.force.iter().map(|x| x.eps[l]).collect();
                self.multipliers(tau, change, &memory.own, |row, x| memory.lambda[row].eps[l] = x);
            }
            let s = &mut memory.s[batch];
            let found = e.reactions_of(
                self.seen.actuated.whole(),
                time,
                &memory.q,
                &memory.v,
                &memory.vdot,
                &memory.lambda,
                s,
            )?;
            let ground = e.ground_wrench(&found, s);
            for (i, c) in self.channels.iter().enumerate() {
                let Some(x) = component(*c, &found, &ground) else { continue };
                out.row(0, row)[i] = x.re;
                (0..directions).for_each(|l| put(i, l, x.eps[l], out));
            }
        }
        Ok(Gap::None)
    }

    /// Multipliers of `seen` for efforts and what they leave of M v' − h: `C_Dᵀ λ = (M v' − h − E τ)_D`.          (R1)
    fn multipliers(&self, tau: &[f64], mut rest: Vec<f64>, own: &InverseScratch, mut put: impl FnMut(usize, f64)) {
        for (column, tau) in own.columns.iter().zip(tau) {
            column.iter().for_each(|&(i, e)| rest[i] -= e * tau);
        }
        for ((lever, factors), tau) in self.seen.levers.iter().zip(&own.factors).zip(tau) {
            lever.rows.iter().zip(factors).for_each(|(&row, factor)| put(row, factor * tau));
        }
        let partition = &own.reduction.planned.partition;
        let mut lambda: Vec<f64> = partition.dependent.iter().map(|&i| rest[i]).collect();
        own.reduction.solve_transposed(&mut lambda);
        partition.rows.iter().zip(lambda).for_each(|(&row, x)| put(self.seen.rows[row], x));
    }

    /// M v' − h − Cᵀ λ over the directions of a batch, the measured coordinates held; with the q, v and v' of it.
    fn residual(
        &self,
        (t, q, v, vdot): (Wide, &[f64], &[f64], &[f64]),
        memory: &mut RegressorScratch,
        batch: usize,
    ) -> Result<(), AnalysisError> {
        let RegressorScratch { own, s, q: x, v: u, vdot: w, phi, c, a, b, force, multipliers, .. } = memory;
        let (e, s) = (&self.batches[batch], &mut s[batch]);
        for (to, from) in [(&mut *x, q), (&mut *u, v), (&mut *w, vdot)] {
            to.iter_mut().zip(from).for_each(|(x, value)| *x = Wide::constant(*value));
        }
        for x in [&mut *phi, &mut *c, &mut *a, &mut *b] {
            x.fill(Wide::zero());
        }
        let rows = &self.seen.rows;
        let (pattern, r) = (self.seen.actuated.pattern(), &own.reduction);
        let kept = r.planned.partition.rows.iter().map(|&i| rows[i]);
        let along = |row: usize, c: &[Wide], x: &[Wide], rest: &[Wide]| {
            pattern.row(row).fold(rest[row], |sum, entry| sum + c[entry] * x[pattern.col_idx[entry]])
        };
        e.position(t, x, s, phi, c, a)?;
        if moves(phi) || moves(c) || moves(a) {
            let measured = self.measured(r, c)?;
            let base: Vec<Wide> = x.clone();
            let shift = |moved: &[Wide], x: &mut [Wide]| {
                e.rate(&base, moved, x);
                x.iter_mut().zip(q).for_each(|(x, value)| x.re = *value);
            };
            let mut moved = vec![Wide::zero(); u.len()];
            held(r, &kept.clone().map(|i| phi[i]).collect::<Vec<_>>(), &mut moved);
            shift(&moved, x);
            e.position(t, x, s, phi, c, a)?;
            measured.restore(r, |row| phi[row], &mut moved);
            shift(&moved, x);
            e.position(t, x, s, phi, c, a)?;
            let rates: Vec<Wide> = kept.clone().map(|i| along(i, c, u, a)).collect();
            held(r, &rates, u);
            let before = u.clone();
            measured.restore(r, |row| along(row, c, &before, a), u);
            e.velocity(t, x, u, s, b)?;
            let accelerations: Vec<Wide> = kept.map(|i| along(i, c, w, b)).collect();
            held(r, &accelerations, w);
            let before = w.clone();
            measured.restore(r, |row| along(row, c, &before, b), w);
        } else {
            e.velocity(t, x, u, s, b)?;
        }
        e.inverse_dynamics(t, x, u, w, s, force)?;
        for (row, multiplier) in multipliers.iter().enumerate() {
            for entry in pattern.row(row) {
                force[pattern.col_idx[entry]] -= c[entry].scale(*multiplier);
            }
        }
        Ok(())
    }

    /// The measured coordinates as functions of the independent displacements.
    fn measured(&self, r: &Reduction<'static, Model>, c: &[Wide]) -> Result<Measured, AnalysisError> {
        let (pattern, k) = (self.seen.actuated.pattern(), r.k());
        self.allows_geometry(k)?;
        let rows: Vec<usize> = self.held.iter().map(|&j| self.seen.levers[j].rows[0]).collect();
        let mut factors = vec![0.0; k * k];
        for (row, out) in rows.iter().zip(factors.chunks_exact_mut(k)) {
            for entry in pattern.row(*row) {
                dense::axpy(c[entry].re, &r.at.dt[pattern.col_idx[entry] * k..][..k], out);
            }
        }
        let mut exchanged = vec![0; k];
        dense::lu(&mut factors, k, &mut exchanged).map_err(|_| AnalysisError::Argument {
            argument: "data",
            message: "the measured positions do not determine the motion at an instant; measure other joints".into(),
        })?;
        Ok(Measured { rows, factors, exchanged })
    }

    /// Refuse what the formulas do not cover.
    fn allows_geometry(&self, k: usize) -> Result<(), AnalysisError> {
        let size = self.inverse.released.size();
        let rate = |j: &usize| self.seen.levers[*j].rows.iter().any(|row| *row >= self.seen.actuated.size().holonomic);
        let message = if self.inverse.turning {
            "a component of a force along an axis of its body is an actuator, and a length or a point is a parameter; \
             give the force along axes of the world, or leave geometry out"
        } else if size.holonomic < size.rows {
            "a length or a point is a parameter of a mechanism with constraints of rates (rolling); leave geometry out"
        } else if self.held.len() != k || self.held.iter().any(rate) {
            "a length or a point is a parameter, and the measured coordinates are rates of a spatial rotation, or fewer \
             or more than the degrees of freedom; measure angles and displacements of joints, or leave geometry out"
        } else {
            return Ok(());
        };
        Err(AnalysisError::Argument { argument: "by", message: message.into() })
    }
}

/// Measured coordinates along the independent displacements: their rows, and the factors of E_Mᵀ Dᵀ.
struct Measured {
    rows: Vec<usize>,
    factors: Vec<f64>,
    exchanged: Vec<usize>,
}

impl Measured {
    /// Add to `out` the admissible change by which the rows, which have changed by `of`, are held.
    fn restore(&self, r: &Reduction<'static, Model>, of: impl Fn(usize) -> Wide, out: &mut [Wide]) {
        let (k, changes) = (self.rows.len(), self.rows.iter().map(|&row| of(row)).collect::<Vec<_>>());
        for l in 0..TOGETHER {
            let mut change: Vec<f64> = changes.iter().map(|x| -x.eps[l]).collect();
            dense::lu_solve(&self.factors, k, &self.exchanged, &mut change);
            out.iter_mut().zip(r.at.dt.chunks_exact(k)).for_each(|(x, d)| x.eps[l] += dense::dot(d, &change));
        }
    }
}

/// D x.
fn projected(r: &Reduction<'static, Model>, k: usize, x: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sum = vec![0.0; k];
    x.zip(r.at.dt.chunks_exact(k)).for_each(|(x, d)| dense::axpy(x, d, &mut sum));
    sum
}

/// Add to the dependent entries of `out` what keeps the rows at zero: −C_D⁻¹ of the derivatives of the kept rows.
fn held(r: &Reduction<'static, Model>, residuals: &[Wide], out: &mut [Wide]) {
    let partition = &r.planned.partition;
    for l in 0..TOGETHER {
        let mut change: Vec<f64> = residuals.iter().map(|x| -x.eps[l]).collect();
        r.solve(&mut change, 1);
        partition.dependent.iter().zip(change).for_each(|(&i, x)| out[i].eps[l] += x);
    }
}

/// A component of a wrench: force, then moment.
fn component(c: Channel, found: &Reactions<Wide>, ground: &Wrench<Wide>) -> Option<Wide> {
    let (wrench, i) = match c {
        Channel::Effort(_) => return None,
        Channel::Ground(i) => (ground, i),
        Channel::Joint(j, i) => (&found.joints[j], i),
    };
    Some(if i < 3 { wrench.force.0[i] } else { wrench.moment.0[i - 3] })
}
