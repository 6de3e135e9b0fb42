//! Marching a mechanism: steps, corrections, changes of coordinates, outputs.

use crate::counters::Counters;
use crate::explicit_rk::{Conclusion, Stepper};
use crate::failure::StepFailure;
use crate::ode::{Ode, RhsError};
use crate::options::Options;
use crate::tableau::Tableau;
use partita_system::formulation::{Formulation, Pace, Step, Verdict};
use partita_system::record::Output;
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
    /// At its end, with something against it that breaks it: success is decided by what was watched on the way.
    Broken,
    /// By the user; what was computed is kept.
    Interrupted,
    /// No acceptable step was left.
    StepTooSmall,
    /// At a singular position of the mechanism, or at a dead point of coordinates that stay.
    Singular,
    /// Where conditions that depend on each other no longer agree.
    Contradiction,
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
            Self::Broken => "broken",
            Self::Interrupted => "interrupted",
            Self::StepTooSmall => "step-too-small",
            Self::Singular => "singular",
            Self::Contradiction => "contradiction",
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
    /// Times of singular positions that were stepped over.
    pub passages: Vec<f64>,
    /// What stopped it, if something failed.
    pub error: Option<SystemError>,
}

pub(crate) struct Adapter<'f, F: Formulation>(pub(crate) &'f mut F);

impl<F: Formulation> Ode for Adapter<'_, F> {
    type Error = SystemError;
    fn dim(&self) -> usize {
        self.0.dim()
    }
    #[inline]
    fn rhs(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), RhsError<SystemError>> {
        self.0.derivative(t, y, dy).map_err(sorted)
    }
}

pub(crate) fn sorted(e: SystemError) -> RhsError<SystemError> {
    if e.is_local() {
        RhsError::Retry(e)
    } else {
        RhsError::Fatal(e)
    }
}

/// The length that keeps all nodes of a step as far as can be from a point one unit after its start.
fn stretch(tableau: &Tableau) -> f64 {
    let clearance = |r: f64| tableau.c.iter().fold(r - 1.0, |m: f64, c| m.min((c * r - 1.0).abs()));
    (130..300).map(|i| f64::from(i) / 100.0).fold(1.3, |b, r| if clearance(r) > clearance(b) { r } else { b })
}

/// March from `(t, q, v)` to the end; `sink` gets an output at each time of `t_eval`, `watch` is asked after each step.
///
/// Outputs lie on the dense output of the step and are closed to round-off one by one; what else there is to know about
/// them is computed when it is asked for (`Sample::of`). What was computed before a failure stays with the sink. Fails only where nothing could start.
pub fn simulate<F: Formulation>(
    formulation: &mut F,
    t: f64,
    q: &[f64],
    v: &[f64],
    t_eval: &[f64],
    settings: &Settings,
    sink: &mut dyn FnMut(&Output) -> Result<(), SystemError>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, SystemError> {
    let dim = formulation.dim();
    let mut y = vec![0.0; dim];
    formulation.start(t, q, v, &mut y)?;
    let mut march = March {
        buffer: vec![0.0; dim],
        slope: vec![0.0; dim],
        output: Output { turns: vec![0; q.len()], ..Output::default() },
        next: 0,
        t_eval,
        stretch: stretch(settings.tableau),
        tolerance: settings.options.rtol.max(FINEST),
    };
    let options = Options { controlled: formulation.controlled(), ..settings.options.clone() };
    let mut stepper = Stepper::new(settings.tableau, dim, options)
        .map_err(|e| SystemError::argument("settings", format!("settings: {e}")))?;
    formulation.natural_sizes(&mut march.buffer);
    stepper.set_sizes(&march.buffer);
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
            other => Err(SystemError::argument("initial", other.to_string())),
        };
    }
    let ended = march.run(formulation, &mut stepper, settings, sink, watch);
    let t = stepper.t_old();
    let (status, message, error) = match ended {
        Ok(status) => (status, sentence(status, t, settings), None),
        Err(failure) => explain(failure, t),
    };
    Ok(Outcome { status, message, t, counters: *stepper.counters(), passages: formulation.journal().passages, error })
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

