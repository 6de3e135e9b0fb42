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
    /// Times of singular positions that were stepped over (see [`Passage`]).
    pub passages: Vec<f64>,
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
    let mut march = March {
        buffer: vec![0.0; dim],
        slope: vec![0.0; dim],
        sample: Sample::default(),
        next: 0,
        t_eval,
        passage: Passage::new(settings.tableau, dim),
    };
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
            passages: Vec::new(),
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
    Ok(Outcome { status, message, t, counters: *stepper.counters(), passages: march.passage.times, error })
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

/// Stepping over a singular position of the mechanism.
///
/// Next to one the tangent is a quotient of small numbers, so rounding grows with the inverse of the distance: steps that
/// creep up to it shrink without end, while one step across it, with no stage near it, is as exact as any other. When the
/// step size collapses, the march goes back to where it was healthy and crosses in one step whose stages keep away.
struct Passage {
    /// Length of the crossing step in units of the distance to the singular position.
    stretch: f64,
    /// Last healthy state: time and y.
    t: f64,
    y: Vec<f64>,
    /// Step size there, decaying slowly: what is usual for this motion.
    usual: f64,
    times: Vec<f64>,
}

impl Passage {
    fn new(tableau: &Tableau, dim: usize) -> Self {
        // the stretch that keeps all nodes as far as can be from the position passed
        let clearance = |r: f64| tableau.c.iter().fold(r - 1.0, |m: f64, c| m.min((c * r - 1.0).abs()));
        let stretch = (130..300).map(|i| f64::from(i) / 100.0).fold(1.3, |b, r| if clearance(r) > clearance(b) { r } else { b });
        Self { stretch, t: f64::NAN, y: vec![0.0; dim], usual: 0.0, times: Vec::new() }
    }

    /// Remember the start of the next step if its size is usual, or in any case after a change of coordinates.
    fn remember(&mut self, stepper: &Stepper, changed: bool) {
        let h = stepper.step_size();
        self.usual = h.max(0.9 * self.usual);
        if changed || self.t.is_nan() || h >= 0.2 * self.usual {
            self.t = stepper.t_old();
            self.y.copy_from_slice(stepper.y_old());
        }
    }
}

struct March<'t> {
    buffer: Vec<f64>,
    slope: Vec<f64>,
    sample: Sample,
    next: usize,
    t_eval: &'t [f64],
    passage: Passage,
}

type Sink<'s> = &'s mut dyn FnMut(&Sample) -> Result<(), SystemError>;

impl March<'_> {
    fn emit<F: Formulation>(&mut self, formulation: &mut F, t: f64, y: &[f64], sink: Sink) -> Result<(), SystemError> {
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
        sink: Sink,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Status, StepFailure<SystemError>> {
        self.passage.remember(stepper, true);
        while !stepper.finished() {
            if stepper.counters().steps >= settings.max_steps {
                return Ok(Status::MaxSteps);
            }
            match self.step(formulation, stepper, sink) {
                Ok(changed) => self.passage.remember(stepper, changed),
                Err(StepFailure::TooSmall { t, h, last }) if settings.options.fixed_step.is_none() => {
                    self.cross(formulation, stepper, settings.t_end, t, sink)
                        .and_then(|crossed| if crossed { Ok(()) } else { Err(StepFailure::TooSmall { t, h, last }) })?;
                }
                Err(failure) => return Err(failure),
            }
            if watch(stepper.t_old()).is_break() {
                return Ok(Status::Interrupted);
            }
        }
        Ok(Status::Finished)
    }

    /// One accepted step with its outputs; true if the independent coordinates changed.
    fn step<F: Formulation>(
        &mut self,
        formulation: &mut F,
        stepper: &mut Stepper,
        sink: Sink,
    ) -> Result<bool, StepFailure<SystemError>> {
        let at = |t: f64| move |error: SystemError| StepFailure::Rhs { t, error };
        let mut changed = false;
        loop {
            stepper.attempt(&mut Adapter(formulation))?;
            let t = stepper.t_new();
            let may_shrink = stepper.step_size() > 1e-13 * t.abs().max(1e-3);
            let corrected = match formulation.correct(t, stepper.y_new_mut()) {
                Ok(corrected) => corrected,
                Err(e) if e.is_local() && may_shrink => {
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
                changed = true;
                continue;
            }
            match self.outputs(formulation, stepper, sink) {
                Ok(()) => {}
                Err(StepFailure::Interpolation { .. }) if may_shrink => {
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
                changed = true;
            }
            stepper.commit();
            return Ok(changed);
        }
    }

    /// Go back to the last healthy state and cross the position at `singular` in one step; true if that worked.
    fn cross<F: Formulation>(
        &mut self,
        formulation: &mut F,
        stepper: &mut Stepper,
        t_end: f64,
        singular: f64,
        sink: Sink,
    ) -> Result<bool, StepFailure<SystemError>> {
        let (from, start) = (self.passage.t, self.passage.y.clone());
        if !(singular > from) {
            return Ok(false);
        }
        // a shorter crossing has a smaller error of its own, a longer one less rounding
        for part in [0.4, 0.2, 0.1, 0.05, 0.025] {
            let distance = (part * self.passage.usual).min(singular - from);
            let begin = singular - distance;
            stepper.start(&mut Adapter(formulation), from, &start, if begin > from { begin } else { t_end })?;
            let mut arrived = true;
            while begin > from && arrived && !stepper.finished() {
                arrived = match self.step(formulation, stepper, sink) {
                    Ok(false) => true,
                    // other coordinates: the state to go back to is a new one
                    Ok(true) => {
                        self.passage.remember(stepper, true);
                        return Ok(true);
                    }
                    Err(StepFailure::TooSmall { .. }) => false,
                    Err(failure) => return Err(failure),
                };
            }
            if !arrived {
                continue;
            }
            stepper.set_t_end(t_end);
            stepper.set_step_size(self.passage.stretch * distance);
            let before = stepper.t_old();
            match self.step(formulation, stepper, sink) {
                Ok(changed) if stepper.t_old() > before + 1.2 * distance => {
                    self.passage.times.push(singular);
                    self.passage.remember(stepper, changed);
                    return Ok(true);
                }
                Ok(true) => {
                    self.passage.remember(stepper, true);
                    return Ok(true);
                }
                Ok(false) | Err(StepFailure::TooSmall { .. }) => {}
                Err(failure) => return Err(failure),
            }
        }
        Ok(false)
    }

    fn outputs<F: Formulation>(
        &mut self,
        formulation: &mut F,
        stepper: &mut Stepper,
        sink: Sink,
    ) -> Result<(), StepFailure<SystemError>> {
        while self.next < self.t_eval.len() && self.t_eval[self.next] <= stepper.t_new() {
            let t = self.t_eval[self.next];
            let mut y = std::mem::take(&mut self.buffer);
            let done = stepper.interpolate(&mut Adapter(formulation), t, &mut y);
            let done =
                done.and_then(|()| self.emit(formulation, t, &y, sink).map_err(|error| StepFailure::Rhs { t, error }));
            self.buffer = y;
            done?;
        }
        Ok(())
    }
}
