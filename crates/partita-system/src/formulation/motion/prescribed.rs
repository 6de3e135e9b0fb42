//! Rows that prescribe a motion, compared with their own derivatives: a prescribed motion must be continuous with its
//! rate.
//!
//! Beside the state the motion integrates `z' = N(q) v` and `w' = v'` of the coordinates and velocities in these rows,
//! from the closed (q, v) at the start of every step. At its end `Φ(t, z)` and `C w + a` are errors of a quadrature,
//! unless Φ or its rate jumped inside: a jump is not visible in the derivatives.                         (W3)

use super::Motion;
use crate::error::Result;
use crate::formulation::{PrescribedGap, PrescribedLevel, PrescribedRows};
use crate::positions::Positions;
use crate::reduction::Reduction;
use crate::system::{ConstrainedSystem, SystemError};
use crate::tangent::Tangent;
use partita_math::tolerance;

/// Times in descriptions and runs are off by this at the most. Scale: roundings of a time. Reason: those of a start, of a
/// length, and of a break of a table each.
const WORST_TIME: f64 = 8.0;

/// A row and what belongs to it.
struct Row {
    row: usize,
    /// Φ and C v + a at the start of the step, which are not zero where conditions are left open.
    violation: [f64; 2],
    /// As `violation`, at the end of the step that is judged.
    open_ahead: [f64; 2],
    /// The error of the quadrature at the end of the step that is judged.
    missed: [f64; 2],
    /// Size of the terms of Φ and of C v + a at the end of that step, and its maximum so far.
    trial_size: [f64; 2],
    size: [f64; 2],
}

