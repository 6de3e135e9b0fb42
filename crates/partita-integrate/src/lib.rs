//! Marching in time: explicit Runge–Kutta methods as checked tables, one stepper that runs them all, dense output and
//! exact counters.
//!
//! The stepper is driven from outside, one step at a time, because a mechanism needs a word between two steps: the
//! remainder of the constraints is projected away, the independent coordinates may change, events are located.
//!
//! ```text
//! start ── attempt ── [correct y_new] ── conclude ── [interpolate, replace] ── commit ─┐
//!             ▲                                          │ reject                      │
//!             └──────────────────────────────────────────┴─────────────────────────────┘
//! ```
//!
//! It knows first-order equations `y' = f(t, y)` only; mechanisms enter through [`ode::Ode`].

mod combination;
pub mod counters;
mod dense_output;
pub mod explicit_rk;
pub mod failure;
pub mod ode;
pub mod options;
pub mod simulate;
pub mod singular_start;
pub mod step_size;
pub mod tableau;