/// Is there a position, rather than a function, behind the failure?
fn is_of_a_position(e: &SystemError) -> bool {
    matches!(
        e,
        SystemError::Singular { .. }
            | SystemError::DeadPoint { .. }
            | SystemError::Limit { .. }
            | SystemError::Passage { .. }
    )
}

/// How a march ends that failed at t, in a word and in a sentence, and what failed.
pub fn explain(failure: StepFailure<SystemError>, t: f64) -> (Status, String, Option<SystemError>) {
    let message = failure.to_string();
    match failure {
        StepFailure::TooSmall { last: Some(e), .. } if is_of_a_position(&e) => {
            (Status::Singular, format!("stopped at t = {t:.6} s: {e}"), Some(e))
        }
        StepFailure::TooSmall { last: Some(e @ (SystemError::Jump { .. } | SystemError::Jammed { .. })), .. } => {
            (Status::EvaluationFailed, format!("stopped at t = {t:.6} s: {e}"), Some(e))
        }
        StepFailure::TooSmall { last, .. } => (Status::StepTooSmall, message, last),
        StepFailure::Rhs { error, .. } | StepFailure::Interpolation { error, .. } => {
            let status = match &error {
                SystemError::Contradiction { .. } | SystemError::Misfit { .. } => Status::Contradiction,
                e if is_of_a_position(e) => Status::Singular,
                _ => Status::EvaluationFailed,
            };
            (status, format!("stopped at t = {t:.6} s: {error}"), Some(error))
        }
        StepFailure::NotFinite { .. } => (Status::EvaluationFailed, message, None),
    }
}

struct March<'t> {
    buffer: Vec<f64>,
    slope: Vec<f64>,
    /// What the sink gets; its turns are those of the march.
    output: Output,
    next: usize,
    t_eval: &'t [f64],
    /// See [`Pace::stretch`].
    stretch: f64,
    /// What knots may add to a step, in parts of the velocities.
    tolerance: f64,
}

/// A crossing step that fails is tried again with these multiples of its length: the nodes of a method lie about a tenth of a
/// step apart, so where a stage came close to the position, it lies between two stages then.
const AGAIN: [f64; 3] = [1.25, 1.12, 1.06];

/// Outputs in singular positions are taken from others beside them, this part of the step apart: far enough for those to be
/// exact, and so near that the polynomial through them is.
const BESIDE: f64 = 1.0 / 80.0;

/// Knots that add less than this to a step are round-off.
const FINEST: f64 = 1e-14;

type Sink<'s> = &'s mut dyn FnMut(&Output) -> Result<(), SystemError>;