/// The rows that prescribe a motion, and the quantities that are integrated for them.
pub(super) struct Prescribed<S: ConstrainedSystem> {
    rows: Vec<Row>,
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
        let none = [0.0; 2];
        let row = |row| Row { row, violation: none, open_ahead: none, missed: none, trial_size: none, size: none };
        Self {
            end: vec![0.0; coordinates.len() + velocities.len()],
            rows: rows.into_iter().map(row).collect(),
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

    /// Start them at (q, v).
    pub(super) fn start(&self, q: &[f64], v: &[f64], out: &mut [f64]) {
        let (of_q, of_v) = out.split_at_mut(self.coordinates.len());
        of_q.iter_mut().zip(&self.coordinates).for_each(|(x, &i)| *x = q[i]);
        of_v.iter_mut().zip(&self.velocities).for_each(|(x, &i)| *x = v[i]);
    }

    /// Their rates.
    pub(super) fn rates(&mut self, system: &S, q: &[f64], v: &[f64], vdot: &[f64], out: &mut [f64]) {
        system.rate(q, v, &mut self.qdot);
        self.start(&self.qdot, vdot, out);
    }

    /// Φ, C, a at t for these quantities, other coordinates and velocities as in (q, v), on which the rows do not
    /// depend.
    fn evaluate(&mut self, system: &S, t: f64, integrated: &[f64], (q, v): (&[f64], &[f64])) -> Result<()> {
        self.q.copy_from_slice(q);
        self.v.copy_from_slice(v);
        let (of_q, of_v) = integrated.split_at(self.coordinates.len());
        self.coordinates.iter().zip(of_q).for_each(|(&i, x)| self.q[i] = *x);
        self.velocities.iter().zip(of_v).for_each(|(&i, x)| self.v[i] = *x);
        system.normalise(&mut self.q);
        system.position(t, &self.q, &mut self.scratch, &mut self.phi, &mut self.c, &mut self.a)
    }

    /// Φ and C v + a of a row at the point last evaluated.
    fn violation(&self, system: &S, row: usize) -> [f64; 2] {
        let pattern = system.pattern();
        let rate = pattern.row(row).map(|e| self.c[e] * self.v[pattern.col_idx[e]]).sum::<f64>() + self.a[row];
        [self.phi.get(row).copied().unwrap_or(0.0), rate]
    }

    /// Size of the terms of a row at the point last evaluated.
    fn sizes(&self, system: &S, row: usize, least: f64) -> [f64; 2] {
        let pattern = system.pattern();
        let mut sizes = [least, self.a[row].abs()];
        for e in pattern.row(row) {
            let i = pattern.col_idx[e];
            sizes[1] += (self.c[e] * self.v[i]).abs();
            let own = system.structure().coordinates_of(i);
            if own.len() == 1 {
                sizes[0] += (self.c[e] * self.q[own.start]).abs();
            }
        }
        sizes
    }

    /// Violations at the start of the motion: rates that were not made consistent are not jumps.
    pub(super) fn open_at_start(&mut self, system: &S, t: f64, integrated: &[f64], at: (&[f64], &[f64])) -> Result<()> {
        if self.is_empty() {
            return Ok(());
        }
        self.evaluate(system, t, integrated, at)?;
        for k in 0..self.rows.len() {
            self.rows[k].violation = self.violation(system, self.rows[k].row);
        }
        Ok(())
    }

    /// Compare the raw end (t, y) of a step with the quadratures.
    pub(super) fn look(&mut self, r: &Reduction<S>, t: f64, integrated: &[f64], q: &[f64]) -> Result<()> {
        self.evaluate(&*r.system, t, integrated, (q, &r.v))?;
        for k in 0..self.rows.len() {
            let row = self.rows[k].row;
            let violation = self.violation(&*r.system, row);
            let sizes = self.sizes(&*r.system, row, r.row_size(row));
            let x = &mut self.rows[k];
            for level in 0..2 {
                x.missed[level] = violation[level] - x.violation[level];
                x.trial_size[level] = x.size[level].max(sizes[level]);
            }
        }
        Ok(())
    }

    /// The closed end of that step, the point last evaluated.
    pub(super) fn look_at_end(&mut self, r: &Reduction<S>, q: &[f64]) {
        let mut end = std::mem::take(&mut self.end);
        self.start(q, &r.v, &mut end);
        self.end = end;
        for x in &mut self.rows {
            let rate = r.row_times(x.row, &r.v) + r.a[x.row];
            x.open_ahead = [r.phi.get(x.row).copied().unwrap_or(0.0), rate];
        }
    }

    /// The step that was examined is accepted: the next one starts where it ended.
    pub(super) fn accept(&mut self, out: &mut [f64]) {
        out.copy_from_slice(&self.end);
        for x in &mut self.rows {
            (x.violation, x.size) = (x.open_ahead, x.trial_size);
        }
    }

    /// Whether there is no such row.
    pub(super) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    /// Index of the integrated quantities of prescribed rows in y.
    pub(super) fn place_of_prescribed(&self) -> usize {
        self.offsets().1 + usize::from(self.observes_work)
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> PrescribedRows for Motion<'s, S, T, P> {
    fn prescribed_gap(&self, level: PrescribedLevel, (relative, absolute): (f64, f64)) -> Option<PrescribedGap> {
        let (r, index) = (self.tangent.seen(), level as usize);
        // relative to a row's size: the absolute part, the round-off of rates that nearly cancel, and that of times
        let time = WORST_TIME * f64::EPSILON * self.monitor.time().abs();
        let rounding = match level {
            PrescribedLevel::Position => time * self.watch.fastest_yet(),
            PrescribedLevel::Rate => {
                tolerance::SOLUTION_ROUNDING * self.watch.fastest_yet() + time * self.checks.strongest()
            }
        };
        let part = |x: &Row| {
            let allowed = relative * x.trial_size[index] + (absolute + rounding) * r.row_size(x.row);
            x.missed[index].abs() / allowed
        };
        // rows left out as redundant are judged by their violations
        let kept = self.prescribed.rows.iter().filter(|x| r.partition.rows.contains(&x.row));
        let worst = kept.max_by(|x, y| part(x).total_cmp(&part(y)))?;
        (part(worst) > 1.0).then(|| PrescribedGap {
            row: worst.row,
            level,
            before: worst.violation[index],
            by: worst.missed[index],
            shorten: part(worst) > tolerance::ERROR_GROWTH && !self.monitor.passes_a_singular_position(),
        })
    }

    fn prescribed_at(&mut self, t: f64, y: &[f64], of: &PrescribedGap) -> Result<[f64; 2]> {
        let r = self.tangent.seen();
        let integrated = &y[self.place_of_prescribed()..];
        self.prescribed.evaluate(&*r.system, t, integrated, (self.positions.q(), &r.v))?;
        let p = &mut self.prescribed;
        let violation = p.violation(&*r.system, of.row)[of.level as usize] - of.before;
        r.system.velocity(t, &p.q, &p.v, &mut p.scratch, &mut p.b)?;
        Ok([violation, p.b[of.row]])
    }

    fn prescribed_jump(&self, t: f64, of: &PrescribedGap, by: f64) -> SystemError {
        let what = &*self.system.structure().rows[of.row].owner;
        SystemError::Jump { what: what.into(), t, by: by.abs(), rate: of.level == PrescribedLevel::Rate }
    }
}
