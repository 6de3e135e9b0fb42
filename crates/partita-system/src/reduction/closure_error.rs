//! Constraint violation relative to the effect of a large displacement, so that units and sizes cancel.

use super::{largest, velocity_residuals, Reduction};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::tolerance;

/// A step with a larger violation is too long, whatever its tolerance. Scale: size of the row. Reason: a step drifts by
/// its error, which is small.
const LARGEST_DRIFT: f64 = 1e-3;

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// Closure error of row i under a large displacement: 1 for an angle, a length for a displacement.
    pub fn row_size(&self, i: usize) -> f64 {
        self.scale.row_size[i]
    }

    /// Rows left out as redundant, ascending.
    pub fn dropped(&self) -> &[usize] {
        &self.planned.dropped
    }

    /// Largest |Φ_i| relative to its row's size, and its row; NaN counts as infinite.
    pub fn gap(&self) -> (f64, usize) {
        worst(self.at.phi.iter().zip(&self.scale.row_size).map(|(x, size)| x / size).enumerate())
    }

    /// As `gap`, over the rows that were dropped.
    pub fn dropped_gap(&self) -> (f64, usize) {
        let positions = self.planned.dropped.iter().filter(|&&i| i < self.size.holonomic);
        worst(positions.map(|&i| (i, self.at.phi[i] / self.scale.row_size[i])))
    }

    /// As `gap`, over the rows that were kept.
    pub fn gap_of_kept(&self) -> f64 {
        let positions = self.planned.partition.rows.iter().filter(|&&i| i < self.size.holonomic);
        worst(positions.map(|&i| (i, self.at.phi[i] / self.scale.row_size[i]))).0
    }

    /// Largest |C v + a|, and [`velocity_gap`](Self::velocity_gap), in one pass.
    pub fn velocity_violations(&self) -> (f64, (f64, usize)) {
        let mut largest: f64 = 0.0;
        let violation = velocity_residuals(self.system.pattern(), &self.at.c, &self.at.v, &self.at.a);
        let seen = violation.zip(&self.scale.row_size).enumerate().map(|(i, (x, size))| {
            largest = if x.is_nan() { f64::INFINITY } else { largest.max(x.abs()) };
            (i, x / size)
        });
        let gap = worst(seen);
        (largest, gap)
    }

    /// Largest |C v + a|_i over its row's size [1/s], and its row.
    pub fn velocity_gap(&self) -> (f64, usize) {
        let violation = velocity_residuals(self.system.pattern(), &self.at.c, &self.at.v, &self.at.a);
        worst(violation.zip(&self.scale.row_size).map(|(x, size)| x / size).enumerate())
    }

    /// As `velocity_gap`, over the rows that were dropped.
    pub fn dropped_velocity_gap(&self) -> (f64, usize) {
        worst(
            self.planned
                .dropped
                .iter()
                .map(|&i| (i, (self.row_times(i, &self.at.v) + self.at.a[i]) / self.scale.row_size[i])),
        )
    }

    /// Largest |C v' + b|_i over its row's size [1/s²] of the rows that were dropped, and its row.      (S5)
    pub fn dropped_acceleration_gap(&self, vdot: &[f64]) -> (f64, usize) {
        worst(
            self.planned
                .dropped
                .iter()
                .map(|&i| (i, (self.row_times(i, vdot) + self.at.b[i]) / self.scale.row_size[i])),
        )
    }

    /// Largest |C v' + b|_i over its row's size [1/s²], and its row.
    pub fn acceleration_gap(&self, vdot: &[f64]) -> (f64, usize) {
        let violation =
            velocity_residuals(self.system.pattern(), &self.at.c, vdot, &self.at.b).zip(&self.scale.row_size);
        worst(violation.map(|(x, size)| x / size).enumerate())
    }

    /// Row i of C times x.
    pub fn row_times(&self, i: usize, x: &[f64]) -> f64 {
        let pattern = self.system.pattern();
        pattern.row(i).map(|e| self.at.c[e] * x[pattern.col_idx[e]]).sum()
    }

    /// The current fastest rate [1/s]: of velocities in characteristic displacements, and of the time-dependent
    /// conditions themselves.
    pub fn fastest(&self) -> f64 {
        let moved = largest(self.at.v.iter().zip(&self.scale.displacement).map(|(v, displacement)| v / displacement));
        moved.max(largest(self.at.a.iter().zip(&self.scale.row_size).map(|(a, size)| a / size)))
    }

    /// The current reference energy: of the heaviest coordinate, moved by its characteristic displacement in a second.
    pub fn natural_energy(&self) -> f64 {
        let energies = self
            .scale
            .s2
            .iter()
            .zip(&self.scale.displacement)
            .map(|(s2, displacement)| displacement * displacement / s2);
        largest(energies).max(f64::MIN_POSITIVE)
    }

    /// The current strongest acceleration [1/s²], as `fastest`.
    pub fn strongest(&self, vdot: &[f64]) -> f64 {
        let moved = largest(vdot.iter().zip(&self.scale.displacement).map(|(v, displacement)| v / displacement));
        moved.max(largest(self.at.b.iter().zip(&self.scale.row_size).map(|(b, size)| b / size)))
    }

    /// Whether at the end of a step a drive or a user function is violated by more than drift explains.
    ///
    /// # Errors
    /// `Jump`; a shorter step drifts less, and where none is short enough the condition itself jumps.
    pub fn jumped(&self, t: f64) -> Result<(), SystemError> {
        let given = (0..self.size.holonomic).filter(|&i| self.system.structure().rows[i].may_jump);
        let (part, row) = worst(given.map(|i| (i, self.at.phi[i] / self.scale.row_size[i])));
        if part <= LARGEST_DRIFT {
            return Ok(());
        }
        let (what, by) = (&*self.system.structure().rows[row].owner, part * self.scale.row_size[row]);
        Err(SystemError::Jump { what: what.into(), t, by, rate: false })
    }

    /// The dropped row i compared with the kept rows on which it depends: which of them contradict each other. Needs
    /// the factors of C_D.
    pub fn contradiction(&mut self, t: f64, row: usize, off: f64, unit: &'static str) -> SystemError {
        let pattern = self.system.pattern();
        let mut of_row = vec![0.0; self.size.nv];
        pattern.row(row).for_each(|e| of_row[pattern.col_idx[e]] = self.at.c[e]);
        // C_Dᵀ w = (C_i)_D: the row as a sum of kept ones
        let mut w: Vec<f64> = self.planned.partition.dependent.iter().map(|&i| of_row[i]).collect();
        self.solve_transposed(&mut w);
        let rows = &self.system.structure().rows;
        let who = &*rows[row].owner;
        let mut whom: Vec<(bool, &str)> = Vec::new();
        for (w, &kept) in w.iter().zip(&self.planned.partition.rows) {
            let owner = (!rows[kept].is_drive, &*rows[kept].owner);
            let part = w.abs() * self.scale.row_size[kept] / self.scale.row_size[row];
            if part > tolerance::TAKES_PART && owner.1 != who && !whom.contains(&owner) {
                whom.push(owner);
            }
        }
        whom.sort(); // drives first: they are what is easily changed
        let whom_drives = whom.iter().any(|x| !x.0);
        let unit = match (rows[row].is_angle, rows[row].displacement.is_some()) {
            (true, _) => format!("rad{unit}"),
            (false, true) => format!("m{unit}"),
            _ => format!("(in its own unit){unit}"),
        };
        SystemError::Contradiction {
            t,
            who: who.into(),
            whom: whom.into_iter().map(|x| x.1.to_string()).collect(),
            gap: off * self.scale.row_size[row],
            unit: unit.into(),
            drive: rows[row].is_drive || whom_drives,
        }
    }
}

/// The largest |x| and its index; NaN counts as infinite.
fn worst(all: impl Iterator<Item = (usize, f64)>) -> (f64, usize) {
    all.fold((0.0, 0), |best: (f64, usize), (i, x)| {
        let x = if x.is_nan() { f64::INFINITY } else { x.abs() };
        if x > best.0 {
            (x, i)
        } else {
            best
        }
    })
}
