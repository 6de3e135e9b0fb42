//! Which of redundant rows are kept, again: exchanges by the volume of the rows, as P6 exchanges coordinates.
//!
//! ```text
//! c_j = sum_k w_jk c_k,   C_D^T w_j = (c_j)_D,   vol(rows with j in the place of k) = |w_jk| vol(rows kept)
//! ```
//!
//! Rows are scaled by the closure error of a large displacement: a weak row is not normalised to length 1.

use super::{Reduction, NONE};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::elimination::SparseScratch;
use partita_math::tolerance;

/// A loop closure has this weight relative to a drive, and a drive relative to a row that holds for velocities alone.
/// Unit: ratio of volumes. Reason: kept loop closures close the positions, and prescribed motion is distinguished from
/// possible motion; a drive replaces a loop closure only where closures lose rank that the drive provides.
const PRECEDENCE: f64 = 8.0;

/// A row left out that replaces a kept one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowExchange {
    /// The row that enters.
    pub enters: usize,
    /// The row that leaves.
    pub leaves: usize,
    /// Growth of the volume of the kept rows.
    pub gain: f64,
}

/// Memory for examining the rows left out.
#[derive(Clone, Debug, Default)]
pub(super) struct RowScratch {
    /// Step of the elimination of each dependent velocity; `NONE` for the others.
    step_of: Vec<u32>,
    /// Dependent entries of a row, by steps.
    entries: Vec<(usize, f64)>,
    sparse: SparseScratch,
    weights: Vec<(usize, f64)>,
    /// Kept rows, by steps, that take part in an exchange found.
    taken: Vec<bool>,
    found: Vec<RowExchange>,
}

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// Lay out the memory for the choice just adopted.
    pub(super) fn lay_out_rows(&mut self) {
        if self.planned.dropped.is_empty() {
            return;
        }
        let memory = &mut self.row_memory;
        memory.step_of.clear();
        memory.step_of.resize(self.size.nv, NONE);
        self.planned.partition.dependent.iter().enumerate().for_each(|(step, &i)| memory.step_of[i] = step as u32);
        memory.taken.clear();
        memory.taken.resize(self.planned.rank, false);
        memory.sparse = SparseScratch::new(self.planned.rank);
        memory.entries.reserve(self.planned.rank);
        memory.weights.reserve(self.planned.rank);
        memory.found.reserve(self.planned.dropped.len());
    }

    /// Weight of a row in the choice: its precedence over its size.
    fn row_weight(&self, i: usize) -> f64 {
        let precedence = if i >= self.size.holonomic {
            1.0
        } else if self.system.structure().rows[i].is_drive {
            PRECEDENCE
        } else {
            PRECEDENCE * PRECEDENCE
        };
        precedence / self.scale.row_size[i]
    }

    /// Exchanges of rows that gain, with the current factors: at most one of each row left out, such that none changes
    /// the gain of another. Cost: the rows of the factors that rows left out touch.
    fn profitable_row_swaps(&mut self) -> &[RowExchange] {
        let mut memory = std::mem::take(&mut self.row_memory);
        memory.found.clear();
        memory.taken.fill(false);
        let pattern = self.system.pattern();
        if let Some(plan) = self.planned.plan.as_ref().filter(|_| self.planned.rank > 0) {
            for &enters in self.planned.dropped.iter().filter(|&&i| self.scale.row_scale[i] > 0.0) {
                memory.entries.clear();
                let steps = pattern.row(enters).map(|e| (memory.step_of[pattern.col_idx[e]], self.at.c[e]));
                memory.entries.extend(steps.filter(|x| x.0 != NONE).map(|(step, c)| (step as usize, c)));
                plan.solve_transposed_sparse(
                    &self.at.factors,
                    &memory.entries,
                    &mut memory.sparse,
                    &mut memory.weights,
                );
                let weight = self.row_weight(enters);
                let gain =
                    |&(step, w): &(usize, f64)| w.abs() * weight / self.row_weight(self.planned.partition.rows[step]);
                let best = memory.weights.iter().map(|x| (x.0, gain(x))).max_by(|a, b| a.1.total_cmp(&b.1));
                let Some((step, gain)) = best.filter(|x| x.1 > tolerance::DOUBLED) else { continue };
                if memory.weights.iter().any(|x| memory.taken[x.0]) {
                    continue; // the next look sees what is left of its gain
                }
                memory.weights.iter().for_each(|x| memory.taken[x.0] = true);
                memory.found.push(RowExchange { enters, leaves: self.planned.partition.rows[step], gain });
            }
        }
        self.row_memory = memory;
        &self.row_memory.found
    }

    /// Whether among redundant rows others have become better than those kept. To be called after `factor`.
    ///
    /// Kept rows lose rank in positions where the mechanism is regular; others replace them before.
    pub fn rows_fade(&mut self) -> bool {
        !self.planned.dropped.is_empty() && !self.profitable_row_swaps().is_empty()
    }

    /// Exchange redundant rows at the last position until there is no further gain; the partition is unchanged. True if
    /// rows were exchanged; needs the factors, and ends with those of the new rows.
    pub fn exchange_rows(&mut self, t: f64) -> Result<bool, SystemError> {
        let before = self.counts.choices;
        // each exchange multiplies the volume, so the loop ends; the bound is for round-off
        for _ in 0..4 * self.planned.dropped.len() {
            let pairs = self.profitable_row_swaps().to_vec();
            if pairs.is_empty() {
                break;
            }
            let kept = self.rows_in_use();
            let mut next = kept.clone();
            pairs.iter().for_each(|x| (next[x.enters], next[x.leaves]) = (true, false));
            let independent = self.planned.partition.independent.clone();
            self.refresh_row_scales();
            if self.plan_with(t, &independent, &next).is_err() {
                // the rule and the elimination disagree by round-off: keep the present rows
                self.plan_with(t, &independent, &kept)?;
                self.factor(t)?;
                break;
            }
            self.factor(t)?;
        }
        Ok(self.counts.choices > before)
    }

    /// The rows in use, marked among all.
    pub(super) fn rows_in_use(&self) -> Vec<bool> {
        let mut rows = vec![false; self.size.rows];
        self.planned.partition.rows.iter().for_each(|&i| rows[i] = true);
        rows
    }

    /// Keep other rows for the same partition, at the last position; evaluates the tangent there.
    pub fn renew_rows(&mut self, t: f64) -> Result<(), SystemError> {
        if self.factor(t).is_err() || !self.exchange_rows(t)? {
            // no exchange leads to the requested rows
            let independent = self.planned.partition.independent.clone();
            self.refresh_row_scales();
            let rows = self.eligible_rows();
            self.plan_with(t, &independent, &rows)?;
        }
        self.tangent(t)
    }

    /// Keep these rows for the same partition, at the last position; evaluates the tangent there. Where they do not
    /// determine the dependent velocities the rows in use are kept.
    pub fn keep_rows(&mut self, t: f64, rows: &[usize]) -> Result<(), SystemError> {
        let mut eligible = vec![false; self.size.rows];
        rows.iter().for_each(|&i| eligible[i] = true);
        let independent = self.planned.partition.independent.clone();
        self.refresh_row_scales();
        self.plan_with(t, &independent, &eligible)?;
        self.tangent(t)
    }
}
