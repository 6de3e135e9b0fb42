//! The state between the two ends of a step.
//!
//! All methods here share one form. With `θ` from 0 to 1 along the step and `Δ = y_new − y_old`,
//!
//! ```text
//! y = y_old + θ (F0 + (1−θ) (F1 + θ (F2 + (1−θ) (F3 + θ (F4 + …)))))
//! F0 = Δ,   F1 = h f_old − Δ,   F2 = 2Δ − h (f_old + f_new),   F3, F4, … = h Σ d_j k_j
//! ```
//!
//! `F0` to `F2` are the cubic of Hermite: whatever the `d`, value and slope are right at both ends, also after the
//! end was corrected. `F3` alone is Shampine's quartic for Dormand–Prince 5 and the free interpolant of Tsitouras;
//! `F3` to `F6` are the septic of Hairer, Nørsett and Wanner for DOP853.

use crate::combination::{Row, TILE};
use crate::tableau::Tableau;
use std::borrow::Cow;

/// A stage that only dense output needs.
#[derive(Clone, Debug)]
pub(crate) struct ExtraStage {
    pub(crate) row: Row,
    pub(crate) node: f64,
    pub(crate) slot: usize,
}

/// The stages and rows of a table.
#[derive(Clone, Debug)]
pub(crate) struct DenseRows {
    pub(crate) extra: Vec<ExtraStage>,
    pub(crate) rows: Vec<Row>,
    /// Slots of the step that these rows and the cubic combine.
    slots: Vec<usize>,
}

impl DenseRows {
    pub(crate) fn new(tableau: &Tableau) -> Self {
        let dense = &tableau.dense;
        let extra = (dense.nodes.iter().zip(dense.a).enumerate())
            .map(|(i, (&node, row))| ExtraStage { row: Row::new(row), node, slot: tableau.end_slot() + 1 + i })
            .collect();
        let used =
            |slot: &usize| dense.a.iter().chain(dense.weights).any(|row| row.get(*slot).is_some_and(|w| *w != 0.0));
        let end = tableau.end_slot();
        let slots = (0..=end).filter(|slot| *slot == 0 || *slot == end || used(slot)).collect();
        Self { extra, rows: dense.weights.iter().map(|row| Row::new(row)).collect(), slots }
    }
}

/// F0, F1, F2 of a component.
#[inline(always)]
pub(crate) fn hermite(h: f64, [y_old, y_new]: [f64; 2], [f_old, f_new]: [f64; 2]) -> [f64; 3] {
    let delta = y_new - y_old;
    [delta, h * f_old - delta, 2.0 * delta - h * (f_old + f_new)]
}

/// `F0 + (1−θ) (F1 + θ (F2 + …))` for some components, up to the last F.
#[inline(always)]
pub(crate) fn nested<'a, const N: usize>(theta: f64, last: usize, f: impl Fn(usize) -> &'a [f64]) -> [f64; N] {
    let mut sum = [0.0; N];
    for j in (0..=last).rev() {
        let factor = if j % 2 == 0 { 1.0 - theta } else { theta };
        let f = &f(j)[..N];
        for lane in 0..N {
            sum[lane] = f[lane] + factor * sum[lane];
        }
    }
    sum
}

/// What is known of a step between its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Known {
    /// The stages of the step alone.
    Stages,
    /// Those that only dense output needs as well.
    ExtraStages,
    /// The coefficients.
    Coefficients,
}

/// Coefficients `F` of one step.
#[derive(Debug)]
pub(crate) struct DenseOutput {
    table: Cow<'static, DenseRows>,
    pub(crate) known: Known,
    stride: usize,
    coefficients: Vec<f64>,
}

impl DenseOutput {
    pub(crate) fn new(table: Cow<'static, DenseRows>, stride: usize) -> Self {
        let coefficients = vec![0.0; (3 + table.rows.len()) * stride];
        Self { table, known: Known::Stages, stride, coefficients }
    }

    /// This many rows over all `count` slots, whose weights change from step to step; of them these are combined.
    pub(crate) fn remade(rows: usize, count: usize, slots: &[usize], stride: usize) -> Self {
        let rows = (0..rows).map(|_| Row::full(count)).collect();
        Self::new(Cow::Owned(DenseRows { extra: Vec::new(), rows, slots: slots.to_vec() }), stride)
    }

    /// Slots of the step that it combines.
    pub(crate) fn slots(&self) -> &[usize] {
        &self.table.slots
    }

    /// The weights of such rows.
    pub(crate) fn set_rows<const N: usize>(&mut self, weights: &[[f64; N]]) {
        self.table.to_mut().rows.iter_mut().zip(weights).for_each(|(row, weights)| row.set(weights));
    }

    /// The stages that it needs besides those of the step.
    pub(crate) fn extra(&self) -> &[ExtraStage] {
        &self.table.extra
    }

    /// Compute `F` from the stages, the extra ones included; `f_new` is in `end_slot`.
    pub(crate) fn fill(&mut self, stages: &[f64], end_slot: usize, h: f64, y_old: &[f64], y_new: &[f64]) {
        let n = self.stride;
        let (f_old, f_new) = (&stages[..n], &stages[end_slot * n..(end_slot + 1) * n]);
        let (f0, rest) = self.coefficients.split_at_mut(n);
        let (f1, rest) = rest.split_at_mut(n);
        let (f2, rest) = rest.split_at_mut(n);
        for i in 0..n {
            [f0[i], f1[i], f2[i]] = hermite(h, [y_old[i], y_new[i]], [f_old[i], f_new[i]]);
        }
        // a mechanism without a degree of freedom has a state without components
        for (row, f) in self.table.rows.iter().zip(rest.chunks_exact_mut(n.max(1))) {
            row.scaled(stages, h, f);
        }
        self.known = Known::Coefficients;
    }

    /// The state at `theta`, into `out` (without padding).
    pub(crate) fn evaluate(&self, theta: f64, y_old: &[f64], out: &mut [f64]) {
        let last = 2 + self.table.rows.len();
        for (i, out) in out.chunks_mut(TILE).enumerate() {
            let at = i * TILE;
            let tile = |j: usize| &self.coefficients[j * self.stride + at..j * self.stride + at + TILE];
            let sum: [f64; TILE] = nested(theta, last, tile);
            for (lane, out) in out.iter_mut().enumerate() {
                *out = y_old[at + lane] + theta * sum[lane];
            }
        }
    }
}
