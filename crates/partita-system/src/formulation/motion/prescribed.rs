//! Quantities that are integrated for rows that prescribe a motion: a prescribed motion must be continuous with its rate.
//!
//! Beside the state the motion integrates `z' = N(q) v` and `w' = v'` of the coordinates and velocities in these rows,
//! from the closed (q, v) at the start of every step. At its end `Φ(t, z)` and `C w + a` are errors of a quadrature,
//! unless Φ or its rate jumped inside: a jump is not visible in the derivatives.                         (W3)

use crate::error::Result;
use crate::formulation::{Prescribing, Prescription};
use crate::reduction::Reduction;
use crate::system::ConstrainedSystem;

/// The rows that prescribe a motion, and the quantities that are integrated for them.
pub(super) struct Prescribed<S: ConstrainedSystem> {
    pub(super) rows: Vec<usize>,
    /// Coordinates and velocities in these rows, ascending.
    coordinates: Vec<usize>,
    velocities: Vec<usize>,
    q: Vec<f64>,
    v: Vec<f64>,
    qdot: Vec<f64>,
    /// The closed q and v at the end of the step that is judged, of these coordinates and velocities.
    end: Vec<f64>,
    scratch: S::Scratch,
    phi: Vec<f64>,
    c: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
}

impl<S: ConstrainedSystem> Prescribed<S> {
    pub(super) fn new(system: &S) -> Self {
        let (size, pattern) = (system.size(), system.pattern());
        let rows: Vec<usize> = (0..size.rows).filter(|&i| system.structure().rows[i].may_jump).collect();
        let mut velocities: Vec<usize> =
            rows.iter().flat_map(|&i| pattern.row(i)).map(|e| pattern.col_idx[e]).collect();
        velocities.sort_unstable();
        velocities.dedup();
        let mut coordinates: Vec<usize> =
            velocities.iter().flat_map(|&i| system.structure().coordinates_of(i)).collect();
        coordinates.sort_unstable();
        coordinates.dedup();
        Self {
            end: vec![0.0; coordinates.len() + velocities.len()],
            rows,
            coordinates,
            velocities,
            q: vec![0.0; size.nq],
            v: vec![0.0; size.nv],
            qdot: vec![0.0; size.nq],
            scratch: system.scratch(),
            phi: vec![0.0; size.holonomic],
            c: vec![0.0; pattern.nnz()],
            a: vec![0.0; size.rows],
            b: vec![0.0; size.rows],
        }
    }

    /// Quantities integrated beside the state.
    pub(super) fn count(&self) -> usize {
        self.end.len()
    }

    /// Those of these coordinates and velocities, or of their rates.
    pub(super) fn pick(&self, q: &[f64], v: &[f64], out: &mut [f64]) {
        let (of_q, of_v) = out.split_at_mut(self.coordinates.len());
        of_q.iter_mut().zip(&self.coordinates).for_each(|(x, &i)| *x = q[i]);
        of_v.iter_mut().zip(&self.velocities).for_each(|(x, &i)| *x = v[i]);
    }

    /// Start them at the closed (q, v).
    pub(super) fn start(&mut self, q: &[f64], v: &[f64], out: &mut [f64]) {
        self.pick(q, v, out);
        self.q.copy_from_slice(q);
        self.v.copy_from_slice(v);
    }

    /// Their rates.
    pub(super) fn rates(&mut self, system: &S, q: &[f64], v: &[f64], vdot: &[f64], out: &mut [f64]) {
        system.rate(q, v, &mut self.qdot);
        self.pick(&self.qdot, vdot, out);
    }

    /// The closed end of the step that is judged.
    pub(super) fn look_at_end(&mut self, q: &[f64], v: &[f64]) {
        let mut end = std::mem::take(&mut self.end);
        self.start(q, v, &mut end);
        self.end = end;
    }

    /// The step that was examined is accepted: the next one starts where it ended.
    pub(super) fn accept(&mut self, out: &mut [f64]) {
        out.copy_from_slice(&self.end);
    }

    /// Whether there is no such row.
    pub(super) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The conditions at t for these quantities, other coordinates and velocities as at the closed state last seen, on which
    /// the rows do not depend.
    fn evaluate(&mut self, system: &S, t: f64, integrated: &[f64]) -> Result<()> {
        let (of_q, of_v) = integrated.split_at(self.coordinates.len());
        self.coordinates.iter().zip(of_q).for_each(|(&i, x)| self.q[i] = *x);
        self.velocities.iter().zip(of_v).for_each(|(&i, x)| self.v[i] = *x);
        system.normalise(&mut self.q);
        system.position(t, &self.q, &mut self.scratch, &mut self.phi, &mut self.c, &mut self.a)
    }

    /// A row at the point last evaluated.
    fn condition(&self, system: &S, row: usize, least: f64) -> ([f64; 2], [f64; 2]) {
        let pattern = system.pattern();
        let mut sizes = [least, self.a[row].abs()];
        let mut rate = 0.0;
        for e in pattern.row(row) {
            let i = pattern.col_idx[e];
            rate += self.c[e] * self.v[i];
            sizes[1] += (self.c[e] * self.v[i]).abs();
            let own = system.structure().coordinates_of(i);
            if own.len() == 1 {
                sizes[0] += (self.c[e] * self.q[own.start]).abs();
            }
        }
        ([self.phi.get(row).copied().unwrap_or(0.0), rate + self.a[row]], sizes)
    }

    /// Them all at this point; `r` has the levels of the closed point last evaluated.
    pub(super) fn conditions(&mut self, r: &Reduction<S>, at: Prescribing, out: &mut [Prescription]) -> Result<()> {
        let system = &*r.system;
        if let Prescribing::Integrated(t, integrated, biased) = at {
            self.evaluate(system, t, integrated)?;
            if biased {
                system.velocity(t, &self.q, &self.v, &mut self.scratch, &mut self.b)?;
            }
        }
        for (&row, out) in self.rows.iter().zip(out) {
            let row_size = r.row_size(row);
            let (violation, sizes) = match at {
                Prescribing::Integrated(..) => self.condition(system, row, row_size),
                Prescribing::Here => {
                    let rate = r.row_times(row, &r.at.v) + r.at.a[row];
                    ([r.at.phi.get(row).copied().unwrap_or(0.0), rate], [0.0; 2])
                }
            };
            let kept = r.planned.partition.rows.contains(&row);
            *out = Prescription { violation, bias: self.b[row], sizes, row_size, kept };
        }
        Ok(())
    }
}
