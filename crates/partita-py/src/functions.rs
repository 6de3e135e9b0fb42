//! Python functions called from evaluations.

use crate::arrays::entries;
use crate::ending::entered;
use numpy::ToPyArray;
use partita_model::value::{Functions, RELATION, TURNING};
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::Arc;

type Fault = Box<dyn std::error::Error + Send + Sync>;

/// The callables given with a description.
pub struct Callables {
    functions: Vec<Py<PyAny>>,
    abandoned: AtomicBool,
}

impl Callables {
    /// These functions.
    pub fn new(functions: Vec<Py<PyAny>>) -> Self {
        Self { functions, abandoned: AtomicBool::new(false) }
    }

    /// Nobody waits for the model that is compiled with them.
    pub fn abandon(&self) {
        self.abandoned.store(true, Ordering::Relaxed);
    }

    /// What function i returns at (t, q, v).
    pub fn call<T>(
        &self,
        i: usize,
        t: f64,
        q: &[f64],
        v: &[f64],
        read: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>,
    ) -> Result<T, Fault> {
        entered(|py| {
            let result = self.functions[i].bind(py).call1((t, q.to_pyarray(py), v.to_pyarray(py)))?;
            read(&result)
        })
        .map_err(|e: PyErr| Box::new(e) as Fault)
    }
}

impl Functions for Callables {
    fn count(&self) -> usize {
        self.functions.len()
    }
    fn is_abandoned(&self) -> bool {
        self.abandoned.load(Ordering::Relaxed)
    }
    fn scalar(&self, i: usize, t: f64, q: &[f64], v: &[f64]) -> Result<f64, Fault> {
        self.call(i, t, q, v, |x| x.extract::<f64>())
    }
    fn vector(&self, i: usize, t: f64, q: &[f64], v: &[f64]) -> Result<[f64; 3], Fault> {
        let x = self.call(i, t, q, v, |x| match entries(x) {
            Some(x) => Ok(x),
            None => x.extract::<Vec<f64>>(),
        })?;
        x.try_into()
            .map_err(|x: Vec<f64>| format!("a force needs three components, but {} were returned", x.len()).into())
    }
    fn relation(&self, i: usize, t: f64, x: &[f64], rates: &[f64]) -> Result<[f64; RELATION], Fault> {
        let found = self.call(i, t, x, rates, |x| match entries(x) {
            Some(x) => Ok(x),
            None => x.extract::<Vec<f64>>(),
        })?;
        let mut law = [0.0; RELATION];
        if found.len() != 3 + x.len() {
            return Err(format!(
                "a relation of {} readings must return {} numbers, not {}",
                x.len(),
                3 + x.len(),
                found.len()
            )
            .into());
        }
        law[..found.len()].copy_from_slice(&found);
        Ok(law)
    }
    fn law(&self, i: usize, t: f64, seen: &[f64], out: &mut [f64]) -> Result<(), Fault> {
        let x = entered(|py| {
            let x = self.functions[i].bind(py).call1((t, seen.to_pyarray(py)))?;
            match entries(&x) {
                Some(x) => Ok(x),
                None => x.extract::<Vec<f64>>(),
            }
        })
        .map_err(|e: PyErr| Box::new(e) as Fault)?;
        if x.len() != out.len() {
            return Err(format!("a force law must return {} numbers, not {}", out.len(), x.len()).into());
        }
        out.copy_from_slice(&x);
        Ok(())
    }
    fn turning(&self, i: usize, t: f64) -> Result<[f64; TURNING], Fault> {
        let x = entered(|py| {
            let x = self.functions[i].bind(py).call1((t,))?;
            match entries(&x) {
                Some(x) => Ok(x),
                None => x.extract::<Vec<f64>>(),
            }
        })
        .map_err(|e: PyErr| Box::new(e) as Fault)?;
        x.try_into().map_err(|x: Vec<f64>| {
            format!("an orientation has {TURNING} numbers, but {} were returned", x.len()).into()
        })
    }
    fn motion(&self, i: usize, t: f64) -> Result<[f64; 3], Fault> {
        entered(|py| {
            let (a, b, c) = self.functions[i].bind(py).call1((t,))?.extract::<(f64, f64, f64)>()?;
            Ok([a, b, c])
        })
        .map_err(|e: PyErr| Box::new(e) as Fault)
    }
}

