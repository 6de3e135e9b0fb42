//! The equations of a mechanism with sparse derivatives: a recording, differentiated by way of results that bodies hand on.

use crate::evaluator::Evaluator;
use partita_math::elimination::Pattern;
use partita_math::expansion::{Expansion, ExpansionScratch};
use partita_math::scalar::{Recorder, Recording, Scalar};
use partita_system::system::{At, Structure};
use partita_system::SystemError;
use std::sync::{Mutex, PoisonError};

/// Numbers that a result may depend on before it is one of its own. Scale: number. Reason: positions and velocities of two bodies
/// in the plane; measured on chains, which take longer with half and with twice as many.
const DEPENDENT_ON: usize = 12;

/// C v + a, s = C v' + b and r = M v' − h − Cᵀ λ with their derivatives by displacements, v, v' and λ.
pub(crate) struct Expanded {
    expansion: Expansion,
    /// Memory of evaluations, and their inputs: t | q | displacements | v | v' | λ.
    spare: Mutex<Vec<(ExpansionScratch, Vec<f64>)>>,
}

impl Expanded {
    /// Of these equations; none where they cannot be evaluated.
    pub fn new(e: &Evaluator<Recorder>, structure: &Structure) -> Option<Self> {
        let (size, pattern) = (structure.size, &structure.pattern);
        let (n, moved) = (size.nv, 1 + size.nq);
        let (v, vdot) = (moved + n, moved + 2 * n);
        let inputs = vdot + n + size.rows;
        let made = Recording::new(inputs, |x| {
            let zeros = |n: usize| vec![Recorder::zero(); n];
            let (mut phi, mut c, mut force) = (zeros(size.holonomic), zeros(pattern.nnz()), zeros(n));
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
                for entry in pattern.row(i) {
                    let (c, col) = (c[entry], pattern.col_idx[entry]);
                    rates[i] += c * x[v + col];
                    accelerations[i] += c * x[vdot + col];
                    force[col] -= c * x[vdot + n + i];
                }
            }
            Ok::<_, SystemError>([rates, accelerations, force].concat())
        });
        let expansion = Expansion::new(made.ok()?.lean(), inputs - moved, |i| i.checked_sub(moved), DEPENDENT_ON);
        Some(Self { expansion, spare: Mutex::default() })
    }

    /// Where the derivatives are not always zero.
    pub fn pattern(&self) -> &Pattern {
        self.expansion.pattern()
    }

    /// Multiplications of an evaluation.
    pub fn multiplications(&self) -> usize {
        self.expansion.multiplications()
    }

    /// The derivatives at a point, entry by entry.
    pub fn evaluate(&self, at: &At, out: &mut [f64]) {
        let spare = || self.spare.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut scratch, mut inputs) = spare().pop().unwrap_or_default();
        inputs.clear();
        inputs.push(at.t);
        inputs.extend_from_slice(at.q);
        inputs.resize(1 + at.q.len() + at.v.len(), 0.0);
        [at.v, at.vdot, at.multipliers].into_iter().for_each(|x| inputs.extend_from_slice(x));
        self.expansion.evaluate(&inputs, &mut scratch, out);
        spare().push((scratch, inputs));
    }
}
