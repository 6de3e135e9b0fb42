//! Treatment of points where f cannot be evaluated or is not finite.

use partita_math::tolerance;
use std::fmt::Display;

use super::ExplicitRungeKutta;
use crate::combination::first_not_finite;
use crate::failure::StepFailure;

/// Shortening after a point that cannot be evaluated. Unit: ratio of steps. Reason: near the end of what can be
/// evaluated a half would be too short.
const RETRY_FACTOR: f64 = 0.6;
/// Shortening after a number that is not finite. Unit: ratio of steps. Reason: its cause is unknown.
const NOT_FINITE_FACTOR: f64 = 0.5;

impl ExplicitRungeKutta {
    /// A component that makes the step unusable, if its error or its end is not finite.
    pub(super) fn not_finite(&self, error: f64) -> Option<usize> {
        first_not_finite(&self.y_new).or_else(|| {
            let spoilt = || (0..self.tableau.stages).find_map(|slot| first_not_finite(self.slot(slot)));
            (!error.is_finite()).then(|| spoilt().unwrap_or(0))
        })
    }

    /// The shortest step worth trying here.
    pub(super) fn shortest_step(&self) -> f64 {
        self.shortest.max(tolerance::TEN_ROUNDINGS * self.t_old.abs())
    }

    /// Reject an attempt of length `h` because f was not evaluable. The factor varies a little from time to time, so
    /// that the stages of the repetitions do not meet the same point again.
    pub(super) fn shorten_for_retry(&mut self, h: f64) {
        let wander = (self.counters.retries as f64 * 0.618_033_988_749_895).fract();
        self.step = h.abs() * (RETRY_FACTOR - 0.05 * wander);
        self.controller.hold();
        self.counters.rejected += 1;
        self.counters.retries += 1;
    }

    pub(super) fn shorten_not_finite(&mut self, h: f64) {
        self.step = h.abs() * NOT_FINITE_FACTOR;
        self.controller.hold();
        self.counters.rejected += 1;
        self.counters.not_finite += 1;
    }

    /// Whether the next step is long enough. Else the last obstacle is taken for the reason.
    pub(super) fn check_length<E: Display>(&self, h: f64, last: &mut Option<E>) -> Result<(), StepFailure<E>> {
        if self.step < self.shortest_step() || h == 0.0 {
            return Err(StepFailure::TooSmall { t: self.t_old, h: self.step, last: last.take() });
        }
        Ok(())
    }

    pub(super) fn check_finite<E: Display>(&self, h: f64, component: usize) -> Result<(), StepFailure<E>> {
        if self.step < self.shortest_step() || h == 0.0 {
            return Err(StepFailure::NotFinite { t: self.t_old, component });
        }
        Ok(())
    }
}
