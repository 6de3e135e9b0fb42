//! Positions for goals (joint coordinates, positions of points), reached from a given state on its branch.

mod closed;
mod continuation;
mod driven;
mod explain;
mod field;
mod goal;
mod many;
mod messages;
mod nearest;
mod one;
mod rates;

pub use closed::closed;
pub use driven::driven_beyond;
pub use goal::{Goal, Target};
pub use many::{many, Outcome, Poses};
pub use one::{one, Ask, Met, One};
pub use rates::with_rates;

#[cfg(test)]
mod tests;
