//! Requests of a page and their answers.

use partita_analysis::determined::flags;
use partita_analysis::error::AnalysisError;
use partita_analysis::outputs::{self, Forces, States};
use partita_analysis::poses::{self, Ask};
use partita_analysis::report;
use partita_analysis::run::{run, Request};
use partita_integrate::simulate::Status;
use partita_math::tolerance;
use partita_model::spec::Spec;
use partita_model::value::NoFunctions;
use partita_model::zero_position::Coordinates;
use partita_model::{DescriptionError, Model};
use partita_system::positions::turns;
use partita_system::prelude::*;
use partita_system::SystemError;
use serde::Deserialize;
use serde_json::{json, Value};
use std::ops::ControlFlow;
use std::sync::Arc;

/// What a page asks.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Question {
    /// The report on a mechanism, and where its bodies are with the loops closed.
    Examine {
        /// Its description.
        mechanism: Value,
    },
    /// A motion from the drawing, at rest where no drive moves it.
    Run {
        /// Its description.
        mechanism: Value,
        /// Length (s).
        duration: f64,
        /// Number of outputs, evenly spaced.
        outputs: usize,
        /// Relative tolerance.
        rtol: f64,
        /// Absolute tolerance.
        atol: f64,
    },
}

/// Why there is no answer.
enum Refused {
    /// The request could not be read.
    Request(String),
    /// The description has no meaning.
    Description(DescriptionError),
    /// The core cannot compute it.
    Analysis(AnalysisError),
}

impl From<DescriptionError> for Refused {
    fn from(e: DescriptionError) -> Self {
        Self::Description(e)
    }
}
impl From<AnalysisError> for Refused {
    fn from(e: AnalysisError) -> Self {
        Self::Analysis(e)
    }
}
impl From<SystemError> for Refused {
    fn from(e: SystemError) -> Self {
        Self::Analysis(e.into())
    }
}

impl Refused {
    /// `open`: the loops cannot be closed, or no motion can start there; else `refused`.
    fn into_json(self) -> Value {
        let (kind, message) = match self {
            Self::Request(message) => ("refused", message),
            Self::Description(e) => ("refused", e.to_string()),
            Self::Analysis(e) => (if is_open(&e) { "open" } else { "refused" }, e.to_string()),
        };
        json!({ "error": { "kind": kind, "message": message } })
    }
}

fn is_open(e: &AnalysisError) -> bool {
    let AnalysisError::System(e) = e else { return false };
    matches!(
        e,
        SystemError::Assembly { .. }
            | SystemError::Targets { .. }
            | SystemError::Lengths { .. }
            | SystemError::Limit { .. }
            | SystemError::Contradiction { .. }
            | SystemError::Singular { .. }
            | SystemError::SingularStart { .. }
            | SystemError::Crossing { .. }
            | SystemError::DeadPoint { .. }
    )
}

/// The answer to a request, both as JSON; an error is an answer with the key `error`.
pub fn answer(request: &str) -> String {
    let found = match serde_json::from_str(request) {
        Err(e) => Err(Refused::Request(e.to_string())),
        Ok(Question::Examine { mechanism }) => examined(&mechanism),
        Ok(Question::Run { mechanism, duration, outputs, rtol, atol }) => {
            let request = Request { rtol, atol, ..Request::over(0.0, duration) };
            moved(&mechanism, &request, outputs)
        }
    };
    found.unwrap_or_else(Refused::into_json).to_string()
}

fn compiled(mechanism: &Value) -> Result<Model, Refused> {
    let spec = Spec::from_json(&mechanism.to_string()).map_err(|e| Refused::Request(e.to_string()))?;
    Ok(Model::new(spec, Arc::new(NoFunctions), Coordinates::Relative)?)
}

/// The drawing with its loops closed, and the rates that its drives prescribe.
fn assembled(model: &Model) -> Result<(Vec<f64>, Vec<f64>), Refused> {
    let ask = Ask { tolerance: tolerance::CLOSED, ..Ask::default() };
    let q = poses::one(model, 0.0, &model.initial(), &ask)?.q;
    let rest = vec![0.0; model.size().nv];
    let v = match model.structure().rheonomic {
        true => poses::with_rates(model, 0.0, &q, &rest, &[], &[])?,
        false => rest,
    };
    Ok((q, v))
}

fn never() -> Result<(), AnalysisError> {
    Ok(())
}

/// Positions and rotations of all bodies at all outputs: twelve numbers each.
fn poses_of(model: &Model, states: &States) -> Result<Vec<Vec<f64>>, Refused> {
    let count = model.spec.bodies.len();
    let which: Vec<usize> = (0..count).collect();
    let tables = outputs::bodies(model, states, &which, &mut never)?;
    let row = |i: usize| {
        let of = |b: usize| [&tables[0][3 * (i * count + b)..][..3], &tables[1][9 * (i * count + b)..][..9]].concat();
        (0..count).flat_map(of).collect()
    };
    Ok((0..states.len()).map(row).collect())
}

fn examined(mechanism: &Value) -> Result<Value, Refused> {
    let model = compiled(mechanism)?;
    let (q, v) = assembled(&model)?;
    let found = report(&model, 0.0, &q)?;
    let bodies = poses_of(&model, &States { t: &[0.0], q: &q, v: &v })?;
    Ok(json!({ "report": found, "bodies": bodies[0] }))
}

/// Rows of a table.
fn rows(table: &[f64], count: usize) -> Value {
    let width = table.len() / count.max(1);
    json!((0..count).map(|i| &table[i * width..][..width]).collect::<Vec<_>>())
}

fn moved(mechanism: &Value, request: &Request, outputs: usize) -> Result<Value, Refused> {
    let model = compiled(mechanism)?;
    let (q, v) = assembled(&model)?;
    let last = outputs.saturating_sub(1).max(1);
    let at = |i: usize| if i == last { request.t_end } else { request.t_end * i as f64 / last as f64 };
    let times: Vec<f64> = (0..outputs).map(at).collect();
    let mut watch = |_: f64| ControlFlow::Continue(());
    let found = run(&model, request, None, &times, (&q, &v), &mut watch)?;
    let whole = |q: &[f64], n: &[i32]| q.iter().zip(n).map(|(q, n)| turns::whole(*q, *n)).collect::<Vec<f64>>();
    let log = &found.log.outputs;
    let t: Vec<f64> = log.iter().map(|x| x.t).collect();
    let q: Vec<f64> = log.iter().flat_map(|x| whole(&x.q, &x.turns)).collect();
    let v: Vec<f64> = log.iter().flat_map(|x| x.v.iter().copied()).collect();
    let states = States { t: &t, q: &q, v: &v };
    let known = found.log.describe(&model, false, &mut never)?;
    let forces = Forces { vdot: &known.vdot, multipliers: &known.multipliers };
    let reactions = outputs::reactions(&model, &states, &forces, &mut never)?;
    let determined = flags(&model, &states, &mut never)?;
    let energies = outputs::energies(&model, &states, &mut never)?;
    let points = outputs::joints(&model, &states, &(0..model.spec.joints.len()).collect::<Vec<_>>(), &mut never)?;
    let n = t.len();
    Ok(json!({
        "success": found.outcome.status == Status::Finished,
        "message": found.outcome.message,
        "notes": found.notes,
        "t": t,
        "bodies": poses_of(&model, &states)?,
        "points": rows(&points[2], n),
        "force": rows(&reactions[0], n),
        "moment": rows(&reactions[1], n),
        "determined": rows(&determined[0], n),
        "kinetic": energies[0],
        "potential": energies[1],
    }))
}
