//! Marching a mechanism: steps, corrections, changes of coordinates, outputs.

use crate::counters::Counters;
use crate::explicit_rk::{Conclusion, Stepper};
use crate::failure::StepFailure;
use crate::ode::{Ode, RhsError};
use crate::options::Options;
use crate::tableau::Tableau;
use partita_system::formulation::{Formulation, Output, Review};
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
    /// At a singular position of the mechanism, or at a dead point of coordinates that stay.
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
        span: settings.t_end - t,
        passage: Passage::new(settings.tableau),
        distance: None,
    };
    let options = Options { controlled: formulation.controlled(), ..settings.options.clone() };
    let mut stepper =
        Stepper::new(settings.tableau, dim, options).map_err(|e| SystemError::Request(format!("settings: {e}")))?;
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

/// Is there a position, rather than a function, behind the failure?
fn is_of_a_position(e: &SystemError) -> bool {
    matches!(e, SystemError::Singular { .. } | SystemError::DeadPoint { .. } | SystemError::Limit { .. })
}

fn explain(failure: StepFailure<SystemError>, t: f64) -> (Status, String, Option<SystemError>) {
    let message = failure.to_string();
    match failure {
        StepFailure::TooSmall { last: Some(e), .. } if is_of_a_position(&e) => {
            (Status::Singular, format!("stopped at t = {t}: {e}"), Some(e))
        }
        StepFailure::TooSmall { last, .. } => (Status::StepTooSmall, message, last),
        StepFailure::Rhs { error, .. } | StepFailure::Interpolation { error, .. } => {
            let status = if is_of_a_position(&error) { Status::Singular } else { Status::EvaluationFailed };
            (status, format!("stopped at t = {t}: {error}"), Some(error))
        }
        StepFailure::NotFinite { .. } => (Status::EvaluationFailed, message, None),
    }
}

/// Stepping over singular positions of the mechanism.
///
/// Next to one the tangent is a quotient of small numbers: what went wrong before is divided by the distance, so steps that
/// end close to it are followed by ever shorter ones, while one step across it, with no stage near it, is as exact as any
/// other. The distance falls linearly in time, so the passage is foreseen: the march takes care to arrive with room to
/// spare and crosses in one step whose stages keep away from it.
struct Passage {
    /// Length of the crossing step in units of the distance to the singular position.
    stretch: f64,
    /// Distance at the ends of the last two steps, the latest first: time, distance, number of its plan.
    before: [Option<(f64, f64, u64)>; 2],
    /// When the next singular position is expected.
    expected: Option<f64>,
    /// The one that the step under way is to cross.
    crossing: Option<f64>,
    /// The usual step size away from singular positions.
    usual: f64,
    /// Times stepped over.
    times: Vec<f64>,
}

/// Is the singular position `ahead` of (t, y) really there?
type Confirm<'c> = &'c mut dyn FnMut(f64, &[f64], f64) -> bool;

impl Passage {
    /// A crossing step is this part of the usual one, so that its own error is far below the tolerance.
    const PART: f64 = 0.6;
    /// Around a passage the estimate cannot fall below round-off divided by the square of the distance, and shorter steps
    /// make it worse: about 1e-12 for a comfortable crossing, up to 1e-10 in one of a thousand passages of forty loops.
    /// Errors up to this (in natural sizes) are accepted there.
    const ROUND_OFF: f64 = 1e-10;
    /// The crossing step itself may not fail: where the position lay a little off the expected place a stage came close to
    /// it. So many tolerances are accepted; its own error is small by its length.
    const CROSSING: f64 = 1e3;

    fn new(tableau: &Tableau) -> Self {
        // the stretch that keeps all nodes as far as can be from the position passed
        let clearance = |r: f64| tableau.c.iter().fold(r - 1.0, |m: f64, c| m.min((c * r - 1.0).abs()));
        let stretch =
            (130..300).map(|i| f64::from(i) / 100.0).fold(1.3, |b, r| if clearance(r) > clearance(b) { r } else { b });
        Self { stretch, before: [None; 2], expected: None, crossing: None, usual: 0.0, times: Vec::new() }
    }

