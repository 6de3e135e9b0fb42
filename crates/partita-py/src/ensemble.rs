//! Ensembles between Python and Rust.

use crate::arrays::{array, entries_of, matrix, shaped};
use crate::ending::{entered, released};
use crate::failure::{self, raise};
use crate::run::Options;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use partita_analysis::ensemble::{self, Members};
use partita_analysis::AnalysisError;
use partita_model::Model;
use partita_system::prelude::*;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::Mutex;

/// Initial states and parameters of members.
pub struct MemberStates<'x, 'py> {
    /// One row for each member, or one for all.
    pub q: &'x PyReadonlyArray2<'py, f64>,
    /// See `q`.
    pub v: &'x PyReadonlyArray2<'py, f64>,
    /// Names, and how many numbers each has.
    pub parameters: Vec<(String, usize)>,
    /// One row for each member.
    pub values: &'x PyReadonlyArray2<'py, f64>,
    /// Whether members whose parameters open the loops are assembled anew.
    pub assembles: bool,
}

/// Motions of all members, by name.
pub fn ensemble<'py>(
    py: Python<'py>,
    m: &Model,
    options: &Options,
    t_eval: &PyReadonlyArray1<'py, f64>,
    given: MemberStates<'_, 'py>,
    workers: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (t_eval, size) = (entries_of(t_eval), m.size());
    let ((rows, nq, q), (more, nv, v)) = (matrix(given.q), matrix(given.v));
    let (count, width, values) = matrix(given.values);
    let numbers: usize = given.parameters.iter().map(|p| p.1).sum();
    let fits = |n: usize| n == count || n == 1;
    if nq != size.nq || nv != size.nv || width != numbers || !fits(rows) || !fits(more) {
        let message = format!("states of {rows} and {more} rows do not fit {count} members of this model");
        return Err(raise(py, "ArgumentError", &message, &[("argument", "states".into())]));
    }
    let (stopped, error) = (AtomicBool::new(false), Mutex::new(None));
    let interrupted = || {
        if stopped.load(Ordering::Relaxed) {
            return true;
        }
        let Err(e) = entered(|py| py.check_signals()) else { return false };
        if let Ok(mut error) = error.lock() {
            *error = Some(e);
        }
        stopped.store(true, Ordering::Relaxed);
        true
    };
    let what = Members {
        request: options.request(),
        t_eval: &t_eval,
        q: &q,
        v: &v,
        parameters: &given.parameters,
        values: &values,
        count,
        assembles: given.assembles,
        workers,
        interrupted: &interrupted,
    };
    let mut asked = Ok(());
    let mut watch = |part: f64| {
        asked = match error.lock().ok().and_then(|mut error| error.take()) {
            Some(e) => Err(e),
            None => entered(|py| {
                py.check_signals()?;
                progress.as_ref().map_or(Ok(()), |p| p.call1(py, (part,)).map(drop))
            }),
        };
        asked.as_ref().map_or(Err(AnalysisError::Stopped), |_| Ok(()))
    };
    let found = released(py, || ensemble::ensemble(m, &what, &mut watch));
    asked?;
    let found = found.map_err(|e| failure::analysis(py, e))?;
    let d = PyDict::new(py);
    d.set_item("q", array(py, &[count, t_eval.len(), nq], found.q))?;
    d.set_item("v", array(py, &[count, t_eval.len(), nv], found.v))?;
    d.set_item("status", found.status.iter().map(|x| x.word()).collect::<Vec<_>>())?;
    d.set_item("in_lanes", shaped(py, &[count], found.in_lanes))?;
    d.set_item("steps", found.steps)?;
    d.set_item("messages", found.messages)?;
    d.set_item("refusal", found.refusal)?;
    Ok(d)
}
