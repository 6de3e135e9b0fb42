//! A table prepared for evaluation: zeros omitted, slots converted to offsets in memory.

use crate::combination::Row;
use crate::dense_output::DenseRows;
use crate::step_size::{ErrorNorm, ERROR_MARGIN};
use crate::tableau::{ErrorWeights, Tableau, METHODS};
use std::borrow::Cow;
use std::sync::LazyLock;

#[derive(Clone, Debug)]
enum Estimate {
    None,
    One([Row; 1]),
    FifthAndThird([Row; 2]),
}

/// Error of a step of length h by two estimates, from the squares of their largest components.
#[inline(always)]
pub(crate) fn of_both(h: f64, fifth: f64, third: f64) -> f64 {
    let sum = fifth + 0.01 * third;
    if sum == 0.0 {
        0.0
    } else {
        ERROR_MARGIN * h.abs() * fifth / sum.sqrt()
    }
}

/// The rows of a method.
#[derive(Clone, Debug)]
pub(crate) struct Method {
    /// Row `i` leads to stage `i`.
    pub(crate) stages: Vec<Row>,
    /// The weights `b` of the step.
    pub(crate) end: Row,
    estimate: Estimate,
}

/// The rows of the tables in [`METHODS`], for equations of every size.
static PREPARED: LazyLock<Vec<(Method, DenseRows)>> =
    LazyLock::new(|| METHODS.iter().map(|tableau| (Method::new(tableau), DenseRows::new(tableau))).collect());

/// The rows of a table, of the step and of dense output.
pub(crate) fn prepared(tableau: &'static Tableau) -> (Cow<'static, Method>, Cow<'static, DenseRows>) {
    match METHODS.iter().position(|known| std::ptr::eq(*known, tableau)) {
        Some(i) => (Cow::Borrowed(&PREPARED[i].0), Cow::Borrowed(&PREPARED[i].1)),
        None => (Cow::Owned(Method::new(tableau)), Cow::Owned(DenseRows::new(tableau))),
    }
}

impl Method {
    fn new(tableau: &Tableau) -> Self {
        let estimate = match &tableau.error {
            ErrorWeights::None => Estimate::None,
            ErrorWeights::One(weights) => Estimate::One([Row::new(weights)]),
            ErrorWeights::FifthAndThird { fifth, third } => Estimate::FifthAndThird([Row::new(fifth), Row::new(third)]),
        };
        let stages = tableau.a.iter().map(|weights| Row::new(weights)).collect();
        Self { stages, end: Row::new(tableau.b), estimate }
    }

    /// Rows over all slots whose weights change from step to step.
    pub(super) fn remade(slots: usize) -> Self {
        let row = || Row::full(slots);
        Self { stages: vec![row(), row()], end: row(), estimate: Estimate::One([row()]) }
    }

    /// The weights of the second stage and of the step.
    pub(super) fn set_step(&mut self, stage: &[f64], end: &[f64]) {
        self.stages[1].set(stage);
        self.end.set(end);
    }

    /// The weights of the one estimate.
    pub(super) fn set_estimate(&mut self, weights: &Row) {
        if let Estimate::One([row]) = &mut self.estimate {
            row.set_as(weights);
        }
    }

    /// The rows of two estimates, where there are two.
    pub(crate) fn both(&self) -> Option<&[Row; 2]> {
        match &self.estimate {
            Estimate::FifthAndThird(rows) => Some(rows),
            Estimate::None | Estimate::One(_) => None,
        }
    }

    /// Error of a step of length `h`, with its margin, in units of the tolerance; 0 without an estimate.
    ///
    /// Two estimates of different order in one are of the order of the method where the slopes are smooth. At a corner
    /// all orders are alike, and their combination is the square of a small number, one of which may vanish by chance: the
    /// larger of the two serves there.
    pub(super) fn error(
        &self,
        norm: &ErrorNorm,
        h: f64,
        stages: &[f64],
        (y_old, y_new): (&[f64], &[f64]),
        at_a_corner: bool,
    ) -> f64 {
        match &self.estimate {
            Estimate::None => 0.0,
            Estimate::One(rows) => {
                let [square] = norm.largest_squares(rows, stages, y_old, y_new);
                ERROR_MARGIN * h.abs() * square.sqrt()
            }
            Estimate::FifthAndThird(rows) => {
                let [fifth, third] = norm.largest_squares(rows, stages, y_old, y_new);
                match at_a_corner {
                    true => ERROR_MARGIN * h.abs() * fifth.max(third).sqrt(),
                    false => of_both(h, fifth, third),
                }
            }
        }
    }
}
