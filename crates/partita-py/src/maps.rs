//! Maps: singular positions, and what sets of actuators can do, over many positions.

use crate::arrays::{array, matrix, rows_of};
use crate::failure::guarded;
use crate::inverse::Inverse;
use crate::model::Model;
use crate::outputs::watched;
use crate::poses::{targets, Named};
use numpy::PyReadonlyArray2;
use partita_analysis::maps::{self, Range, Set};
use partita_system::prelude::*;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// Singular positions of the actuators, or of the outputs, or of the constraints where there is neither, within the limits
/// of the goals (lower, upper), equal ones held: curves with q, goals, measure and ends; the number of samples and whether
/// they cover all. `seeds`: closed positions to begin with; `one_branch`: to stay on theirs.
#[pyfunction]
#[pyo3(signature = (model, actuators, outputs, t, goals, limits, seeds, one_branch))]
pub fn singularities<'py>(
    py: Python<'py>,
    model: &Model,
    actuators: Option<&Inverse>,
    outputs: Vec<Named>,
    t: f64,
    goals: Vec<Named>,
    limits: PyReadonlyArray2<'py, f64>,
    seeds: PyReadonlyArray2<'py, f64>,
    one_branch: bool,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(py, || {
        let m = model.shared();
        let (goals, outputs) = (targets(py, m, &goals)?, targets(py, m, &outputs)?);
        let limits = rows_of(&limits, goals.len(), 2, "limits")?;
        let limits: Vec<[f64; 2]> = limits.chunks_exact(2).map(|x| [x[0], x[1]]).collect();
        let (nq, width) = (m.size().nq, goals.len());
        let count = matrix(&seeds).0;
        let seeds = rows_of(&seeds, count, nq, "seeds")?;
        let range = Range { t, targets: &goals, limits: &limits, seeds: &seeds, one_branch };
        let set = match actuators {
            Some(x) => Set::Actuators(x.inner()),
            None if outputs.is_empty() => Set::Constraints,
            None => Set::Outputs(&outputs),
        };
        let found = watched(py, |watch| maps::singularities(m, range, set, watch))?;
        let curves = PyList::empty(py);
        for curve in found.curves {
            let (d, n) = (PyDict::new(py), curve.measure.len());
            d.set_item("q", array(py, &[n, nq], curve.q))?;
            d.set_item("goals", array(py, &[n, width], curve.goals))?;
            d.set_item("measure", array(py, &[n], curve.measure))?;
            d.set_item("ends", curve.ends.map(|ends| ends.map(|end| end.word()).to_vec()))?;
            curves.append(d)?;
        }
        let d = PyDict::new(py);
        d.set_item("curves", curves)?;
        d.set_item("samples", found.samples)?;
        d.set_item("complete", found.complete)?;
        Ok(d)
    })
}

/// What each actuator can do at the positions in the rows of q, which lie on one branch: (n, k, s) without units, and the
/// least singular value of the constraints (n), NaN where q is; the size of the mechanism.
#[pyfunction]
#[pyo3(signature = (model, actuators, t, q))]
pub fn measures<'py>(
    py: Python<'py>,
    model: &Model,
    actuators: &Inverse,
    t: f64,
    q: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(py, || {
        let m = model.shared();
        let count = matrix(&q).0;
        let q = rows_of(&q, count, m.size().nq, "q")?;
        let (k, scaled, weakest) = watched(py, |watch| maps::measures(m, actuators.inner(), t, &q, watch))?;
        let d = PyDict::new(py);
        let s = actuators.inner().count();
        d.set_item("actuators", array(py, &[count, k, s], scaled))?;
        d.set_item("constraints", array(py, &[count], weakest))?;
        d.set_item("length", m.length())?;
        Ok(d)
    })
}
