//! Events: functions of the motion whose zeros an integration finds and reports.

use crate::error::Result;
use crate::record::Output;
use crate::watched::Reading;
use std::fmt::Debug;

/// The crossings of zero that count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Direction {
    /// All.
    #[default]
    Either,
    /// From below.
    Rising,
    /// From above.
    Falling,
}

impl Direction {
    /// Whether a crossing from below, or one from above, counts.
    pub fn counts(self, rises: bool) -> bool {
        match self {
            Self::Either => true,
            Self::Rising => rises,
            Self::Falling => !rises,
        }
    }
}

/// A function of the motion whose zeros are reported, by its number among the [`EventFunctions`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Event {
    /// For messages.
    pub name: String,
    /// The crossings that count.
    pub direction: Direction,
    /// The occurrence that ends the integration, counted from 1.
    pub last: Option<u64>,
    /// The number of occurrences that are reported.
    pub most: u64,
    /// The side, positive or not, that its function never leaves: it is there at the start of every step, whatever rounding
    /// makes of its value.
    pub side: Option<bool>,
}

/// A state with its accelerations.
#[derive(Clone, Debug, Default)]
pub struct MotionState {
    /// Time.
    pub t: f64,
    /// Coordinates, with their whole turns.
    pub q: Vec<f64>,
    /// Velocities.
    pub v: Vec<f64>,
    /// v'.
    pub vdot: Vec<f64>,
    /// λ of all rows, where a function reads forces.
    pub multipliers: Vec<f64>,
}

/// The functions of all events.
pub trait EventFunctions: Debug + Send + Sync {
    /// Value and rate of each, written to `out`.
    ///
    /// # Errors
    /// Where a function cannot be evaluated.
    fn read(&mut self, at: &MotionState, out: &mut [Reading]) -> Result<()>;
    /// The motion has got to t, where the functions were read: angles that are known up to whole turns go on from there.
    fn accept(&mut self, t: f64);
    /// Whether the multipliers of rows are read.
    fn reads_forces(&self) -> bool {
        false
    }
}

/// An event that happened.
#[derive(Clone, Debug)]
pub struct Occurrence {
    /// Its number.
    pub event: usize,
    /// Whether its function rises through zero there.
    pub rises: bool,
    /// The state there.
    pub state: Output,
}
