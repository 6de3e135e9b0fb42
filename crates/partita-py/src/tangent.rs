//! The user's tangent velocities: D, γ and δ as Python functions.

use crate::calls;
use partita_system::options::TangentMap;
use partita_system::SystemError;
use pyo3::prelude::*;

/// Functions of (t, q) and, for the bias, v.
#[derive(FromPyObject)]
pub struct TangentFunctions {
    directions: Py<PyAny>,
    offset: Option<Py<PyAny>>,
    bias: Option<Py<PyAny>>,
}

/// Tangent velocities given by functions, for a system of n velocities.
pub struct UserTangent {
    /// Velocities.
    pub n: usize,
    /// The functions.
    pub functions: TangentFunctions,
}

impl TangentMap for UserTangent {
    fn tangent(&self, t: f64, q: &[f64], dt: &mut [f64]) -> Result<(), SystemError> {
        let mut d = vec![0.0; dt.len()];
        calls::fill(&self.functions.directions, "tangent directions", t, q, None, &mut d)?;
        // D (k x n) arrives row by row, Dᵀ (n x k) is needed
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
            Some(f) => calls::fill(f, "tangent offset", t, q, None, gamma),
            None => {
                gamma.fill(0.0);
                Ok(())
            }
        }
    }
    fn bias(&self, t: f64, q: &[f64], v: &[f64], delta: &mut [f64]) -> Result<bool, SystemError> {
        match &self.functions.bias {
            Some(f) => {
                calls::fill(f, "tangent bias", t, q, Some(v), delta)?;
                Ok(true)
            }
            None => Ok(false),
        }
    }
}
