//! Structured elimination: `C_D x = b` by a plan made once and executed many times without searching.
//!
//! ```text
//! pattern of C, values ──► choice (pivots: little fill, not small) ──► program ──► factor ──► solve
//!                          once per partition                                     every evaluation
//! ```
//!
//! A [`Plan`] stays valid while its pivots keep their size; when one falls below the guard, [`Plan::factor`] reports it
//! and a new plan is needed. Everything executed is a flat list, so that the cost is the count of multiplications.

mod blocks;
mod choice;
mod layout;
mod pattern;
mod plan;
mod program;
mod sparse_lu;

pub use blocks::Block;
pub use pattern::Pattern;
pub use plan::{PivotShrunk, Plan, PlanError, PlanOptions};
pub use program::sparse::SparseScratch;
pub use sparse_lu::{LuFactors, LuOrder, Number};
