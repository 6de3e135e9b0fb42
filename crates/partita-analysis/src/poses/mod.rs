//! Positions for goals (joint coordinates, positions of points, orientations), reached from a given state on its branch.

mod closed;
mod continuation;
mod driven;
mod explain;
mod explicit;
pub(crate) mod field;
mod flood;
mod goal;
mod lanes;
mod lattice;
mod many;
mod messages;
mod nearest;
mod numeric;
mod one;
mod outcome;
mod rates;
mod stationary;

pub use closed::closed;
pub use driven::driven_beyond;
pub use goal::{Goal, Target};
pub use many::{many, Poses};
pub use one::{one, Ask, Met, One};
pub use outcome::Outcome;
pub use rates::with_rates;
pub use stationary::{limit, stationary, Limit, Stationary};

#[cfg(test)]
mod tests;
