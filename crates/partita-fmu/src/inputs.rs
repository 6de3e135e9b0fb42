//! Inputs as functions that a model calls: their courses over the current step.

use partita_model::value::Functions;
use std::error::Error;
use std::sync::{Arc, Mutex, PoisonError};

type Failure = Box<dyn Error + Send + Sync>;

/// An input over a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Course {
    /// An effort that varies linearly from t.
    Effort {
        /// Since when (s).
        t: f64,
        /// Its value at that time.
        value: f64,
        /// Its rate.
        slope: f64,
    },
    /// A position from (t, x), a polynomial of fifth degree.
    Motion {
        /// Since when (s).
        t: f64,
        /// Position, rate and acceleration at that time.
        start: [f64; 3],
        /// Its coefficients of third to fifth degree.
        bends: [f64; 3],
    },
}

impl Course {
    /// How many numbers one is.
    pub const NUMBERS: usize = 8;

    /// The motion from a position, a rate and an acceleration at time t to others after a span.
    pub fn between(t: f64, start: [f64; 3], span: f64, end: [f64; 3]) -> Self {
        let [x, rate, growth] = start;
        let square = span * span;
        // what a constant acceleration lacks, each as a length
        let lacks = [
            end[0] - x - (rate + 0.5 * growth * span) * span,
            (end[1] - rate - growth * span) * span,
            0.5 * (end[2] - growth) * square,
        ];
        let [d, v, a] = lacks;
        let bends = [
            (10.0 * d - 4.0 * v + a) / (square * span),
            (-15.0 * d + 7.0 * v - 2.0 * a) / (square * square),
            (6.0 * d - 3.0 * v + a) / (square * square * span),
        ];
        Self::Motion { t, start, bends }
    }

    /// The course as numbers, the first of which says of which kind it is.
    pub fn numbers(&self) -> [f64; Self::NUMBERS] {
        match *self {
            Self::Effort { t, value, slope } => [0.0, t, value, slope, 0.0, 0.0, 0.0, 0.0],
            Self::Motion { t, start: [x, v, a], bends: [c, d, e] } => [1.0, t, x, v, a, c, d, e],
        }
    }

    /// The course of such numbers.
    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        match *numbers {
            [kind, t, value, slope, ..] if kind == 0.0 && numbers.len() == Self::NUMBERS => {
                Some(Self::Effort { t, value, slope })
            }
            [_, t, x, v, a, c, d, e] => Some(Self::Motion { t, start: [x, v, a], bends: [c, d, e] }),
            _ => None,
        }
    }

    /// The same from another time.
    pub fn from(self, since: f64) -> Self {
        match self {
            Self::Effort { value, slope, .. } => Self::Effort { t: since, value, slope },
            Self::Motion { start, bends, .. } => Self::Motion { t: since, start, bends },
        }
    }

    /// Position, rate and acceleration at t; an effort has its value in place of all.
    pub fn at(&self, t: f64) -> [f64; 3] {
        match *self {
            Self::Effort { t: t0, value, slope } => [value + slope * (t - t0); 3],
            Self::Motion { t: t0, start: [x, v, a], bends: [c, d, e] } => {
                let s = t - t0;
                [
                    x + (v + (0.5 * a + (c + (d + e * s) * s) * s) * s) * s,
                    v + (a + (3.0 * c + (4.0 * d + 5.0 * e * s) * s) * s) * s,
                    a + (6.0 * c + (12.0 * d + 20.0 * e * s) * s) * s,
                ]
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
