//! Goals and poses between Python and Rust.

use crate::arrays::{array, matrix, rows_of, shaped, vector};
use crate::failure::{self, raise};
use crate::outputs::watched;
use crate::state::Array;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use partita_analysis::kinematic;
use partita_analysis::poses::{self, Ask, Goal, Outcome, Target};
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::SystemError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Name, kind ("own", "joint", "point", "turn"), number of the coordinate, joint or body, number of the coordinate or axis
/// in it, point in body axes, or reference orientation row by row.
pub type Named = (String, String, usize, usize, Vec<f64>);

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
        let rest = near.iter().all(|v| *v == 0.0) && !m.structure().rheonomic;
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
    let read = |(name, kind, of, part, numbers): &Named| {
        let body = *of < m.spec.bodies.len() && *part < 3;
        let goal = match kind.as_str() {
            "own" if *of < m.size().nq => Goal::Own { q: *of },
            "joint" if *of < m.spec.joints.len() => Goal::Joint { joint: *of, coordinate: *part },
            "point" | "turn" if body => {
                match (<[f64; 3]>::try_from(&numbers[..]), <[f64; 9]>::try_from(&numbers[..])) {
                    (Ok(point), _) => Goal::Point { body: *of, point, axis: *part },
                    (_, Ok(reference)) => Goal::Turn { body: *of, reference, axis: *part },
                    _ => return Err(refuse(name)),
                }
            }
            _ => return Err(refuse(name)),
        };
        Target::new(m, &goal, name).map_err(|e| failure::system(py, e))
    };
    let turns: Vec<_> = named.iter().filter(|x| x.1 == "turn").collect();
    if let Some(x) = turns.chunks(3).find(|x| x.len() != 3 || (0..3).any(|i| x[i].3 != i || x[i].2 != x[0].2)) {
        return Err(refuse(&x[0].0));
    }
    named.iter().map(read).collect()
}

/// Rows of a table with a column for each goal, all of them finite.
fn rows_for(values: &PyReadonlyArray2<'_, f64>, width: usize) -> PyResult<(usize, Vec<f64>)> {
    let py = values.py();
    let (count, columns, values) = matrix(values);
    if columns != width || !values.iter().all(|x| x.is_finite()) {
        let message = format!("values must be finite numbers, a column for each of the {width} goals");
        return Err(raise(py, "ArgumentError", &message, &[("argument", "targets".into())]));
    }
    Ok((count, values))
}

/// Velocities and accelerations for which goals move at these rates at the poses in the rows of `q`, by name.
pub fn rates<'py>(
    py: Python<'py>,
    m: &Model,
    (t, near): (f64, &PyReadonlyArray1<'py, f64>),
    q: &PyReadonlyArray2<'py, f64>,
    goals: &[Named],
    wanted: (&PyReadonlyArray2<'py, f64>, &PyReadonlyArray2<'py, f64>),
) -> PyResult<Bound<'py, PyDict>> {
    let (targets, size) = (targets(py, m, goals)?, m.size());
    let near = vector(near, size.nq, "near")?;
    let ((count, rates), (more, accelerations)) =
        (rows_for(wanted.0, targets.len())?, rows_for(wanted.1, targets.len())?);
    let q = rows_of(q, count, size.nq, "q")?;
    if more != count {
        let message = format!("{count} rates do not fit {more} accelerations");
        return Err(raise(py, "ArgumentError", &message, &[("argument", "accelerations".into())]));
    }
    let found = watched(py, |watch| kinematic::rates(m, (t, &near), &q, &targets, (&rates, &accelerations), watch))?;
    let (n, w) = (size.nv, targets.len());
    let d = PyDict::new(py);
    d.set_item("v", array(py, &[count, n], found.v))?;
    d.set_item("vdot", array(py, &[count, n], found.vdot))?;
    d.set_item("ratios", array(py, &[count, w, n], found.ratios))?;
    d.set_item("margin", array(py, &[count], found.margin))?;
    d.set_item("missed", found.missed)?;
    d.set_item("determined", found.determined.iter().map(|x| x.word()).collect::<Vec<_>>())?;
    Ok(d)
}

