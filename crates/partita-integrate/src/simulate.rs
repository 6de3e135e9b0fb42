//! A run from its start to its end, and how it ended.

use crate::adapter::is_of_a_position;
use crate::counters::Counters;
use crate::failure::StepFailure;
pub use crate::march::Observe;
pub use crate::march::Status;
use crate::march::{Control, March, Outputs};
use crate::method::Method;
use crate::options::Options;
use crate::step_log::StepLog;
use partita_system::event::Occurrence;
use partita_system::formulation::Formulation;
use partita_system::record::{Crossings, Output};
use partita_system::SystemError;
use std::ops::ControlFlow;

/// Settings of a run.
#[derive(Clone, Debug)]
pub struct Settings {
    /// End of the run.
    pub t_end: f64,
    /// Method.
    pub method: &'static dyn Method,
    /// Tolerances and steps; `controlled` is set by the run.
    pub options: Options,
    /// Maximum number of accepted steps.
    pub max_steps: u64,
}

/// End of a run.
#[derive(Debug)]
pub struct Outcome {
    /// How it ended.
    pub status: Status,
    /// In words.
    pub message: String,
    /// Time reached.
    pub t: f64,
    /// Work of the stepper.
    pub counters: Counters,
    /// Singular positions that were stepped over.
    pub crossings: Crossings,
    /// What else is to be known, in sentences.
    pub notes: Vec<String>,
    /// What stopped it, if something failed.
    pub error: Option<SystemError>,
}

impl Outcome {
    /// Of a run that did not begin.
    pub fn nothing() -> Self {
        Self {
            status: Status::EvaluationFailed,
            message: String::new(),
            t: f64::NAN,
            counters: Counters::default(),
            crossings: Crossings::default(),
            notes: Vec::new(),
            error: None,
        }
    }
}

/// Integrate from `(t, q, v)` to the end; `sink` receives an output at each time of `t_eval`, `watch` is called after
/// each step.
///
/// Outputs lie on the dense output of the step and are closed to round-off one by one; other quantities at them are
/// computed on request (`Sample::of`). What was computed before a failure stays with the sink. Fails only where nothing
/// could start.
pub fn simulate(
    formulation: &mut dyn Formulation,
    t: f64,
    q: &[f64],
    v: &[f64],
    t_eval: &[f64],
    settings: &Settings,
    sink: &mut dyn FnMut(&Output) -> Result<(), SystemError>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, SystemError> {
    simulate_recorded(formulation, (t, q, v), t_eval, settings, &mut Recorded::default(), sink, watch)
}

/// What is recorded of a run besides its outputs.
#[derive(Debug, Default)]
pub struct Recorded {
    /// Its steps.
    pub steps: StepLog,
    /// The events to be found.
    pub observe: Option<Observe>,
    /// Those that occurred.
    pub occurrences: Vec<Occurrence>,
}

/// As [`simulate`], with what `recorded` is to receive.
///
/// # Errors
/// See [`simulate`].
pub fn simulate_recorded(
    formulation: &mut dyn Formulation,
    (t, q, v): (f64, &[f64], &[f64]),
    t_eval: &[f64],
    settings: &Settings,
    recorded: &mut Recorded,
    sink: &mut dyn FnMut(&Output) -> Result<(), SystemError>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, SystemError> {
    let control = Control::Free { max_steps: settings.max_steps };
    let mut march = March::new(formulation, q.len(), settings.method, settings.options.clone(), control)
        .map_err(|e| SystemError::argument("settings", format!("settings: {e}")))?;
    if let Some(observe) = recorded.observe.take() {
        march.observe(observe);
    }
    march.begin(formulation, t, (q, v), None)?;
    let mut outputs = Outputs::new(t_eval, sink);
    march.emit(formulation, &mut outputs)?;
    if settings.t_end <= t {
        return Ok(Outcome {
            status: Status::Finished,
            message: format!("nothing to integrate: the run starts and ends at t = {t}"),
            t,
            counters: Counters::default(),
            crossings: Crossings::default(),
            notes: Vec::new(),
            error: None,
        });
    }
    // the outputs may have moved the formulation: the stepper evaluates its own start
    if let Err(failure) = march.set_out(formulation, settings.t_end) {
        return match failure {
            StepFailure::Rhs { error, .. } => Err(error),
            other => Err(SystemError::argument("initial", other.to_string())),
        };
    }
    march.log_into(std::mem::take(&mut recorded.steps));
    let ended = march.go_on(formulation, &mut outputs, watch);
    recorded.steps = march.take_log();
    let counters = march.counters();
    let t = march.time();
    recorded.steps.end_at(t);
    let (status, message, error) = match ended {
        Ok(Status::Event) => {
            (Status::Event, format!("ended by event \"{}\" at t = {t}", march.ending().unwrap_or_default()), None)
        }
        Ok(status) => (status, sentence(status, t, settings), None),
        Err(failure) => explain(failure, t),
    };
    // a last step across a position next to the end may have passed others after it
    let crossings = formulation.point().crossings().until(t);
    let notes = march.notes().collect();
    recorded.occurrences = march.take_occurrences();
    Ok(Outcome { status, message, t, counters, crossings, notes, error })
}

fn sentence(status: Status, t: f64, settings: &Settings) -> String {
    match status {
        Status::Interrupted => format!("interrupted at t = {t}; the outputs up to there are kept"),
        Status::MaxSteps => format!(
            "stopped at t = {t:.6} s after {} steps; allow more with max_steps, or loosen the tolerances",
            settings.max_steps
        ),
        _ => format!("reached t = {t}"),
    }
}

/// Whether a position is singular: of the mechanism, or of coordinates that a rule chose.
fn is_singular(e: &SystemError) -> bool {
    is_of_a_position(e) || matches!(e, SystemError::Choice { .. })
}

/// Whether the error explains why no step led beyond.
fn says_why(e: &SystemError) -> bool {
    matches!(e, SystemError::Jump { .. } | SystemError::Jammed { .. }) || e.leaves_a_range()
}

/// The outcome of an integration that failed at t, in a word and in a sentence, and what failed.
pub fn explain(failure: StepFailure<SystemError>, t: f64) -> (Status, String, Option<SystemError>) {
    let message = failure.to_string();
    match failure {
        StepFailure::TooSmall { last: Some(e), .. } if is_singular(&e) => {
            (Status::Singular, format!("stopped at t = {t:.6} s: {e}"), Some(e))
        }
        StepFailure::TooSmall { last: Some(e), .. } if says_why(&e) => {
            (Status::EvaluationFailed, format!("stopped at t = {t:.6} s: {e}"), Some(e))
        }
        StepFailure::TooSmall { last, .. } => (Status::StepTooSmall, message, last),
        StepFailure::Rhs { error, .. } | StepFailure::Interpolation { error, .. } => {
            let status = match &error {
                SystemError::Contradiction { .. } => Status::Contradiction,
                e if is_singular(e) => Status::Singular,
                _ => Status::EvaluationFailed,
            };
            (status, format!("stopped at t = {t:.6} s: {error}"), Some(error))
        }
        StepFailure::NotFinite { .. } => (Status::EvaluationFailed, message, None),
    }
}
