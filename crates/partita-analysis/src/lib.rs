//! Questions asked of a model: how many ways it can move, which of its joints' rows are superfluous and why, which
//! reactions the motion determines, what it shows along a motion.

pub mod cures;
pub mod determined;
pub mod doubtful;
pub mod error;
#[cfg(test)]
mod examples;
mod geometry;
pub mod instant;
pub mod matrices;
mod misfit;
pub mod mobility;
pub mod outputs;
pub mod poses;
mod reason;
pub mod report;
pub mod run;
pub mod sharing;
mod stress;

pub use determined::determined;
pub use error::AnalysisError;
pub use mobility::{mobility, Mobility, Redundant};
pub use report::{report, Report};
