//! Errors of the core as the classes of `partita.errors`, with the same fields; a panic never reaches Python.

use partita_model::DescriptionError;
use partita_system::SystemError;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::panic::{catch_unwind, AssertUnwindSafe};

/// A field of an error.
pub enum Field {
    /// Text.
    Text(String),
    /// Number.
    Number(f64),
    /// Count.
    Count(usize),
}

impl From<&str> for Field {
    fn from(x: &str) -> Self {
        Self::Text(x.into())
    }
}
impl From<String> for Field {
    fn from(x: String) -> Self {
        Self::Text(x)
    }
}
impl From<f64> for Field {
    fn from(x: f64) -> Self {
        Self::Number(x)
    }
}
impl From<usize> for Field {
    fn from(x: usize) -> Self {
        Self::Count(x)
    }
}

/// The exception `partita.errors.<name>(message, **fields)`.
pub fn raise(py: Python<'_>, name: &str, message: &str, fields: &[(&str, Field)]) -> PyErr {
    let build = || -> PyResult<PyErr> {
        let class = py.import("partita.errors")?.getattr(name)?;
        let kwargs = PyDict::new(py);
        for (key, value) in fields {
            match value {
                Field::Text(x) => kwargs.set_item(key, x)?,
                Field::Number(x) => kwargs.set_item(key, x)?,
                Field::Count(x) => kwargs.set_item(key, x)?,
            }
        }
        Ok(PyErr::from_value(class.call((message,), Some(&kwargs))?))
    };
    build().unwrap_or_else(|e| e)
}

/// A description error.
pub fn description(py: Python<'_>, e: &DescriptionError) -> PyErr {
    raise(py, "DescriptionError", &e.to_string(), &[("element", e.element.into()), ("name", e.name.clone().into())])
}

/// A system error; a user's own exception passes through unchanged.
pub fn system(py: Python<'_>, e: SystemError) -> PyErr {
    let message = e.to_string();
    exception(py, e, message)
}

