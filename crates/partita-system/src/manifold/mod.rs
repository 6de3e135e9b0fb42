//! The manifold of closed positions: getting onto it ([`close()`]) and along it ([`follow()`]).
//!
//! Whoever needs a closed position says which rows close it and how a linear step is found ([`Linearization`]); whoever
//! needs a path of them says which way it goes ([`Curve`]). The loops, their tests and what they report are here, and
//! with them the linear steps: `kept_rows` by dependent coordinates (34) or in the mass metric (33), `least_change` in
//! a diagonal metric, damped and of any rank, `truncated` by the pivots above a level.

pub mod close;
pub mod follow;
pub mod kept_rows;
pub mod least_change;
pub mod orthogonal;
pub mod scaled;
#[cfg(test)]
pub(crate) mod tests;
pub mod truncated;

pub use close::{close, Closed, Ending, Linearization, Open, Part, Residuals, Room, Rule};
pub use follow::{follow, leap, At, Curve, End, Followed, Pace, Visit};
