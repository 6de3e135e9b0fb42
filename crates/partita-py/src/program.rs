//! A mechanism's equations as a program for a page, with the data that the page needs.

use crate::failure;
use partita_analysis::error::AnalysisError;
use partita_analysis::run::ExaminedStart;
use partita_model::{DescriptionError, Model};
use partita_system::prelude::*;
use pyo3::prelude::*;
use serde_json::{json, Map, Value};

/// Why there is no program.
pub(crate) enum Refused {
    /// A load cannot be recorded.
    Description(DescriptionError),
    /// No motion can start there.
    Start(AnalysisError),
}

/// As an exception.
pub(crate) fn raised(py: Python<'_>, e: Refused) -> PyErr {
    match e {
        Refused::Description(e) => failure::description(py, &e),
        Refused::Start(e) => failure::analysis(py, e),
    }
}

/// The module, and the rest as JSON.
pub(crate) fn recorded(model: &Model, names: &[String], t: f64, q: &[f64]) -> Result<(Vec<u8>, String), Refused> {
    let made = model.recorded(names).map_err(Refused::Description)?;
    let size = model.size();
    let rest = vec![0.0; size.nv];
    let dropped = ExaminedStart::at(model, (t, q, &rest), (t, 1.0), 0.0).map_err(Refused::Start)?.start.dropped;
    let pattern = model.pattern();
    let rows: Vec<Value> = (0..size.rows)
        .map(|i| {
            json!({
                "words": model.row_description(i), "owner": model.row_owner(i), "angle": model.row_is_angle(i),
                "drive": model.row_is_drive(i), "displacement": model.row_displacement(i),
            })
        })
        .collect();
    let ranges = |list: Vec<(&str, usize, usize)>| {
        list.into_iter().map(|(name, at, n)| (name.to_string(), json!([at, n]))).collect::<Map<_, _>>()
    };
    let parameters = made.parameters.iter().map(|(name, at, n)| (name.as_str(), *at, *n)).collect();
    let coordinates: Vec<[usize; 2]> =
        (0..size.nv).map(|i| model.coordinates_of(i)).map(|r| [r.start, r.end]).collect();
    let reported = json!({
        "coordinates": size.nq, "velocities": size.nv, "rows": size.rows, "holonomic": size.holonomic,
        "work": made.module.work, "operations": made.module.operations,
        "patterns": made.patterns.iter().map(|(name, at)| (name.to_string(), json!(at))).collect::<Map<_, _>>(),
        "parameters": ranges(parameters), "inputs": ranges(made.inputs.clone()), "outputs": ranges(made.outputs.clone()),
        "row_start": pattern.row_ptr, "columns": pattern.col_idx, "conditions": rows, "dropped": dropped,
        "coordinates_of": coordinates,
        "displacement": (0..size.nv).map(|i| model.characteristic_displacement(i)).collect::<Vec<_>>(),
        "names": (0..size.nv).map(|i| model.velocity_name(i)).collect::<Vec<_>>(),
        "length": model.placed.length,
    });
    Ok((made.module.bytes, reported.to_string()))
}
