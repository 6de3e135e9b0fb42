//! Tables with a row for each output, as arrays.

use crate::arrays::{array, shaped};
use crate::ending::{entered, released};
use crate::failure;
use partita_analysis::error::AnalysisError;
use partita_analysis::outputs::Watch;
use partita_analysis::run::{Assessed, Described};
use partita_system::Size;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Compute while other Python threads run; Ctrl-C is checked between the rows.
pub fn watched<T: Send>(py: Python<'_>, f: impl FnOnce(Watch) -> Result<T, AnalysisError> + Send) -> PyResult<T> {
    let mut asked = Ok(());
    let found = released(py, || {
        f(&mut || {
            asked = entered(|py| py.check_signals());
            asked.as_ref().map_or(Err(AnalysisError::Stopped), |_| Ok(()))
        })
    });
    asked?;
    found.map_err(|e| failure::analysis(py, e))
}

/// Quantities at nt outputs of a system, by name.
pub fn described(py: Python<'_>, nt: usize, size: Size, x: Described) -> PyResult<Bound<'_, PyDict>> {
    let tables = [x.vdot, x.multipliers, x.closure, x.velocity_closure];
    let shapes: [(&str, &[usize]); 4] =
        [("vdot", &[size.nv]), ("multipliers", &[size.rows]), ("closure", &[]), ("velocity_closure", &[])];
    let d = named(py, nt, tables, &shapes)?;
    // -1: nothing was chosen in a singular position
    let chosen = x.independent.iter().map(|i| if i.is_nan() { -1 } else { *i as i64 }).collect();
    d.set_item("independent", shaped(py, &[nt, x.k], chosen))?;
    d.set_item("notes", x.notes)?;
    Ok(d)
}

/// Measures, qualities and, where they are others than velocities of the system, tangent velocities at nt outputs, by
/// name.
pub fn assessed(py: Python<'_>, nt: usize, size: Size, x: Assessed) -> PyResult<Bound<'_, PyDict>> {
    let shapes: [(&str, &[usize]); 3] = [("measure", &[size.nv]), ("sigma", &[]), ("sqrt_mu", &[])];
    let d = named(py, nt, [x.measure, x.sigma, x.sqrt_mu], &shapes)?;
    if !x.selector.is_empty() {
        let k = x.selector.len() / (nt * size.nv);
        d.set_item("selector", array(py, &[nt, k, size.nv], x.selector))?;
    }
    Ok(d)
}

/// Name and array of each table; `shape` gives its axes after time.
pub fn named<'py>(
    py: Python<'py>,
    nt: usize,
    tables: impl IntoIterator<Item = Vec<f64>>,
    shapes: &[(&str, &[usize])],
) -> PyResult<Bound<'py, PyDict>> {
    let d = PyDict::new(py);
    for (data, (name, shape)) in tables.into_iter().zip(shapes) {
        d.set_item(name, array(py, &[&[nt], *shape].concat(), data))?;
    }
    Ok(d)
}