/// A system error in these words.
fn exception(py: Python<'_>, e: SystemError, message: String) -> PyErr {
    match e {
        SystemError::Function { source, what } => match source.downcast::<PyErr>() {
            Ok(own) => *own,
            Err(other) => {
                let fields = [("t", f64::NAN.into()), ("where", what.into())];
                raise(py, "EvaluationError", &other.to_string(), &fields)
            }
        },
        SystemError::Singular { t, pivot, .. } => {
            raise(py, "SingularityError", &message, &[("t", t.into()), ("quality", pivot.into())])
        }
        SystemError::NotFinite { what, t } | SystemError::OutsideTable { what, t, .. } => {
            raise(py, "EvaluationError", &message, &[("t", t.into()), ("where", what.into())])
        }
        SystemError::OutsideCurve { what, .. }
        | SystemError::Wound { what, .. }
        | SystemError::Uncounted { what, .. }
        | SystemError::Twisted { what, .. } => {
            raise(py, "EvaluationError", &message, &[("t", f64::NAN.into()), ("where", what.into())])
        }
        SystemError::Assembly { iterations, residual, loops, .. }
        | SystemError::Targets { iterations, residual, loops, .. } => {
            let fields = [("residual", residual.into()), ("iterations", iterations.into()), ("loops", loops.into())];
            raise(py, "AssemblyError", &message, &fields)
        }
        SystemError::Lengths { iterations, residual, loops, .. } => {
            let loops = String::from(loops);
            let fields = [("residual", residual.into()), ("iterations", iterations.into()), ("loops", loops.into())];
            raise(py, "AssemblyError", &message, &fields)
        }
        SystemError::Limit { block, shortfall, .. } => {
            let fields = [("residual", shortfall.into()), ("iterations", 0usize.into()), ("loops", block.into())];
            raise(py, "AssemblyError", &message, &fields)
        }
        SystemError::Contradiction { t, who, whom, gap, .. } => {
            let fields = [
                ("t", t.into()),
                ("gap", gap.into()),
                ("who", String::from(who).into()),
                ("whom", whom.join(", ").into()),
            ];
            raise(py, "ContradictionError", &message, &fields)
        }
        SystemError::Unfelt { .. } => {
            raise(py, "DescriptionError", &message, &[("element", "mechanism".into()), ("name", "".into())])
        }
        SystemError::Mass { name, .. } => {
            raise(py, "DescriptionError", &message, &[("element", "mechanism".into()), ("name", name.into())])
        }
        SystemError::SingularStart { t, .. }
        | SystemError::Crossing { t, .. }
        | SystemError::Tick { t, .. }
        | SystemError::Choice { t, .. } => {
            raise(py, "SingularityError", &message, &[("t", t.into()), ("quality", 0.0.into())])
        }
        SystemError::OpenReaction { t, friction, joint } => {
            let (friction, joint) = (String::from(friction), String::from(joint));
            let fields = [("t", t.into()), ("where", friction.into()), ("joint", joint.into())];
            raise(py, "OpenReactionError", &message, &fields)
        }
        SystemError::Jammed { t, friction, .. } => {
            raise(py, "EvaluationError", &message, &[("t", t.into()), ("where", String::from(friction).into())])
        }
        SystemError::Jump { t, what, .. } => {
            raise(py, "EvaluationError", &message, &[("t", t.into()), ("where", String::from(what).into())])
        }
        SystemError::Basis { t, .. } | SystemError::DeadPoint { t, .. } => {
            raise(py, "SingularityError", &message, &[("t", t.into()), ("quality", 0.0.into())])
        }
        SystemError::Derivative { function, row, column, given, found, t, .. } => {
            let mut fields = vec![("t", t.into()), ("function", function.into()), ("row", row.into())];
            fields.extend(column.map(|j| ("column", j.into())));
            fields.extend([("given", given.into()), ("found", found.into())]);
            raise(py, "DerivativeError", &message, &fields)
        }
        SystemError::Argument { argument, .. } => {
            raise(py, "ArgumentError", &message, &[("argument", String::from(argument).into())])
        }
        SystemError::Unchosen(_) => raise(py, "PartitaError", &message, &[]),
    }
}

/// An analysis error.
pub fn analysis(py: Python<'_>, e: partita_analysis::AnalysisError) -> PyErr {
    match e {
        partita_analysis::AnalysisError::Description(e) => description(py, &e),
        partita_analysis::AnalysisError::Argument { argument, message } => {
            raise(py, "ArgumentError", &message, &[("argument", argument.into())])
        }
        partita_analysis::AnalysisError::Unknown { name, message } => {
            raise(py, "UnknownNameError", &message, &[("name", name.into())])
        }
        partita_analysis::AnalysisError::Explained { error, cause } => {
            let message = format!("{error}; {cause}");
            exception(py, error, message)
        }
        stopped @ partita_analysis::AnalysisError::Stopped => unexpected(stopped.to_string()),
        partita_analysis::AnalysisError::System(e) => system(py, e),
    }
}

/// Run `f`; a panic in it becomes a `PartitaError` that asks for a report.
pub fn guarded<T>(py: Python<'_>, f: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    match catch_unwind(AssertUnwindSafe(f)) {
        Ok(result) => result,
        Err(payload) => {
            let text = payload
                .downcast_ref::<String>()
                .cloned()
                .or_else(|| payload.downcast_ref::<&str>().map(|s| (*s).to_string()))
                .unwrap_or_default();
            let message =
                format!("internal error: {text}; this is a bug in Partita, please report it together with the model");
            Err(raise(py, "PartitaError", &message, &[]))
        }
    }
}

/// A sentence for an internal error.
pub fn unexpected(message: String) -> PyErr {
    PyRuntimeError::new_err(message)
}