    /// Look at the distance at the start of the next step and choose its length if a singular position lies ahead; true
    /// while one is being passed.
    fn foresee(&mut self, stepper: &mut Stepper, now: Option<(f64, u64)>, confirm: Confirm) -> bool {
        let Some((distance, plan)) = now else { return false };
        let t = stepper.t_old();
        // a step that had to be shortened may have ended before it
        self.times.extend(self.crossing.take().filter(|zero| *zero < t));
        let [one, two] = self.before;
        self.before = [Some((t, distance, plan)), one];
        let same = |x: Option<(f64, f64, u64)>| x.filter(|x| x.2 == plan && x.0 < t).map(|x| (x.0, x.1));
        if let Some(one) = same(one) {
            self.expected = zero_ahead((t, distance), one, same(two)).filter(|z| z - t < 10.0 * self.usual);
        }
        let Some(zero) = self.expected else {
            // leaving: as long as it is as close behind as a usual step, the estimate is not to be trusted yet
            let leaving = self.times.last().is_some_and(|passed| t - passed < 2.0 * self.usual);
            stepper.set_lenience(if leaving { Self::ROUND_OFF } else { 0.0 }, 1.0);
            if leaving {
                stepper.set_step_size(stepper.step_size().min(self.usual));
            } else {
                let h = stepper.step_size();
                self.usual = h.max(0.9 * self.usual).min(1.3 * h);
            }
            return leaving;
        };
        let ahead = zero - t;
        if ahead <= 0.0 || ahead > 3.0 * self.usual {
            stepper.set_lenience(0.0, 1.0);
            self.expected = self.expected.filter(|_| ahead > 0.0);
            return false;
        }
        stepper.set_lenience(Self::ROUND_OFF, 1.0);
        let crossing = self.stretch * ahead;
        if crossing <= Self::PART * self.usual {
            if !confirm(t, stepper.y_old(), ahead) {
                // what fell was something else; look again from here
                self.before = [None; 2];
                self.expected = None;
                stepper.set_lenience(0.0, 1.0);
                return false;
            }
            stepper.set_lenience(Self::ROUND_OFF, Self::CROSSING);
            stepper.set_step_size(crossing);
            self.crossing = Some(zero);
            self.expected = None;
        } else {
            // leave the distance that one comfortable crossing needs
            let approach = ahead - 0.9 * Self::PART * self.usual / self.stretch;
            stepper.set_step_size(approach.min(stepper.step_size()));
        }
        true
    }
}

/// Where a falling distance will be zero: by the parabola through the last three values, by the line through two.
fn zero_ahead(now: (f64, f64), one: (f64, f64), two: Option<(f64, f64)>) -> Option<f64> {
    let slope = (now.1 - one.1) / (now.0 - one.0);
    if slope >= 0.0 {
        return None;
    }
    let line = -now.1 / slope;
    let Some(two) = two.filter(|x| x.0 < one.0 && x.1 > one.1) else { return Some(now.0 + line) };
    let bend = (slope - (one.1 - two.1) / (one.0 - two.0)) / (now.0 - two.0);
    // now.1 + s x + bend x² = 0 with the slope s of the parabola at the end
    let s = slope + bend * (now.0 - one.0);
    let under_root = s * s - 4.0 * bend * now.1;
    if s >= 0.0 || under_root < 0.0 {
        return Some(now.0 + line);
    }
    Some(now.0 + 2.0 * now.1 / (under_root.sqrt() - s))
}

/// Steps shorter than this part of the time (of the run, near t = 0) are not shortened again: they are some hundred times the
/// round-off of t.
const SHORTEST: f64 = 1e-13;

struct March<'t> {
    buffer: Vec<f64>,
    slope: Vec<f64>,
    /// What the sink gets; its turns are those of the march.
    output: Output,
    next: usize,
    t_eval: &'t [f64],
    /// Length of the run.
    span: f64,
    passage: Passage,
    distance: Option<(f64, u64)>,
}

type Sink<'s> = &'s mut dyn FnMut(&Output) -> Result<(), SystemError>;

impl March<'_> {
    fn emit<F: Formulation>(&mut self, formulation: &mut F, t: f64, y: &[f64], sink: Sink) -> Result<(), SystemError> {
        formulation.state_at(t, y, &mut self.output)?;
        self.output.choice = formulation.events().len().saturating_sub(1);
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
            self.step(formulation, stepper, sink)?;
            if settings.options.fixed_step.is_none() {
                let distance = self.distance;
                let passing = self
                    .passage
                    .foresee(stepper, distance, &mut |t, y, ahead| formulation.confirms_passage(t, y, ahead));
                formulation.close_stages(passing);
            }
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
        sink: Sink,
    ) -> Result<(), StepFailure<SystemError>> {
        let at = |t: f64| move |error: SystemError| StepFailure::Rhs { t, error };
        loop {
            stepper.attempt(&mut Adapter(formulation))?;
            let t = stepper.t_new();
            let may_shrink = stepper.step_size() > SHORTEST * t.abs().max(self.span);
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
            self.distance = formulation.distance();
            if review == Review::Reject {
                stepper.reject(0.5);
                let t = stepper.t_old();
                self.buffer.copy_from_slice(stepper.y_old());
                formulation.recover(t, &mut self.buffer, &mut self.slope).map_err(at(t))?;
                stepper.replace_start(&self.buffer, &self.slope);
                formulation.natural_sizes(&mut self.buffer);
                stepper.set_sizes(&self.buffer);
                continue;
            }
            match self.outputs(formulation, stepper, sink) {
                Ok(()) => {}
                Err(StepFailure::Interpolation { .. }) if may_shrink => {
                    formulation.retreat();
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
                formulation.natural_sizes(&mut self.buffer);
                stepper.set_sizes(&self.buffer);
            }
            self.buffer.copy_from_slice(stepper.y_new());
            if formulation.wrap(&mut self.buffer, &mut self.output.turns) {
                self.slope.copy_from_slice(stepper.dy_new());
                stepper.replace(&self.buffer, &self.slope);
            }
            stepper.commit();
            return Ok(());
        }
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
