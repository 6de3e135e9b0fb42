//! The times of an integration with a fixed step.

use partita_math::tolerance;

/// The grid `origin + i h` up to `end`, which is met exactly.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FixedGrid {
    h: f64,
    origin: f64,
    end: f64,
    next: u64,
    total: u64,
}

impl FixedGrid {
    /// Grid from `origin` to `end` with steps of length `h > 0`, the last one shorter where they do not fit.
    pub(crate) fn new(h: f64, origin: f64, end: f64) -> Self {
        let span = end - origin;
        let steps = span.abs() / h;
        let total = (steps - tolerance::EQUAL.max(tolerance::ROUNDING * steps)).ceil().max(1.0);
        Self { h: h.copysign(span), origin, end, next: 1, total: total as u64 }
    }

    /// Length of the steps.
    pub(crate) fn step(&self) -> f64 {
        self.h.abs()
    }

    /// The next point. Multiples of `h` are computed each time, so that their errors do not accumulate.
    pub(crate) fn goal(&self) -> f64 {
        if self.next < self.total {
            self.origin + self.next as f64 * self.h
        } else {
            self.end
        }
    }

    /// Note that `t` was reached: the next point, or a time before it after an obstacle.
    pub(crate) fn reached(&mut self, t: f64) {
        if t == self.goal() {
            self.next += 1;
        }
    }
}
