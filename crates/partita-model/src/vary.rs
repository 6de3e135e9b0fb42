//! Derivatives of the equations of a mechanism along displacements and changes of velocities and accelerations.

use crate::evaluator::{Evaluator, Wide, TOGETHER};
use crate::model::Model;
use partita_math::elimination::Pattern;
use partita_math::scalar::{Dual, Expansion, ExpansionScratch, Recorder, Recording, Scalar};
use partita_system::prelude::*;
use partita_system::system::{by_differences, At, Changes, Derivatives, Directions, Varied};
use partita_system::SystemError;
use std::sync::{Mutex, PoisonError};

/// Memory of an evaluation with derivatives.
struct DerivativeScratch {
    q: Vec<Wide>,
    v: Vec<Wide>,
    vdot: Vec<Wide>,
    phi: Vec<Wide>,
    c: Vec<Wide>,
    a: Vec<Wide>,
    b: Vec<Wide>,
    force: Vec<Wide>,
    rates: Vec<Wide>,
    accelerations: Vec<Wide>,
}

impl Model {
    /// The equations over numbers with derivatives; `None` where `f64` alone can solve for frictions.
    fn with_derivatives(&self) -> Option<&Evaluator<Wide>> {
        self.varied.get_or_init(|| self.over::<Wide>().ok()).as_ref()
    }
}

/// Numbers at a point, with their changes along some of the directions, from the `first` on.
fn seeded(values: &[f64], changes: &[f64], first: usize, count: usize, out: &mut [Wide]) {
    let n = values.len();
    for (i, (x, value)) in out.iter_mut().zip(values).enumerate() {
        let along = |l: usize| if first + l < count { changes[(first + l) * n + i] } else { 0.0 };
        *x = Dual::new(*value, std::array::from_fn(along));
    }
}

/// Numbers that a result may depend on before it is one of its own. Scale: number. Reason: positions and velocities of two bodies
/// in the plane; measured on chains, which take longer with half and with twice as many.
const DEPENDENT_ON: usize = 12;

/// The equations as a recording with its derivatives, and memory of evaluations.
pub(crate) struct Expanded {
    expansion: Expansion,
    spare: Mutex<Vec<(ExpansionScratch, Vec<f64>)>>,
}

impl Model {
    /// The equations with derivatives by way of results between; none where they cannot be recorded.
    fn expansion(&self) -> Option<&Expanded> {
        let made = || {
            let expansion = self.recorded_expansion()?;
            Some(Box::new(Expanded { expansion, spare: Mutex::default() }))
        };
        self.expanded.get_or_init(made).as_deref()
    }

    /// Inputs: t | q | displacements | v | v' | λ.
    fn recorded_expansion(&self) -> Option<Expansion> {
        let e = self.over::<Recorder>().ok()?;
        let (size, n) = (self.size(), self.size().nv);
        let moved = 1 + size.nq;
        let (v, vdot) = (moved + n, moved + 2 * n);
        let inputs = vdot + n + size.rows;
        let made = Recording::new(inputs, |x| {
            let zeros = |n: usize| vec![Recorder::zero(); n];
            let (mut phi, mut c, mut force) = (zeros(size.holonomic), zeros(self.pattern().nnz()), zeros(n));
            let (mut rates, mut accelerations) = (zeros(size.rows), zeros(size.rows));
            // a displacement of first order: N(q) dq
            let mut q = zeros(size.nq);
            e.rate(&x[1..moved], &x[moved..v], &mut q);
            q.iter_mut().zip(&x[1..moved]).for_each(|(to, q)| *to += *q);
            let mut s = e.scratch();
            e.position(x[0], &q, &mut s, &mut phi, &mut c, &mut rates)?;
            e.velocity(x[0], &q, &x[v..vdot], &mut s, &mut accelerations)?;
            e.inverse_dynamics(x[0], &q, &x[v..vdot], &x[vdot..vdot + n], &mut s, &mut force)?;
            for i in 0..size.rows {
                for entry in self.pattern().row(i) {
                    let (c, col) = (c[entry], self.pattern().col_idx[entry]);
                    rates[i] += c * x[v + col];
                    accelerations[i] += c * x[vdot + col];
                    force[col] -= c * x[vdot + n + i];
                }
            }
            Ok::<_, SystemError>([rates, accelerations, force].concat())
        });
        Some(Expansion::new(made.ok()?.lean(), inputs - moved, |i| i.checked_sub(moved), DEPENDENT_ON))
    }
}

