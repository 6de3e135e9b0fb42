//! Analyses of one state, as dictionaries of arrays.

use crate::arrays::{array, dense, indices};
use crate::ending::released;
use crate::failure::{self, raise};
use crate::state::Array;
use partita_analysis::linear::{self, Driven, Modes};
use partita_analysis::poses;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::variation::Derivatives;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Rows of numbers as one array.
fn table<'py>(py: Python<'py>, rows: &[Vec<f64>], width: usize) -> Array<'py> {
    array(py, &[rows.len(), width], rows.concat())
}

fn modes<'py>(py: Python<'py>, modes: &Modes, n: usize) -> PyResult<Bound<'py, PyDict>> {
    let d = PyDict::new(py);
    let (re, im): (Vec<f64>, Vec<f64>) = modes.values.iter().copied().unzip();
    d.set_item("real", array(py, &[re.len()], re))?;
    d.set_item("imaginary", array(py, &[im.len()], im))?;
    let (re, im): (Vec<_>, Vec<_>) = modes.shapes.iter().cloned().unzip();
    d.set_item("shape_real", table(py, &re, n))?;
    d.set_item("shape_imaginary", table(py, &im, n))?;
    d.set_item("zero", modes.zero)?;
    Ok(d)
}

/// The linearised equations about a state; `efforts` hold a column of E in each row, `drives` the rows of those whose
/// accelerations are inputs; with changes of everything and states `beside` it if outputs are to be differentiated.
pub fn linearized<'py>(
    py: Python<'py>,
    model: &Model,
    state: (f64, &[f64], &[f64]),
    independent: Option<&[usize]>,
    efforts: &[f64],
    drives: &[usize],
    beside: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let driven = |row: &usize| match model.prescribed(*row, state.0) {
        Ok(Some([rate, acceleration])) => Ok(Driven { row: *row, rate, acceleration }),
        Ok(None) => Err(raise(
            py,
            "ArgumentError",
            "inputs: a prescribed orientation has no acceleration that is one number; drive angles instead",
            &[("argument", "inputs".into())],
        )),
        Err(e) => Err(failure::system(py, e)),
    };
    let driven = drives.iter().map(driven).collect::<PyResult<Vec<_>>>()?;
    let made = released(py, || linear::linearize(model, state, independent, efforts, &driven))
        .map_err(|e| failure::analysis(py, e))?;
    let found = &made.first_order;
    let d = PyDict::new(py);
    d.set_item("positions", indices(py, &found.positions))?;
    d.set_item("velocities", indices(py, &found.velocities))?;
    d.set_item("driven_positions", indices(py, &found.driven_positions))?;
    d.set_item("driven_rates", indices(py, &found.driven_rates))?;
    for (name, m) in [
        ("A", &found.a),
        ("B", &found.b),
        ("mass", &found.mass),
        ("stiffness", &found.stiffness),
        ("damping", &found.damping),
    ] {
        d.set_item(name, dense(py, m.clone()))?;
    }
    d.set_item("f0", array(py, &[found.f0.len()], found.f0.clone()))?;
    d.set_item("exact", found.derivatives == Derivatives::Exact)?;
    d.set_item("steady", made.steady)?;
    d.set_item("accelerates", made.accelerates)?;
    d.set_item("conservative", made.conservative)?;
    if beside {
        for (name, m) in [
            ("displacements", &found.displacements),
            ("rates", &found.rates),
            ("accelerations", &found.accelerations),
            ("multiplier_changes", &found.multipliers),
        ] {
            d.set_item(name, dense(py, m.clone()))?;
        }
        d.set_item("vdot", array(py, &[made.vdot.len()], made.vdot.clone()))?;
        d.set_item("multipliers", array(py, &[made.multipliers.len()], made.multipliers.clone()))?;
        let (_, q, v) = state;
        let probes = made.probes(model, q, v);
        let count = 2 * probes.steps.len();
        d.set_item("steps", array(py, &[probes.steps.len()], probes.steps))?;
        for (name, rows, width) in [
            ("probe_q", probes.q, q.len()),
            ("probe_v", probes.v, v.len()),
            ("probe_vdot", probes.vdot, v.len()),
            ("probe_multipliers", probes.multipliers, found.multipliers.rows()),
        ] {
            d.set_item(name, array(py, &[count, width], rows))?;
        }
    }
    let n = found.displacements.rows();
    d.set_item("modes", made.modes.as_ref().map(|m| modes(py, m, n)).transpose()?)?;
    Ok(d)
}

/// q moved by each of the displacements (nv numbers, one after the other), and its loops closed.
pub fn displaced<'py>(
    py: Python<'py>,
    model: &Model,
    t: f64,
    q: &[f64],
    displacements: &[f64],
) -> PyResult<Array<'py>> {
    let mut found = Vec::new();
    for by in displacements.chunks_exact(model.size().nv) {
        let mut at = q.to_vec();
        model.step(&mut at, by);
        poses::closed(model, t, &mut at, tolerance::CLOSED, &[]).map_err(|e| failure::system(py, e))?;
        found.extend(at);
    }
    Ok(array(py, &[found.len() / q.len().max(1), q.len()], found))
}
