//! The user's tangent velocities: D, γ and δ as Python functions.

use crate::arrays::entries;
use numpy::ToPyArray;
use partita_system::formulation::options::TangentMap;
use partita_system::SystemError;
use pyo3::prelude::*;

/// Functions of (t, q) and, for the bias, v.
#[derive(FromPyObject)]
pub struct TangentFunctions {
    directions: Py<PyAny>,
    offset: Option<Py<PyAny>>,
    bias: Option<Py<PyAny>>,
}

fn call(
    f: &Py<PyAny>,
    what: &str,
    t: f64,
    q: &[f64],
    v: Option<&[f64]>,
    length: usize,
) -> Result<Vec<f64>, SystemError> {
    let x = Python::attach(|py| {
        let q = q.to_pyarray(py);
        let x = match v {
            Some(v) => f.bind(py).call1((t, q, v.to_pyarray(py))),
            None => f.bind(py).call1((t, q)),
        }
        .map_err(|e| SystemError::Function { what: what.into(), source: Box::new(e) })?;
        entries(&x).ok_or_else(|| SystemError::NotFinite { what: what.into(), t })
    })?;
    if x.len() != length {
        return Err(SystemError::Request(format!(
            "{what} returned {} numbers at t = {t}, {length} were expected; it must keep its shape",
            x.len()
        )));
    }
    Ok(x)
}

/// The same for a system of n velocities.
pub struct UserTangent {
    /// Velocities.
    pub n: usize,
    /// The functions.
    pub functions: TangentFunctions,
}

impl TangentMap for UserTangent {
    fn tangent(&self, t: f64, q: &[f64], dt: &mut [f64]) -> Result<(), SystemError> {
        let d = call(&self.functions.directions, "tangent directions", t, q, None, dt.len())?;
        // D (k x n) arrives row by row, Dᵀ (n x k) is wanted
        let k = dt.len() / self.n;
        for i in 0..self.n {
            for j in 0..k {
                dt[i * k + j] = d[j * self.n + i];
            }
        }
        Ok(())
    }
    fn offset(&self, t: f64, q: &[f64], gamma: &mut [f64]) -> Result<(), SystemError> {
        match &self.functions.offset {
            Some(f) => gamma.copy_from_slice(&call(f, "tangent offset", t, q, None, gamma.len())?),
            None => gamma.fill(0.0),
        }
        Ok(())
    }
    fn bias(&self, t: f64, q: &[f64], v: &[f64], delta: &mut [f64]) -> Result<bool, SystemError> {
        match &self.functions.bias {
            Some(f) => {
                delta.copy_from_slice(&call(f, "tangent bias", t, q, Some(v), delta.len())?);
                Ok(true)
            }
            None => Ok(false),
        }
    }
}