/// Degrees of freedom at a closed position, and rotations among them that move no other body.
pub fn degrees_of_freedom(
    py: Python<'_>,
    m: &Model,
    t: f64,
    q: &PyReadonlyArray1<'_, f64>,
) -> PyResult<(usize, usize)> {
    let q = vector(q, m.size().nq, "q")?;
    let found = kinematic::degrees_of_freedom(m, t, &q).map_err(|e| failure::system(py, e))?;
    Ok((found.all, found.idle))
}

/// q, values of the goals, and whether it is located to round-off.
pub type Ended<'py> = (Array<'py>, Array<'py>, bool);

/// Where the path of the goals from q to the values `to` ends; None where it does not.
pub fn limit<'py>(
    py: Python<'py>,
    m: &Model,
    t: f64,
    q: &PyReadonlyArray1<'py, f64>,
    goals: &[Named],
    to: &PyReadonlyArray1<'py, f64>,
) -> PyResult<Option<Ended<'py>>> {
    let targets = targets(py, m, goals)?;
    let (q, to) = (vector(q, m.size().nq, "q")?, vector(to, targets.len(), "to")?);
    let found = watched(py, |_| Ok(poses::limit(m, t, &q, &targets, &to)?))?;
    Ok(found.map(|x| (array(py, &[x.q.len()], x.q), array(py, &[x.goals.len()], x.goals), x.located)))
}

/// Where a reading is stationary on the path of the goals from q to the values `to`: q and the fraction of the path.
pub fn stationary<'py>(
    py: Python<'py>,
    m: &Model,
    t: f64,
    q: &PyReadonlyArray1<'py, f64>,
    goals: &[Named],
    to: &PyReadonlyArray1<'py, f64>,
    reading: Named,
) -> PyResult<Option<(Array<'py>, f64)>> {
    let (targets, reading) = (targets(py, m, goals)?, targets(py, m, &[reading])?);
    let (q, to) = (vector(q, m.size().nq, "q")?, vector(to, targets.len(), "to")?);
    let found = watched(py, |_| Ok(poses::stationary(m, t, &q, &targets, &to, &reading[0])?))?;
    Ok(found.map(|x| (array(py, &[x.q.len()], x.q), x.part)))
}

/// Positions for the rows of `values` on the branch of q, by name.
pub fn many<'py>(
    py: Python<'py>,
    m: &Model,
    t: f64,
    q: &PyReadonlyArray1<'py, f64>,
    goals: &[Named],
    values: &PyReadonlyArray2<'py, f64>,
    grid: Option<&[usize]>,
) -> PyResult<Bound<'py, PyDict>> {
    let targets = targets(py, m, goals)?;
    let (nq, width) = (m.size().nq, targets.len());
    let q = vector(q, nq, "q")?;
    let (count, values) = rows_for(values, width)?;
    let found = watched(py, |watch| poses::many(m, t, &q, &targets, &values, grid, watch))?;
    let d = PyDict::new(py);
    d.set_item("q", array(py, &[count, nq], found.q))?;
    d.set_item("reached", array(py, &[count, width], found.reached))?;
    d.set_item("shortfall", array(py, &[count], found.shortfall))?;
    d.set_item("angle", array(py, &[count], found.angle))?;
    d.set_item("detour", shaped(py, &[count], found.detour))?;
    d.set_item("status", shaped(py, &[count], found.outcomes.iter().map(|x| *x as u8).collect()))?;
    d.set_item("words", Outcome::ALL.map(Outcome::word))?;
    d.set_item("reasons", found.reasons)?;
    d.set_item("branch", found.branch)?;
    Ok(d)
}
