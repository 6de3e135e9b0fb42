//! Marching a mechanism: steps, corrections, changes of coordinates, outputs.

use crate::counters::Counters;
use crate::explicit_rk::{Conclusion, Stepper};
use crate::failure::StepFailure;
use crate::ode::{Ode, RhsError};
use crate::options::Options;
use crate::tableau::Tableau;
use partita_system::formulation::{Formulation, Review, Sample};
use partita_system::SystemError;
use std::ops::ControlFlow;

/// Settings of a run.
#[derive(Clone, Debug)]
pub struct Settings {
    /// End of the run.
    pub t_end: f64,
    /// Method.
    pub tableau: &'static Tableau,
    /// Tolerances and steps; `controlled` is set by the run.
    pub options: Options,
    /// Accepted steps at the most.
    pub max_steps: u64,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// At its end.
    Finished,
    /// By the user; what was computed is kept.
    Interrupted,
    /// No acceptable step was left.
    StepTooSmall,
    /// At a singular position of the mechanism.
    Singular,
    /// After the number of steps allowed.
    MaxSteps,
    /// Because something could not be evaluated.
    EvaluationFailed,
}

impl Status {
    /// In a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Finished => "finished",
            Self::Interrupted => "interrupted",
            Self::StepTooSmall => "step-too-small",
            Self::Singular => "singular",
            Self::MaxSteps => "max-steps",
            Self::EvaluationFailed => "evaluation-failed",
        }
    }
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
    /// What stopped it, if something failed.
    pub error: Option<SystemError>,
}

struct Adapter<'f, F: Formulation>(&'f mut F);

impl<F: Formulation> Ode for Adapter<'_, F> {
    type Error = SystemError;
    fn dim(&self) -> usize {
        self.0.dim()
    }
    #[inline]
    fn rhs(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), RhsError<SystemError>> {
        self.0.derivative(t, y, dy).map_err(|e| if e.is_local() { RhsError::Retry(e) } else { RhsError::Fatal(e) })
    }
}

/// March from `(t, q, v)` to the end; `sink` gets a sample at each time of `t_eval`, `watch` is asked after each step.
///
/// Outputs lie on the dense output of the step and are closed to round-off one by one. What was computed before a
/// failure stays with the sink. Fails only where nothing could start.
pub fn simulate<F: Formulation>(
    formulation: &mut F,
    t: f64,
    q: &[f64],
    v: &[f64],
    t_eval: &[f64],
    settings: &Settings,
    sink: &mut dyn FnMut(&Sample) -> Result<(), SystemError>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, SystemError> {
    let dim = formulation.dim();
    let mut y = vec![0.0; dim];
    formulation.start(t, q, v, &mut y)?;
    let mut march = March { buffer: vec![0.0; dim], slope: vec![0.0; dim], sample: Sample::default(), next: 0, t_eval };
    let options = Options { controlled: formulation.controlled(), ..settings.options.clone() };
    let mut stepper =
        Stepper::new(settings.tableau, dim, options).map_err(|e| SystemError::Request(format!("settings: {e}")))?;
    while march.next < t_eval.len() && t_eval[march.next] <= t {
        march.emit(formulation, t, &y, sink)?;
    }
    if settings.t_end <= t {
        return Ok(Outcome {
            status: Status::Finished,
            message: format!("nothing to march: the run ends where it starts, at t = {t}"),
            t,
            counters: Counters::default(),
            error: None,
        });
    }
    // the outputs may have moved the formulation: the stepper evaluates its own start
    if let Err(failure) = stepper.start(&mut Adapter(formulation), t, &y, settings.t_end) {
        return match failure {
            StepFailure::Rhs { error, .. } => Err(error),
            other => Err(SystemError::Request(other.to_string())),
        };
    }
    let ended = march.run(formulation, &mut stepper, settings, sink, watch);
    let t = stepper.t_old();
    let (status, message, error) = match ended {
        Ok(status) => (status, sentence(status, t, settings), None),
        Err(failure) => explain(failure, t),
    };
    Ok(Outcome { status, message, t, counters: *stepper.counters(), error })
}

fn sentence(status: Status, t: f64, settings: &Settings) -> String {
    match status {
        Status::Interrupted => format!("interrupted at t = {t}; the outputs up to there are kept"),
        Status::MaxSteps => format!(
            "stopped at t = {t} after {} steps; allow more with max_steps, or loosen the tolerances",
            settings.max_steps
        ),
        _ => format!("reached t = {t}"),
    }
}

fn explain(failure: StepFailure<SystemError>, t: f64) -> (Status, String, Option<SystemError>) {
    let message = failure.to_string();
    match failure {
        StepFailure::TooSmall { last: Some(e @ SystemError::Singular { .. }), .. } => {
            (Status::Singular, format!("stopped at t = {t}: {e}"), Some(e))
        }
        StepFailure::TooSmall { last, .. } => (Status::StepTooSmall, message, last),
        StepFailure::Rhs { error, .. } | StepFailure::Interpolation { error, .. } => {
            let status =
                if matches!(error, SystemError::Singular { .. }) { Status::Singular } else { Status::EvaluationFailed };
            (status, format!("stopped at t = {t}: {error}"), Some(error))
        }
        StepFailure::NotFinite { .. } => (Status::EvaluationFailed, message, None),
    }
}

struct March<'t> {
    buffer: Vec<f64>,
    slope: Vec<f64>,
    sample: Sample,
    next: usize,
    t_eval: &'t [f64],
}

