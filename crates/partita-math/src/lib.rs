//! The lowest layer: numbers, small dense kernels, structured elimination and spatial algebra.
//!
//! Nothing here knows mechanisms. All other crates depend on it.

// the suite that other crates share names this one
#[cfg(test)]
extern crate self as partita_math;

pub mod dense;
pub mod elimination;
pub mod expansion;
pub mod factor;
mod formatted;
pub mod least_norm;
pub mod program;
pub mod quadratic;
pub mod rank;
pub mod ratio;
pub mod scalar;
pub mod sorting;
pub mod spatial;
pub mod tolerance;
pub mod wide;
pub mod zero;

pub use formatted::formatted;
