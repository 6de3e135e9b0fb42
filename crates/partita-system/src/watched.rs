//! What no step may pass unseen: functions of the state whose sign or value changes what acts, and special times.

use crate::breakpoints::{Breakpoints, Reads};

/// A function of the state that changes sides: the gap of a contact, the slack of a rope, the distance to a stop.
///
/// What it guards acts on one side alone, with a corner at zero. An error estimate evaluates a dozen points of a step and
/// misses a contact between two of them, so that the guard itself is followed.
#[derive(Clone, Debug, PartialEq)]
pub struct Guard {
    /// The guarded element, in words: `contact "tip"`.
    pub name: String,
    /// Natural size of its values.
    pub size: f64,
    /// The value below which the element was passed through, with the message for it.
    pub through: Option<(f64, String)>,
}

/// A watched function at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Its value; of a guard, positive on one side and negative on the other.
    pub x: f64,
    /// x'.
    pub rate: f64,
    /// Distance of the guarded element from changing sides, in the unit of the speed.
    pub apart: f64,
    /// Largest speed at which that can change, while the rates of the mechanism stay as they are.
    pub speed: f64,
    /// Size of the terms of which a function of an event is the sum: what it is rounded to.
    pub terms: f64,
}

impl Reading {
    /// A value and its rate.
    pub fn new(x: f64, rate: f64) -> Self {
        Self { x, rate, ..Self::default() }
    }
}

/// The watched functions and times of a system.
#[derive(Clone, Debug, Default)]
pub struct Watched {
    /// Functions that change sides. Their readings come first.
    pub guards: Vec<Guard>,
    /// Curves with breakpoints: the readings after them are their abscissas.
    pub breakpoints: Vec<Breakpoints>,
    /// Ascending times of discontinuities of loads and drives.
    pub discontinuities: Vec<f64>,
    /// The time after which nothing can be evaluated, and the table that ends there, in words.
    pub domain: Option<(f64, String)>,
}

impl Watched {
    /// Number of readings.
    pub fn count(&self) -> usize {
        self.guards.len() + self.breakpoints.len()
    }

    /// How each is read.
    pub fn reads(&self) -> Vec<Reads> {
        let guards = self.guards.iter().map(|_| Reads::Other);
        guards.chain(self.breakpoints.iter().map(Breakpoints::reads)).collect()
    }
}
