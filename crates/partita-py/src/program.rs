//! A mechanism's equations as a program for a page, with the data that the page needs.

use crate::failure;
use partita_analysis::error::AnalysisError;
use partita_analysis::run::ExaminedStart;
use partita_model::{DescriptionError, Model};
use partita_system::prelude::*;
use partita_system::system::structure::{Row, Structure};
use pyo3::prelude::*;
use serde_json::{json, Map};

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
    let Structure { rows, velocities, .. } = model.structure();
    let condition = |row: &Row| {
        json!({
            "words": &*row.description, "owner": &*row.owner, "angle": row.is_angle, "drive": row.is_drive,
            "displacement": row.displacement,
        })
    };
    let ranges = |list: Vec<(&str, usize, usize)>| {
        list.into_iter().map(|(name, at, n)| (name.to_string(), json!([at, n]))).collect::<Map<_, _>>()
    };
    let parameters = made.parameters.iter().map(|(name, at, n)| (name.as_str(), *at, *n)).collect();
    let coordinates: Vec<_> = velocities.iter().map(|v| [v.coordinates.start, v.coordinates.end]).collect();
    let reported = json!({
        "coordinates": size.nq, "velocities": size.nv, "rows": size.rows, "holonomic": size.holonomic,
        "work": made.module.work, "operations": made.module.operations,
        "patterns": made.patterns.iter().map(|(name, at)| (name.to_string(), json!(at))).collect::<Map<_, _>>(),
        "parameters": ranges(parameters), "inputs": ranges(made.inputs.clone()), "outputs": ranges(made.outputs.clone()),
        "row_start": pattern.row_ptr, "columns": pattern.col_idx, "dropped": dropped,
        "conditions": rows.iter().map(condition).collect::<Vec<_>>(),
        "coordinates_of": coordinates,
        "displacement": velocities.iter().map(|v| v.displacement).collect::<Vec<_>>(),
        "names": velocities.iter().map(|v| &*v.name).collect::<Vec<_>>(),
        "length": model.length(),
    });
    Ok((made.module.bytes, reported.to_string()))
}
