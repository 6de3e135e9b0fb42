//! The rows that a reduction keeps, closed by its dependent coordinates (34), or by the least displacement in the mass
//! metric (33).

use super::close::{close, Closed, ClosingScratch, ClosureError, Linearization, Part, Residuals, Rule};
use super::orthogonal::orthogonal_step;
use crate::error::Result;
use crate::record::Correction;
use crate::reduction::Reduction;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::tolerance;

/// Residuals are measured in units of their own round-off. Near the solution two or three steps reach it; far from it
/// digits double late, and next to a singular position, where two solutions meet, each step only halves the distance:
/// 26 for eight digits. Angles of many turns have a larger round-off: rows that decrease no further are closed at ten
/// thousand.
pub const TO_ROUND_OFF: Rule = Rule::new(30, 1.0, tolerance::OPEN_ROUNDINGS);

/// A reduction that closes its rows at a time; at the end the position level is that of the result, the factors those
/// of the last step.
pub struct KeptRows<'a, 's, S: ConstrainedSystem> {
    /// The reduction.
    pub r: &'a mut Reduction<'s, S>,
    t: f64,
    /// The step in the mass metric; none where dependent coordinates move.
    step: Option<Vec<f64>>,
    length: f64,
    closure_error: ClosureError,
    /// Whether the distance from a singular position is needed where the first step is found.
    measures: bool,
    /// Distance from a singular position, where the first step was found.
    pub first_distance: Option<f64>,
}

impl<'a, 's, S: ConstrainedSystem> KeptRows<'a, 's, S> {
    /// By dependent coordinates; where rows have no positions to be solved for, or if `rule` requires, in the mass
    /// metric.
    pub fn new(r: &'a mut Reduction<'s, S>, t: f64, rule: Correction) -> Self {
        let size = r.size();
        let orthogonal = rule == Correction::MassOrthogonal || size.rows != size.holonomic;
        let step = orthogonal.then(Vec::new);
        Self { r, t, step, length: 0.0, closure_error: ClosureError::default(), measures: false, first_distance: None }
    }

    /// Measure the distance from a singular position where the first step is found.
    pub fn measuring(self, measures: bool) -> Self {
        Self { measures, ..self }
    }
}

impl<S: ConstrainedSystem> Residuals for KeptRows<'_, '_, S> {
    fn evaluate(&mut self, q: &[f64]) -> Result<()> {
        self.r.position(self.t, q)?;
        self.closure_error = ClosureError::of(self.r.closure_error_of_rows());
        match self.closure_error.worst.is_finite() {
            true => Ok(()),
            false => Err(SystemError::NotFinite { what: "a loop-closure constraint".into(), t: self.t }),
        }
    }
    fn closure_error(&self, _part: usize) -> ClosureError {
        self.closure_error
    }
}

impl<S: ConstrainedSystem> Linearization for KeptRows<'_, '_, S> {
    fn solve(&mut self, q: &[f64], _parts: &[Part]) -> Result<bool> {
        if let Some(step) = &mut self.step {
            *step = orthogonal_step(self.r, self.t, q)?;
            self.length = self.r.system.travel(step);
            return Ok(true);
        }
        self.r.factor(self.t)?;
        if self.measures && self.first_distance.is_none() {
            self.first_distance = Some(self.r.distance().0);
        }
        let step = self.r.dependent_step();
        self.length = step.length;
        Ok(!step.is_round_off)
    }
    fn length(&self, _part: usize) -> f64 {
        self.length
    }
    fn scale(&mut self, _part: usize, by: f64) {
        match &mut self.step {
            Some(step) => step.iter_mut().for_each(|x| *x *= by),
            None => self.r.scale_dependent_step(by),
        }
    }
    fn advance(&mut self, q: &mut [f64]) {
        match &self.step {
            Some(step) => self.r.system.step(q, step),
            None => self.r.move_dependent(q),
        }
    }
}

/// Close the rows kept to round-off near q, and evaluate the position level there. For set-up: allocates memory.
///
/// # Errors
/// Where nothing can be evaluated, and where C_D is singular.
pub fn close_kept<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &mut [f64]) -> Result<Closed> {
    close(&mut KeptRows::new(r, t, Correction::Partition), q, &TO_ROUND_OFF, &mut ClosingScratch::default())
}
