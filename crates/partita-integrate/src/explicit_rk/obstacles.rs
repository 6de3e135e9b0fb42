//! Treatment of points where f cannot be evaluated or is not finite.

use super::ExplicitRungeKutta;
use crate::combination::first_not_finite;

impl ExplicitRungeKutta {
    /// A component that makes the step unusable, if its error or its end is not finite.
    pub(super) fn not_finite(&self, error: f64) -> Option<usize> {
        first_not_finite(&self.y_new).or_else(|| {
            let spoilt = || (0..self.tableau.stages).find_map(|slot| first_not_finite(self.slot(slot)));
            (!error.is_finite()).then(|| spoilt().unwrap_or(0))
        })
    }

    /// Reject an attempt of length `h` because f was not evaluable.
    pub(super) fn shorten_for_retry(&mut self, h: f64) {
        self.at.shorten_for_retry(h, self.counters.retries);
        self.controller.hold();
        self.counters.rejected += 1;
        self.counters.retries += 1;
    }

    pub(super) fn shorten_not_finite(&mut self, h: f64) {
        self.at.shorten_not_finite(h);
        self.controller.hold();
        self.counters.rejected += 1;
        self.counters.not_finite += 1;
    }
}
