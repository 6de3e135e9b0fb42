//! The lowest floor: numbers, small dense kernels, structured elimination and spatial algebra.
//!
//! Nothing here has heard of a mechanism. Everything above calls down into it.

pub mod dense;
pub mod elimination;
pub mod factor;
mod formatted;
pub mod least_norm;
pub mod rank;
pub mod scalar;
pub mod spatial;
pub mod tolerance;
mod wide;

pub use formatted::formatted;
