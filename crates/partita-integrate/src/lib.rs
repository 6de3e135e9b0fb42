//! Time integration: the contract of a method of integration, explicit Runge–Kutta methods as checked tables behind it,
//! dense output, exact counters, and the integration of a mechanism.
//!
//! A [`stepper`](stepper::Stepper) is driven from outside, one step at a time, because a mechanism intervenes between
//! two steps: constraint errors are projected away, the independent coordinates may change, events are located. It
//! knows first-order equations `y' = f(t, y)` only; mechanisms enter through [`ode::Ode`].

mod adapter;
pub mod collocation;
mod combination;
pub mod counters;
pub mod crossing_step;
mod dense_output;
pub mod explicit_rk;
pub mod failure;
mod fixed_grid;
pub mod implicit_rk;
pub mod lane_steps;
pub mod march;
pub mod method;
pub mod ode;
pub mod options;
mod placement;
mod rounding;
pub mod scheme;
pub mod simulate;
pub mod singular_start;
pub mod step_log;
pub mod step_size;
pub mod stepper;
mod stiffness;
mod switching;
pub mod tableau;
mod watch;
