//! Derivatives of the equations of a mechanism along displacements and changes of velocities and accelerations.

use crate::evaluator::{Evaluator, Wide, TOGETHER};
use crate::model::Model;
use partita_math::elimination::Pattern;
use partita_math::scalar::{Dual, Recorder, Recording, Scalar};
use partita_system::prelude::*;
use partita_system::system::{by_differences, At, Changes, Couplings, Derivatives, Directions, Varied};
use partita_system::SystemError;
use std::sync::Arc;

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
    /// Where the derivatives of the equations may be nonzero, by a recording of them.
    fn recorded_couplings(&self) -> Option<Couplings> {
        let e = self.over::<Recorder>().ok()?;
        let (size, n) = (self.size(), self.size().nv);
        let (v, vdot) = (1 + size.nq, 1 + size.nq + n);
        let inputs = vdot + n + size.rows;
        let made = Recording::new(inputs, |x| {
            let zeros = |n: usize| vec![Recorder::zero(); n];
            let (mut phi, mut c, mut force) = (zeros(size.holonomic), zeros(self.pattern().nnz()), zeros(n));
            let (mut rates, mut accelerations) = (zeros(size.rows), zeros(size.rows));
            let mut s = e.scratch();
            e.position(x[0], &x[1..v], &mut s, &mut phi, &mut c, &mut rates)?;
            e.velocity(x[0], &x[1..v], &x[v..vdot], &mut s, &mut accelerations)?;
            e.inverse_dynamics(x[0], &x[1..v], &x[v..vdot], &x[vdot..vdot + n], &mut s, &mut force)?;
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
        let made = made.ok()?;
        let blank = || vec![Vec::new(); 2 * size.rows + n];
        let (mut by_position, mut by_velocity) = (blank(), blank());
        let mut marks = vec![0; inputs];
        for first in (0..n).step_by(u64::BITS as usize) {
            let marked = first..n.min(first + u64::BITS as usize);
            for of_positions in [true, false] {
                marks.fill(0);
                for i in marked.clone() {
                    let own = if of_positions { self.structure().coordinates_of(i) } else { v - 1 + i..v + i };
                    own.for_each(|l| marks[1 + l] |= 1 << (i - first));
                }
                let rows = if of_positions { &mut by_position } else { &mut by_velocity };
                for (row, found) in rows.iter_mut().zip(made.dependences(&marks)) {
                    row.extend(marked.clone().filter(|i| found >> (i - first) & 1 == 1));
                }
            }
        }
        let (m, pattern) = (size.rows, |rows: &[Vec<usize>]| Pattern::from_rows(n, rows));
        Some(Couplings::new([
            pattern(&by_position[..m]),
            pattern(&by_position[m..2 * m]),
            pattern(&by_velocity[m..2 * m]),
            pattern(&by_position[2 * m..]),
            pattern(&by_velocity[2 * m..]),
        ]))
    }
}

impl Varied for Model {
    fn couplings(&self) -> Option<Arc<Couplings>> {
        self.couplings.get_or_init(|| self.recorded_couplings().map(Arc::new)).clone()
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