impl March<'_> {
    fn emit<F: Formulation>(
        &mut self,
        formulation: &mut F,
        t: f64,
        y: &[f64],
        sink: &mut dyn FnMut(&Sample) -> Result<(), SystemError>,
    ) -> Result<(), SystemError> {
        formulation.sample(t, y, &mut self.sample)?;
        sink(&self.sample)?;
        self.next += 1;
        Ok(())
    }

    fn run<F: Formulation>(
        &mut self,
        formulation: &mut F,
        stepper: &mut Stepper,
        settings: &Settings,
        sink: &mut dyn FnMut(&Sample) -> Result<(), SystemError>,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Status, StepFailure<SystemError>> {
        let at = |t: f64| move |error: SystemError| StepFailure::Rhs { t, error };
        while !stepper.finished() {
            if stepper.counters().steps >= settings.max_steps {
                return Ok(Status::MaxSteps);
            }
            stepper.attempt(&mut Adapter(formulation))?;
            let t = stepper.t_new();
            let corrected = match formulation.correct(t, stepper.y_new_mut()) {
                Ok(corrected) => corrected,
                Err(e) if e.is_local() && stepper.step_size() > 1e-13 * t.abs().max(1e-3) => {
                    stepper.reject(0.5);
                    continue;
                }
                Err(e) => return Err(at(t)(e)),
            };
            if stepper.conclude(&mut Adapter(formulation), corrected)? == Conclusion::Rejected {
                continue;
            }
            let review = formulation.review(t, stepper.y_new());
            if review == Review::Reject {
                stepper.reject(0.5);
                let t = stepper.t_old();
                self.buffer.copy_from_slice(stepper.y_old());
                formulation.recover(t, &mut self.buffer, &mut self.slope).map_err(at(t))?;
                stepper.replace_start(&self.buffer, &self.slope);
                continue;
            }
            match self.outputs(formulation, stepper, sink) {
                Ok(()) => {}
                Err(StepFailure::Interpolation { .. }) if stepper.step_size() > 1e-13 * t.abs().max(1e-3) => {
                    stepper.reject(0.5);
                    continue;
                }
                Err(failure) => return Err(failure),
            }
            if review == Review::Change {
                self.buffer.copy_from_slice(stepper.y_new());
                self.slope.copy_from_slice(stepper.dy_new());
                formulation.change(t, &mut self.buffer, &mut self.slope).map_err(at(t))?;
                stepper.replace(&self.buffer, &self.slope);
            }
            stepper.commit();
            if watch(stepper.t_old()).is_break() {
                return Ok(Status::Interrupted);
            }
        }
        Ok(Status::Finished)
    }

    fn outputs<F: Formulation>(
        &mut self,
        formulation: &mut F,
        stepper: &mut Stepper,
        sink: &mut dyn FnMut(&Sample) -> Result<(), SystemError>,
    ) -> Result<(), StepFailure<SystemError>> {
        while self.next < self.t_eval.len() && self.t_eval[self.next] <= stepper.t_new() {
            let t = self.t_eval[self.next];
            let mut y = std::mem::take(&mut self.buffer);
            let done = stepper.interpolate(&mut Adapter(formulation), t, &mut y);
            let done = done.and_then(|()| {
                self.emit(formulation, t, &y, sink).map_err(|error| StepFailure::Rhs { t, error })
            });
            self.buffer = y;
            done?;
        }
        Ok(())
    }
}
