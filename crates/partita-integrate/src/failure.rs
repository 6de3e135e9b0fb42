//! What can end an integration.

use std::fmt::Display;

/// Why the stepper cannot continue; `E` is the error type of the right-hand side.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StepFailure<E: Display> {
    /// The step became shorter than the time can resolve.
    #[error(
        "the step size fell to {} at t = {t} without an acceptable step{}; {}",
        partita_math::formatted(*h), reason(.last), advice(*t)
    )]
    TooSmall {
        /// Time reached.
        t: f64,
        /// The step size that would have come next (positive).
        h: f64,
        /// The last error of the right-hand side, if it was the obstacle.
        last: Option<E>,
    },
    /// The right-hand side cannot be evaluated where no shorter step would help.
    #[error(
        "the right-hand side failed at t = {t}: {error}; correct the model or the initial state; no step size \
         avoids this"
    )]
    Rhs {
        /// Time of the evaluation.
        t: f64,
        /// The error of the right-hand side.
        error: E,
    },
    /// A stage needed for dense output alone is not evaluable although the step itself is good.
    #[error(
        "no dense output in this step: the right-hand side failed at t = {t}: {error}; reject the step and take a \
        shorter one"
    )]
    Interpolation {
        /// Time of the evaluation.
        t: f64,
        /// The error of the right-hand side.
        error: E,
    },
    /// A number that is not finite, at the start or after every allowed shortening of the step.
    #[error("component {component} is not a finite number at t = {t}; check the start and the forces for a division by zero or an overflow")]
    NotFinite {
        /// Time of the state or of its derivative.
        t: f64,
        /// Index of the first such component.
        component: usize,
    },
}

/// From here on a message says how far times lie apart. Scale: s. Reason: there it is a tenth of a nanosecond, and the
/// shortest step a thousand million times as long as near 0.
const TIMES_FAR: f64 = 1e6;

fn advice(t: f64) -> String {
    let look = "look for a singular position or a jump in the forces near this time";
    match t.abs() < TIMES_FAR {
        true => look.into(),
        false => format!(
            "times so far from 0 are {} s apart, and steps are at least some ten times as long: start the run nearer to \
             t = 0, with loads and drives shifted as much, or {look}",
            partita_math::formatted(f64::EPSILON * t.abs())
        ),
    }
}

fn reason<E: Display>(last: &Option<E>) -> String {
    last.as_ref().map_or_else(String::new, |error| format!(" (last obstacle: {error})"))
}
