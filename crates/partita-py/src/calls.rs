//! Calling user functions of (t, q) and (t, q, v).

use crate::arrays::entries;
use crate::ending::entered;
use numpy::ToPyArray;
use partita_system::SystemError;
use pyo3::prelude::*;

fn fault(what: &str, e: PyErr) -> SystemError {
    SystemError::Function { what: what.into(), source: Box::new(e) }
}

/// Entries of f(t, q) or f(t, q, v).
pub fn call(f: &Py<PyAny>, what: &str, t: f64, q: &[f64], v: Option<&[f64]>) -> Result<Vec<f64>, SystemError> {
    entered(|py| {
        let q = q.to_pyarray(py);
        let x = match v {
            Some(v) => f.bind(py).call1((t, q, v.to_pyarray(py))),
            None => f.bind(py).call1((t, q)),
        }
        .map_err(|e| fault(what, e))?;
        entries(&x).ok_or_else(|| SystemError::NotFinite { what: what.into(), t })
    })
}

/// As `call`, written into `out`, whose length it must have.
pub fn fill(
    f: &Py<PyAny>,
    what: &str,
    t: f64,
    q: &[f64],
    v: Option<&[f64]>,
    out: &mut [f64],
) -> Result<(), SystemError> {
    let x = call(f, what, t, q, v)?;
    if x.len() != out.len() {
        return Err(SystemError::argument(
            what,
            format!(
                "{what} returned {} numbers at t = {t}, {} were expected; the shape must not change",
                x.len(),
                out.len()
            ),
        ));
    }
    out.copy_from_slice(&x);
    Ok(())
}
