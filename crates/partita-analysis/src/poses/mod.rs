//! Positions for goals: coordinates of any joint, places of points, met from a given state on its branch.

mod field;
mod goal;
mod many;
mod nearest;
mod way;
mod words;

pub use goal::{Goal, Target};
pub use many::{many, Outcome, Poses};
