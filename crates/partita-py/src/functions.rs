//! Python functions called from evaluations.

use crate::arrays::entries;
use numpy::ToPyArray;
use partita_model::value::{Functions, RELATION, TURNING};
use pyo3::prelude::*;

type Fault = Box<dyn std::error::Error + Send + Sync>;

/// The callables handed along with a description.
pub struct Callables(pub Vec<Py<PyAny>>);

impl Callables {
    fn call<T>(
        &self,
        i: usize,
        t: f64,
        q: &[f64],
        v: &[f64],
        read: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>,
    ) -> Result<T, Fault> {
        Python::attach(|py| {
            let result = self.0[i].bind(py).call1((t, q.to_pyarray(py), v.to_pyarray(py)))?;
            read(&result)
        })
        .map_err(|e: PyErr| Box::new(e) as Fault)
    }
}

impl Functions for Callables {
    fn count(&self) -> usize {
        self.0.len()
    }
    fn scalar(&self, i: usize, t: f64, q: &[f64], v: &[f64]) -> Result<f64, Fault> {
        self.call(i, t, q, v, |x| x.extract::<f64>())
    }
    fn vector(&self, i: usize, t: f64, q: &[f64], v: &[f64]) -> Result<[f64; 3], Fault> {
        let x = self.call(i, t, q, v, |x| match entries(x) {
            Some(x) => Ok(x),
            None => x.extract::<Vec<f64>>(),
        })?;
        x.try_into().map_err(|x: Vec<f64>| format!("a force needs three components, {} came", x.len()).into())
    }
    fn relation(&self, i: usize, t: f64, x: &[f64], rates: &[f64]) -> Result<[f64; RELATION], Fault> {
        let found = self.call(i, t, x, rates, |x| match entries(x) {
            Some(x) => Ok(x),
            None => x.extract::<Vec<f64>>(),
        })?;
        let mut law = [0.0; RELATION];
        if found.len() != 3 + x.len() {
            return Err(format!(
                "a relation of {} readings gives {} numbers, {} came",
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
        let x = Python::attach(|py| {
            let x = self.0[i].bind(py).call1((t, seen.to_pyarray(py)))?;
            match entries(&x) {
                Some(x) => Ok(x),
                None => x.extract::<Vec<f64>>(),
            }
        })
        .map_err(|e: PyErr| Box::new(e) as Fault)?;
        if x.len() != out.len() {
            return Err(format!("a law of force needs {} numbers, {} came", out.len(), x.len()).into());
        }
        out.copy_from_slice(&x);
        Ok(())
    }
    fn turning(&self, i: usize, t: f64) -> Result<[f64; TURNING], Fault> {
        let x = Python::attach(|py| {
            let x = self.0[i].bind(py).call1((t,))?;
            match entries(&x) {
                Some(x) => Ok(x),
                None => x.extract::<Vec<f64>>(),
            }
        })
        .map_err(|e: PyErr| Box::new(e) as Fault)?;
        x.try_into().map_err(|x: Vec<f64>| format!("an orientation has {TURNING} numbers, {} came", x.len()).into())
    }
    fn motion(&self, i: usize, t: f64) -> Result<[f64; 3], Fault> {
        Python::attach(|py| {
            let (a, b, c) = self.0[i].bind(py).call1((t,))?.extract::<(f64, f64, f64)>()?;
            Ok([a, b, c])
        })
        .map_err(|e: PyErr| Box::new(e) as Fault)
    }
}