/// Constant or cubic values of one input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A number.
    Effort,
    /// Start time, and the coefficients of a cubic from there on, lowest first: the course of a drive over a tick.
    Course,
}

impl Kind {
    /// Constant numbers.
    pub fn count(self) -> usize {
        match self {
            Self::Effort => 1,
            Self::Course => 5,
        }
    }
}

/// Functions, followed by numbers that are constant until they are set again: inputs of a motion that is stepped.
pub struct Held {
    functions: Arc<dyn Functions>,
    /// Index of the first number of each input.
    offsets: Vec<usize>,
    numbers: Vec<AtomicU64>,
}

impl Held {
    /// The given inputs, all numbers 0.
    pub fn new(functions: Arc<dyn Functions>, kinds: &[Kind]) -> Self {
        let (mut count, mut offsets) = (0, Vec::with_capacity(kinds.len()));
        for kind in kinds {
            offsets.push(count);
            count += kind.count();
        }
        Self { functions, offsets, numbers: (0..count).map(|_| AtomicU64::new(0)).collect() }
    }

    /// Number of the first input among the functions.
    pub fn first(&self) -> usize {
        self.functions.count()
    }

    /// Number of constant numbers.
    pub fn count(&self) -> usize {
        self.numbers.len()
    }

    /// Hold these.
    pub fn set(&self, values: &[f64]) {
        for (cell, x) in self.numbers.iter().zip(values) {
            cell.store(x.to_bits(), Ordering::Relaxed);
        }
    }

    /// The constant numbers.
    pub fn values(&self) -> Vec<f64> {
        (0..self.numbers.len()).map(|i| self.number(i)).collect()
    }

    fn number(&self, i: usize) -> f64 {
        self.numbers.get(i).map_or(0.0, |cell| f64::from_bits(cell.load(Ordering::Relaxed)))
    }

    /// The functions, unless number i is an input, which nobody calls.
    fn of(&self, i: usize) -> Result<&dyn Functions, Fault> {
        match self.given(i) {
            Some(_) => Err(format!("input {i} is no function").into()),
            None => Ok(&*self.functions),
        }
    }
}

impl Functions for Held {
    fn count(&self) -> usize {
        self.functions.count() + self.offsets.len()
    }
    fn sees_state(&self, i: usize) -> bool {
        self.given(i).is_none() && self.functions.sees_state(i)
    }
    fn given(&self, i: usize) -> Option<usize> {
        i.checked_sub(self.functions.count()).and_then(|i| self.offsets.get(i).copied())
    }
    fn given_count(&self) -> usize {
        self.count()
    }
    fn given_number(&self, place: usize) -> f64 {
        self.number(place)
    }
    fn scalar(&self, i: usize, t: f64, q: &[f64], v: &[f64]) -> Result<f64, Fault> {
        self.of(i)?.scalar(i, t, q, v)
    }
    fn vector(&self, i: usize, t: f64, q: &[f64], v: &[f64]) -> Result<[f64; 3], Fault> {
        self.of(i)?.vector(i, t, q, v)
    }
    fn relation(&self, i: usize, t: f64, x: &[f64], rates: &[f64]) -> Result<[f64; RELATION], Fault> {
        self.of(i)?.relation(i, t, x, rates)
    }
    fn law(&self, i: usize, t: f64, seen: &[f64], out: &mut [f64]) -> Result<(), Fault> {
        self.of(i)?.law(i, t, seen, out)
    }
    fn turning(&self, i: usize, t: f64) -> Result<[f64; TURNING], Fault> {
        self.of(i)?.turning(i, t)
    }
    fn motion(&self, i: usize, t: f64) -> Result<[f64; 3], Fault> {
        self.of(i)?.motion(i, t)
    }
}
