//! Derivatives of the equations of a mechanism along displacements and changes of velocities and accelerations.

use crate::evaluator::{Evaluator, Wide, TOGETHER};
use crate::expanded::Expanded;
use crate::model::Model;
use partita_math::elimination::Pattern;
use partita_math::scalar::{Dual, Recorder, Scalar};
use partita_system::prelude::*;
use partita_system::system::{by_differences, At, Changes, Derivatives, Directions, Varied};
use partita_system::SystemError;

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

impl Model {
    /// The equations with sparse derivatives; none where they cannot be recorded.
    fn with_sparse_derivatives(&self) -> Option<&Expanded> {
        let made = || Expanded::new(&self.over::<Recorder>().ok()?, self.structure()).map(Box::new);
        self.expanded.get_or_init(made).as_deref()
    }
}

impl Varied for Model {
    fn expanded(&self) -> Option<&Pattern> {
        self.with_sparse_derivatives().map(Expanded::pattern)
    }
    fn expansion_cost(&self) -> usize {
        self.with_sparse_derivatives().map_or(0, Expanded::multiplications)
    }
    fn expand(&self, at: &At, out: &mut [f64]) {
        if let Some(own) = self.with_sparse_derivatives() {
            own.evaluate(at, out);
        }
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