impl March<'_> {
    fn emit<F: Formulation>(&mut self, formulation: &mut F, t: f64, y: &[f64], sink: Sink) -> Result<(), SystemError> {
        formulation.state_at(t, y, &mut self.output)?;
        sink(&self.output)?;
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
        while !stepper.finished() {
            if stepper.counters().steps >= settings.max_steps {
                return Ok(Status::MaxSteps);
            }
            self.step(formulation, stepper, settings, sink)?;
            if watch(stepper.t_old()).is_break() {
                return Ok(Status::Interrupted);
            }
        }
        Ok(Status::Finished)
    }

    /// One accepted step with its outputs.
    fn step<F: Formulation>(
        &mut self,
        formulation: &mut F,
        stepper: &mut Stepper,
        settings: &Settings,
        sink: Sink,
    ) -> Result<(), StepFailure<SystemError>> {
        loop {
            stepper.attempt(&mut Adapter(formulation))?;
            let mut verdict = Verdict::Keep;
            let concluded = stepper.conclude_with(|t, y, dy, known| {
                let (judged, evaluated) = formulation.trial_end(t, y, dy, known).map_err(sorted)?;
                verdict = judged;
                Ok(evaluated)
            })?;
            if concluded == Conclusion::Rejected {
                continue;
            }
            let free = settings.options.fixed_step.is_none();
            if verdict == Verdict::Repeat {
                stepper.reject(0.5);
                self.commit(formulation, stepper, verdict, free)?;
                continue;
            }
            if let Some(t) = free.then(|| formulation.knot_within(self.tolerance)).flatten() {
                stepper.end_at(t);
                continue;
            }
            match self.outputs(formulation, stepper, sink) {
                Ok(()) => {}
                Err(StepFailure::Interpolation { .. }) if stepper.may_shrink() => {
                    stepper.reject(0.5);
                    continue;
                }
                Err(failure) => return Err(failure),
            }
            stepper.commit();
            return self.commit(formulation, stepper, verdict, free);
        }
    }

    /// Carry out a verdict where the stepper stands: at the end of an accepted step, or back at its start.
    fn commit<F: Formulation>(
        &mut self,
        formulation: &mut F,
        stepper: &mut Stepper,
        verdict: Verdict,
        free: bool,
    ) -> Result<(), StepFailure<SystemError>> {
        let t = stepper.t_old();
        self.buffer.copy_from_slice(stepper.y_old());
        self.slope.copy_from_slice(stepper.dy_old());
        let mut pace = Pace { next: stepper.step_size(), stretch: self.stretch, floor: 0.0, limit: 1.0 };
        let (y, dy, turns) = (&mut self.buffer[..], &mut self.slope[..], &mut self.output.turns[..]);
        let mut step = Step { t, y, dy, turns, pace: free.then_some(&mut pace) };
        let rewritten = formulation.commit(verdict, &mut step);
        let now = step.t;
        if rewritten.map_err(|error| StepFailure::Rhs { t, error })? {
            stepper.replace_start(now, &self.buffer, &self.slope);
            formulation.natural_sizes(&mut self.buffer);
            stepper.set_sizes(&self.buffer);
        }
        if free {
            stepper.set_step_size(pace.next);
            stepper.set_lenience(pace.floor, pace.limit);
            if pace.limit > 1.0 {
                // half a crossing step would end next to the position; others across it have their stages elsewhere
                stepper.set_other_sizes(AGAIN.map(|x| x * pace.next));
            }
            stepper.set_goal(formulation.knot_ahead(pace.next, self.tolerance));
        }
        Ok(())
    }

    /// The output at t inside the step that was concluded; y is room for a state.
    fn output_at<F: Formulation>(
        &mut self,
        formulation: &mut F,
        stepper: &mut Stepper,
        t: f64,
        y: &mut [f64],
    ) -> Result<(), StepFailure<SystemError>> {
        let (from, to) = (stepper.t_old(), stepper.t_new());
        let mut state = |t: f64, out: &mut Output| {
            stepper.interpolate(&mut Adapter(formulation), t, y)?;
            formulation.state_at(t, y, out).map_err(|error| StepFailure::Rhs { t, error })
        };
        let failed = match state(t, &mut self.output) {
            Ok(()) if !self.output.singular => return Ok(()),
            Ok(()) => None,
            Err(StepFailure::Rhs { t, error }) if is_of_a_position(&error) => Some(StepFailure::Rhs { t, error }),
            Err(other) => return Err(other),
        };
        // In a singular position q_D and v_D are quotients of nothing by nothing, while the motion goes through smoothly:
        // the polynomial through three positions on either side has them, to the sixth power of their distance.
        let apart = ((t - from) / 3.0).min((to - t) / 3.0).min((to - from) * BESIDE);
        let (mut side, mut q, mut v, mut work) = (Output::default(), Vec::new(), Vec::new(), 0.0);
        for (i, weight) in [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0].into_iter().zip([1.0, -6.0, 15.0, 15.0, -6.0, 1.0]) {
            if let Err(beside) = state(t + i * apart, &mut side) {
                return Err(failed.unwrap_or(beside));
            }
            q.resize(side.q.len(), 0.0);
            v.resize(side.v.len(), 0.0);
            q.iter_mut().zip(&side.q).for_each(|(to, x)| *to += weight / 20.0 * x);
            v.iter_mut().zip(&side.v).for_each(|(to, x)| *to += weight / 20.0 * x);
            work += weight / 20.0 * side.work;
        }
        self.output.set(t, &q, &v, work);
        (self.output.choice, self.output.singular) = (side.choice, true);
        Ok(())
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
            let done = self.output_at(formulation, stepper, t, &mut y);
            self.buffer = y;
            done?;
            sink(&self.output).map_err(|error| StepFailure::Rhs { t, error })?;
            self.next += 1;
        }
        Ok(())
    }
}
