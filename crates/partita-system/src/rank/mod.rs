//! One verdict on rank: which loop closures are independent, redundant everywhere, or dependent in one position alone.
//!                                                                                                               (T3)
//!
//! A gap between singular values at one position decides nothing. Cases that pivots and a short exact motion decide are
//! in `exact`; the others are decided by finite motions, by levels of singular values, in `branch`.

pub mod branch;
pub mod exact;
pub mod kernel;
#[cfg(test)]
mod tests;

pub use crate::manifold::truncated::{Cut, Motions};
pub use branch::{Branch, BranchPoint};
pub use exact::{exact, pivots, weakest, Exact};
pub use kernel::{Closed, Kernel};
