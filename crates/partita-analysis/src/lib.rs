//! Analysis of a model: its degrees of freedom, which constraint rows of its joints are redundant and why, which
//! reactions the motion determines, and the outputs along a motion.

pub mod actuated;
pub mod determined;
pub mod ensemble;
pub mod equilibrium;
pub mod error;
#[cfg(test)]
mod examples;
mod geometric_error;
mod geometry;
pub mod identification;
pub mod instant;
pub mod inverse;
pub mod kinematic;
pub mod linear;
pub mod maps;
pub mod matrices;
pub mod mobility;
pub mod outputs;
pub mod plausibility;
pub mod poses;
mod reason;
pub mod remedies;
pub mod report;
pub mod run;
pub mod sensitivity;
pub mod sharing;
mod stress;

pub use determined::determined;
pub use error::AnalysisError;
pub use mobility::{mobility, Mobility, Redundant};
pub use report::{report, Report};
