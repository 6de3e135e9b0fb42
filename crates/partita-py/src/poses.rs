//! Goals and poses between Python and Rust.

use crate::arrays::{array, matrix, shaped, vector};
use crate::failure::{self, raise};
use crate::outputs::{watched, Stop};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use partita_analysis::poses::{self, Ask, Goal, Target};
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::SystemError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Name, kind ("own", "joint", "point"), number of the coordinate, joint or body, number of the coordinate or axis in it,
/// point in body axes.
pub type Named = (String, String, usize, usize, [f64; 3]);

/// A goal and its value.
pub type Valued = (Named, f64);

fn valued(py: Python<'_>, m: &Model, given: Vec<Valued>) -> PyResult<Vec<(Target, f64)>> {
    let (named, values): (Vec<Named>, Vec<f64>) = given.into_iter().unzip();
    Ok(targets(py, m, &named)?.into_iter().zip(values).collect())
}

/// Request for one state.
pub struct Wanted {
    ask: Ask,
    rates: Vec<(usize, f64)>,
    turns: Vec<(Target, f64)>,
}

impl Wanted {
    /// From plain data.
    pub fn read(
        py: Python<'_>,
        m: &Model,
        levels: Vec<Vec<Valued>>,
        rates: Vec<(usize, f64)>,
        turns: Vec<Valued>,
        fixed: Vec<Named>,
        guess: Vec<Valued>,
        tolerance: f64,
    ) -> PyResult<Self> {
        let levels: PyResult<_> = levels.into_iter().map(|x| valued(py, m, x)).collect();
        let ask = Ask { guess: valued(py, m, guess)?, fixed: targets(py, m, &fixed)?, levels: levels?, tolerance };
        Ok(Self { ask, rates, turns: valued(py, m, turns)? })
    }

    /// q, v and the JSON report.
    pub fn assemble(
        &self,
        m: &Model,
        t: f64,
        q: &[f64],
        near: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>, String), SystemError> {
        let found = poses::one(m, t, q, &self.ask)?;
        let rest = near.iter().all(|v| *v == 0.0) && !m.rheonomic();
        let v = if rest && self.rates.is_empty() && self.turns.is_empty() {
            vec![0.0; m.size().nv]
        } else {
            poses::with_rates(m, t, &found.q, near, &self.rates, &self.turns)?
        };
        let met: Vec<_> = found
            .met
            .iter()
            .map(|x| serde_json::json!({ "target": x.name, "priority": x.level, "asked": x.asked, "reached": x.value }))
            .collect();
        let report = serde_json::json!({
            "iterations": found.iterations, "residual": found.residual, "target_steps": found.steps,
            "explicit": found.explicit, "targets": met
        });
        Ok((found.q, v, report.to_string()))
    }
}

/// The goals of a model.
pub fn targets(py: Python<'_>, m: &Model, named: &[Named]) -> PyResult<Vec<Target>> {
    let refuse = |name: &str| {
        let message = format!("{name} is neither a coordinate nor a point of this model");
        raise(py, "ArgumentError", &message, &[("argument", "targets".into())])
    };
    let read = |(name, kind, of, part, point): &Named| {
        let goal = match kind.as_str() {
            "own" if *of < m.size().nq => Goal::Own { q: *of },
            "joint" if *of < m.spec.joints.len() => Goal::Joint { joint: *of, coordinate: *part },
            "point" if *of < m.spec.bodies.len() && *part < 3 => Goal::Point { body: *of, point: *point, axis: *part },
            _ => return Err(refuse(name)),
        };
        Target::new(m, &goal, name).map_err(|e| failure::system(py, e))
    };
    named.iter().map(read).collect()
}

/// Positions for the rows of `values` on the branch of q, by name.
pub fn many<'py>(
    py: Python<'py>,
    m: &Model,
    t: f64,
    q: &PyReadonlyArray1<'py, f64>,
    goals: &[Named],
    values: &PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let targets = targets(py, m, goals)?;
    let (nq, width) = (m.size().nq, targets.len());
    let q = vector(q, nq, "q")?;
    let (count, columns, values) = matrix(values);
    if columns != width || !values.iter().all(|x| x.is_finite()) {
        let message = format!("values must be finite numbers, a column for each of the {width} goals");
        return Err(raise(py, "ArgumentError", &message, &[("argument", "targets".into())]));
    }
    let found = watched(py, |watch| poses::many::<Stop>(m, t, &q, &targets, &values, watch))?;
    let d = PyDict::new(py);
    d.set_item("q", array(py, &[count, nq], found.q))?;
    d.set_item("reached", array(py, &[count, width], found.reached))?;
    d.set_item("shortfall", array(py, &[count], found.shortfall))?;
    d.set_item("angle", array(py, &[count], found.angle))?;
    d.set_item("detour", shaped(py, &[count], found.detour))?;
    d.set_item("status", found.outcomes.iter().map(|x| x.word()).collect::<Vec<_>>())?;
    d.set_item("reasons", found.reasons)?;
    d.set_item("branch", found.branch)?;
    Ok(d)
}