impl Varied for Model {
    fn expanded(&self) -> Option<&Pattern> {
        self.expansion().map(|x| x.expansion.pattern())
    }
    fn expansion_cost(&self) -> usize {
        self.expansion().map_or(0, |x| x.expansion.multiplications())
    }
    fn expand(&self, at: &At, out: &mut [f64]) {
        let Some(own) = self.expansion() else { return };
        let spare = || own.spare.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut scratch, mut inputs) = spare().pop().unwrap_or_default();
        inputs.clear();
        inputs.push(at.t);
        inputs.extend_from_slice(at.q);
        inputs.resize(1 + at.q.len() + at.v.len(), 0.0);
        [at.v, at.vdot, at.multipliers].into_iter().for_each(|x| inputs.extend_from_slice(x));
        own.expansion.evaluate(&inputs, &mut scratch, out);
        spare().push((scratch, inputs));
    }
    fn vary(&self, at: &At, along: &Directions, out: &mut Changes) -> Result<Derivatives, SystemError> {
        let Some(e) = self.with_derivatives() else {
            return by_differences(self, at, along, out);
        };
        let (size, n) = (self.size(), self.size().nv);
        let zeros = |n: usize| vec![Wide::zero(); n];
        let mut s = e.scratch();
        let mut x = DerivativeScratch {
            q: zeros(size.nq),
            v: zeros(n),
            vdot: zeros(n),
            phi: zeros(size.holonomic),
            c: zeros(self.pattern().nnz()),
            a: zeros(size.rows),
            b: zeros(size.rows),
            force: zeros(n),
            rates: zeros(size.rows),
            accelerations: zeros(size.rows),
        };
        let base: Vec<Wide> = at.q.iter().map(|q| Dual::constant(*q)).collect();
        for first in (0..along.count).step_by(TOGETHER) {
            seeded(at.v, along.q, first, along.count, &mut x.v);
            x.v.iter_mut().for_each(|v| v.re = 0.0);
            // a displacement of first order: N(q) dq
            e.rate(&base, &x.v, &mut x.q);
            x.q.iter_mut().zip(at.q).for_each(|(x, q)| x.re = *q);
            seeded(at.v, along.v, first, along.count, &mut x.v);
            seeded(at.vdot, along.vdot, first, along.count, &mut x.vdot);
            let t = Dual::constant(at.t);
            e.position(t, &x.q, &mut s, &mut x.phi, &mut x.c, &mut x.a)?;
            e.velocity(t, &x.q, &x.v, &mut s, &mut x.b)?;
            e.inverse_dynamics(t, &x.q, &x.v, &x.vdot, &mut s, &mut x.force)?;
            let pattern = self.pattern();
            for i in 0..pattern.rows {
                let (mut rate, mut acceleration) = (x.a[i], x.b[i]);
                for entry in pattern.row(i) {
                    let (c, col) = (x.c[entry], pattern.col_idx[entry]);
                    rate += c * x.v[col];
                    acceleration += c * x.vdot[col];
                    x.force[col] -= c.scale(at.multipliers[i]);
                }
                // a and b stay as they are: rows without them are never written
                x.rates[i] = rate;
                x.accelerations[i] = acceleration;
            }
            for l in 0..TOGETHER.min(along.count - first) {
                let put = |from: &[Wide], to: &mut [f64]| {
                    let m = from.len();
                    let part = &mut to[(first + l) * m..(first + l + 1) * m];
                    part.iter_mut().zip(from).for_each(|(to, from)| *to = from.eps[l]);
                };
                put(&x.rates, &mut out.rates);
                put(&x.accelerations, &mut out.accelerations);
                put(&x.force, &mut out.forces);
            }
        }
        match self.own.calls_functions() {
            true => Ok(Derivatives::Differences),
            false => Ok(Derivatives::Exact),
        }
    }
}
