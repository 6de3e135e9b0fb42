//! Inputs as functions that a model calls: their courses over the current step.

use partita_model::value::Functions;
use std::error::Error;
use std::sync::{Arc, Mutex, PoisonError};

type Failure = Box<dyn Error + Send + Sync>;

/// An input over a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Course {
    /// A constant effort.
    Effort(f64),
    /// A position from (t, x), its rate, and its constant acceleration.
    Motion {
        /// Since when (s).
        t: f64,
        /// Its position at that time.
        x: f64,
        /// Rate then.
        rate: f64,
        /// Acceleration.
        growth: f64,
    },
}

impl Course {
    /// How many numbers one is.
    pub const NUMBERS: usize = 5;

    /// The course as numbers, the first of which says of which kind it is.
    pub fn numbers(&self) -> [f64; Self::NUMBERS] {
        match *self {
            Self::Effort(value) => [0.0, value, 0.0, 0.0, 0.0],
            Self::Motion { t, x, rate, growth } => [1.0, t, x, rate, growth],
        }
    }

    /// The course of such numbers.
    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        match *numbers {
            [kind, value, ..] if kind == 0.0 && numbers.len() == Self::NUMBERS => Some(Self::Effort(value)),
            [_, t, x, rate, growth] => Some(Self::Motion { t, x, rate, growth }),
            _ => None,
        }
    }

    /// Position, rate and acceleration at t; an effort has its value in place of all.
    pub fn at(&self, t: f64) -> [f64; 3] {
        match *self {
            Self::Effort(value) => [value; 3],
            Self::Motion { t: t0, x, rate, growth } => {
                let past = t - t0;
                [x + (rate + 0.5 * growth * past) * past, rate + growth * past, growth]
            }
        }
    }
}

/// The courses, shared between a model and its caller.
#[derive(Clone, Default)]
pub struct Inputs(Arc<Mutex<Vec<Course>>>);

impl Inputs {
    /// Replace all courses; their number is fixed.
    pub fn set(&self, courses: &[Course]) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.clear();
        all.extend_from_slice(courses);
    }

    fn at(&self, i: usize, t: f64) -> Result<[f64; 3], Failure> {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.get(i).map(|course| course.at(t)).ok_or_else(|| format!("there is no input {i}").into())
    }
}

impl Functions for Inputs {
    fn count(&self) -> usize {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).len()
    }
    fn sees_state(&self, _: usize) -> bool {
        false
    }
    fn scalar(&self, i: usize, t: f64, _: &[f64], _: &[f64]) -> Result<f64, Failure> {
        self.at(i, t).map(|x| x[0])
    }
    fn vector(&self, i: usize, _: f64, _: &[f64], _: &[f64]) -> Result<[f64; 3], Failure> {
        Err(format!("input {i} is not a force with three components").into())
    }
    fn motion(&self, i: usize, t: f64) -> Result<[f64; 3], Failure> {
        self.at(i, t)
    }
}
