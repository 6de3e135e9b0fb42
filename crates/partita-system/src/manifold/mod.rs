//! The manifold of closed positions: reaching it ([`close()`]) and moving along it ([`follow()`]).
//!
//! A caller that needs a closed position defines which rows close it and how a linear step is found
//! ([`Linearization`]); one that needs a path of them defines its direction ([`Curve`]). The loops, their tests and
//! reports are here, and the linear steps: `kept_rows` by dependent coordinates (34) or in the mass metric (33),
//! `least_change` in a diagonal metric, damped and of any rank, `truncated` by the pivots above a level.

pub mod close;
pub mod follow;
pub mod kept_rows;
pub mod least_change;
pub mod orthogonal;
pub mod scaled;
#[cfg(test)]
pub(crate) mod tests;
pub mod truncated;

pub use close::{close, Closed, ClosingScratch, ClosureError, Ending, Linearization, Part, Residuals, Rule};
pub use follow::{follow, leap, At, Curve, End, Followed, Pace, Visit};
