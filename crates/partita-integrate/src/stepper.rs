//! The contract of a method of integration, in two parts.
//!
//! [`Stepper`] evaluates the equation: it attempts steps, concludes and interpolates them. [`StepControl`] is what the
//! integration reads and decides between evaluations. The integration uses these two and no coefficients, so that
//! explicit Runge–Kutta, implicit and multistep methods are interchangeable.
//!
//! ```text
//! start ── attempt ── [correct y_new] ── conclude ── [interpolate] ── commit ── [replace_start, plan] ─┐
//!             ▲                                          │ reject, end_at                              │
//!             └──────────────────────────────────────────┴─────────────────────────────────────────────┘
//! ```
//!
//! A step that is rejected leaves no trace but in the counters: the state at `t_old` is intact.

use crate::counters::Counters;
use crate::failure::StepFailure;
use crate::ode::{Ode, RhsError};
use crate::scheme::Taken;
use std::fmt::{Debug, Display};

/// What [`Stepper::conclude`] found at the end of the step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use]
pub enum Conclusion {
    /// The slope is known there; the step can be interpolated and committed.
    Done,
    /// The slope cannot be evaluated there. The step has been rejected and shortened: attempt again.
    Rejected,
}

/// The step at hand.
#[derive(Debug, Clone, Copy)]
pub struct CurrentStep<'s> {
    /// Start of the step.
    pub t_old: f64,
    /// End of the attempted step; `t_old` before the first attempt.
    pub t_new: f64,
    /// End of the integration.
    pub t_end: f64,
    /// State at `t_old`.
    pub y_old: &'s [f64],
    /// Slope at `t_old`.
    pub dy_old: &'s [f64],
    /// State at `t_new`.
    pub y_new: &'s [f64],
    /// Slope at `t_new` of a concluded step.
    pub dy_new: &'s [f64],
    /// Length of the next attempt (positive), before it is cut to meet an end or a goal.
    pub next: f64,
    /// Whether half of it is still long enough to be tried.
    pub may_shrink: bool,
}

impl CurrentStep<'_> {
    /// Whether the end of the integration is reached.
    pub fn finished(&self) -> bool {
        self.t_old == self.t_end
    }
}

/// Decisions of the caller about the next step.
#[derive(Debug, Clone, Copy)]
pub struct StepPlan {
    /// Length of the next attempt (positive). A fixed step returns with the step after it.
    pub length: f64,
    /// The next step ends here if it would go beyond.
    pub goal: Option<f64>,
}

/// What is read from a stepper and decided between its evaluations. None of it evaluates the equation.
pub trait StepControl: Debug + Send + Sync {
    /// The step at hand.
    fn current(&self) -> CurrentStep<'_>;
    /// The work done since the stepper was made.
    fn counters(&self) -> &Counters;
    /// How the next step is to be taken; `commit` and `start` make plans of their own.
    fn plan(&mut self, plan: &StepPlan);
    /// Natural size of each component, the unit of absolute tolerances from the next step on; 1 unless set.
    fn set_sizes(&mut self, sizes: &[f64]);
    /// Size that the error of the observed component is compared with at least, from the next step on.
    fn set_reference(&mut self, _size: f64) {}
    /// Replace the state at `t_old` and its slope: before a step is attempted, or after `commit`, `reject` or `end_at`.
    /// The time `t` may be an earlier one, to integrate from there again. The method's memory of earlier steps is
    /// cleared, unless time and slope are those that it has: the motion goes on.
    fn replace_start(&mut self, t: f64, y: &[f64], dy: &[f64]);
    /// What the method has to say about its steps, in sentences.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
    /// Make the end of the concluded step the start of the next one, and choose its length.
    fn commit(&mut self);
    /// Reject the attempted or concluded step; the next attempt is `factor` times as long.
    fn reject(&mut self, factor: f64);
    /// Reject the concluded step: it is repeated and ends at `t` inside it. The planned length is kept.
    fn end_at(&mut self, t: f64);
    /// As [`end_at`](Self::end_at), where the slopes have a corner: neither the step that ends there nor the next one is
    /// as smooth as estimates of high order assume.
    fn end_at_corner(&mut self, t: f64) {
        self.end_at(t);
    }
}

/// Concluded steps as numbers, to be interpolated later.
pub trait StepStorage {
    /// Append what [`interpolate`](Stepper::interpolate) reads of the concluded step besides its times, without the slopes
    /// that it evaluates. False where steps cannot be loaded again.
    fn save(&self, _out: &mut Vec<f64>) -> bool {
        false
    }
    /// Append the slopes that `interpolate` has evaluated in this step; nothing where there are none.
    fn save_extra(&self, _out: &mut Vec<f64>) {}
    /// The step that was saved becomes the concluded one again, to be interpolated; `ends` are its times, `extra` the slopes
    /// of `save_extra`, or nothing.
    fn load(&mut self, _ends: (f64, f64), _step: &[f64], _extra: &[f64]) {}
    /// How the concluded step was taken; none where steps cannot be loaded again.
    fn taken(&self) -> Option<Taken> {
        None
    }
}

/// Corrects the end of a step and leaves its slope: `end(t, y, dy, known)`, where `known` states that dy contains the
/// slope at y, the last one evaluated. The answer is whether the equation was evaluated.
pub type StepEnd<'e, E> = &'e mut dyn FnMut(f64, &mut [f64], &mut [f64], bool) -> Result<bool, RhsError<E>>;

/// A method of integration at work on one equation, whose evaluations fail with `E`.
///
/// Memory is taken when the stepper is made; steps allocate nothing.
pub trait Stepper<E: Display>: StepControl + StepStorage {
    /// Set the state, evaluate f there and choose the first step towards `t_end`, which may lie on either side. The
    /// counters are kept.
    ///
    /// # Errors
    /// A start that is not finite, or where f cannot be evaluated.
    ///
    /// # Panics
    /// If `y` has not the dimension that the stepper was made for.
    fn start(&mut self, ode: &mut dyn Ode<Error = E>, t: f64, y: &[f64], t_end: f64) -> Result<(), StepFailure<E>>;

    /// Try steps, shorter and shorter, until one is acceptable; its end is `t_new`, `y_new` of
    /// [`current`](StepControl::current).
    ///
    /// # Errors
    /// See [`StepFailure`]. The state at `t_old` is intact afterwards.
    fn attempt(&mut self, ode: &mut dyn Ode<Error = E>) -> Result<(), StepFailure<E>>;

    /// Let `end` correct the end of the attempted step and evaluate the slope there, the start of the next step. Where
    /// f is not evaluable, or not finite, the step is rejected and shortened: [`Conclusion::Rejected`].
    ///
    /// # Errors
    /// See [`StepFailure`].
    fn conclude(&mut self, end: StepEnd<'_, E>) -> Result<Conclusion, StepFailure<E>>;

    /// The state at `t` inside the concluded step, into `out`; exact at both ends, corrections included.
    ///
    /// # Errors
    /// [`StepFailure::Interpolation`] if an additional stage of dense output cannot be evaluated.
    ///
    /// # Panics
    /// If `out` has not the dimension that the stepper was made for.
    fn interpolate(&mut self, ode: &mut dyn Ode<Error = E>, t: f64, out: &mut [f64]) -> Result<(), StepFailure<E>>;
}
