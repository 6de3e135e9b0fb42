//! Marching: steps, corrections, changes of coordinates.

mod outputs;
mod replay;

use outputs::OUTPUTS_BESIDE;
pub use outputs::{Outputs, Sink};
pub use replay::StepReader;

use crate::adapter::{Adapter, After};
use crate::counters::Counters;
use crate::crossing_step::CrossingStep;
use crate::failure::StepFailure;
use crate::method::Method;
use crate::ode::{Ode, RhsError};
use crate::options::{AbsoluteTolerance, Options, OptionsError};
use crate::step_log::StepLog;
use crate::stepper::{Conclusion, StepControl, StepPlan, Stepper};
use crate::watch::{find_singular_times, EventWatch, Lengths, Located, Look, Observed, StepView, Track};
use crate::watch::{Watch as _, Watches};
use partita_math::tolerance;
use partita_system::error::CrossingOutcome;
use partita_system::event::{Event, EventFunctions, Occurrence};
use partita_system::formulation::{Course, Depth, Findings, Formulation, Pace, Repeated};
use partita_system::formulation::{Step, StepDecision, TrialEnd};
use partita_system::record::Output;
use partita_system::SystemError;
use std::ops::ControlFlow;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// At its end.
    Finished,
    /// At an event that ends it.
    Event,
    /// It reached its end, but a finding makes the result invalid.
    Invalid,
    /// By the user; the results so far are kept.
    Interrupted,
    /// No acceptable step was found.
    StepTooSmall,
    /// At a singular position of the mechanism, or at a dead point of coordinates that stay.
    Singular,
    /// Where redundant constraints no longer agree.
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
            Self::Event => "event",
            Self::Invalid => "invalid",
            Self::Interrupted => "interrupted",
            Self::StepTooSmall => "step-too-small",
            Self::Singular => "singular",
            Self::Contradiction => "contradiction",
            Self::MaxSteps => "max-steps",
            Self::EvaluationFailed => "evaluation-failed",
        }
    }
}

/// Events to be found.
#[derive(Debug)]
pub struct Observe {
    /// Them.
    pub events: Vec<Event>,
    /// Their functions.
    pub functions: Box<dyn EventFunctions>,
    /// How often they may occur, all together.
    pub most: usize,
}

/// How steps are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Step lengths controlled by the error, or the fixed length requested.
    Free {
        /// Maximum number of accepted steps.
        max_steps: u64,
    },
    /// This many equal steps to each end, unconditionally: for control loops. Inputs may change at these ends, and only
    /// there. None of them may be next to a singular position.
    Ticks {
        /// Steps to each end.
        steps: u32,
    },
}

/// The state of a formulation and its stepper. Memory is taken at the start; steps take
/// none, but where the formulation changes coordinates.
#[derive(Debug)]
pub struct March {
    control: Control,
    stepper: Box<dyn Stepper<SystemError>>,
    /// Steps across singular positions, and how the next one is taken.
    crossing: CrossingStep,
    course: Course,
    /// What no step may pass, and the functions that are followed for it.
    watches: Watches,
    track: Track,
    /// Singular positions in the step under way.
    located: Located,
    /// Length of the next step as the stepper would have it.
    proposed: f64,
    lengths: Lengths,
    /// Whether it is bounded by that of a component which is not controlled.
    observes: bool,
    t: f64,
    y: Vec<f64>,
    buffer: Vec<f64>,
    slope: Vec<f64>,
    /// State passed to the sink; its turns are those of the integration.
    output: Output,
    /// Error that what acts abruptly may add to a step, relative to the velocities, and absolute, in natural sizes.
    tolerance: (f64, f64),
    /// Why the last point that could not be evaluated could not.
    reason: Option<String>,
    /// The steps taken.
    log: StepLog,
}

/// What becomes of the step that was looked at.
enum Fate {
    /// It is taken.
    Stands,
    /// It is attempted again.
    Again,
}

/// Attempts for each step of a tick: a choice of coordinates that has become poor is renewed and the step repeated.
const ATTEMPTS: u32 = 4;
/// Attempts at one step whose length is free. Reason: halving alone takes some fifty from any length to rounding, and each
/// guard or breakpoint one; more of them get nowhere.
const MOST_ATTEMPTS: u32 = 1000;

/// Largest relative tolerance that is advised. Scale: relative. Reason: two digits are the least that a run is worth.
const LOOSEST: f64 = 1e-2;

impl March {
    /// For a formulation with nq coordinates, by a method with these options; their `controlled` is the formulation's.
    ///
    /// # Errors
    /// Options out of range.
    pub fn new(
        formulation: &mut dyn Formulation,
        nq: usize,
        method: &'static dyn Method,
        options: Options,
        control: Control,
    ) -> Result<Self, OptionsError> {
        let layout = formulation.layout();
        let (dim, controlled, observed) = (layout.dim(), layout.controlled, layout.observed);
        let lengths = if options.fixed_step.is_none() { Lengths::Controlled } else { Lengths::Fixed };
        let absolute = match &options.atol {
            AbsoluteTolerance::Same(x) => *x,
            AbsoluteTolerance::Each(x) => x.iter().copied().fold(f64::INFINITY, f64::min),
        };
        let tolerance = (options.rtol.max(tolerance::SUM_ROUNDING), absolute.clamp(f64::MIN_POSITIVE, f64::MAX));
        let options = Options { controlled, observed, ..options };
        let crossing = CrossingStep::new(dim, &options);
        let stepper = method.stepper(dim, options)?;
        let (watches, track) = Watches::new(formulation);
        Ok(Self {
            control,
            stepper,
            crossing,
            course: Course::Along,
            watches,
            track,
            located: Located::default(),
            proposed: 0.0,
            observes: lengths == Lengths::Controlled && observed.is_some(),
            lengths,
            t: 0.0,
            y: vec![0.0; dim],
            buffer: vec![0.0; dim],
            slope: vec![0.0; dim],
            output: Output { turns: vec![0; nq], ..Output::default() },
            tolerance,
            reason: None,
            log: StepLog::default(),
        })
    }

    /// Start at (t, q, v), from which `turns` whole turns of each coordinate were removed.
    ///
    /// # Errors
    /// Where the formulation cannot start.
    pub fn begin(
        &mut self,
        formulation: &mut dyn Formulation,
        t: f64,
        (q, v): (&[f64], &[f64]),
        turns: Option<&[i32]>,
    ) -> Result<(), SystemError> {
        self.t = t;
        match turns {
            Some(turns) => self.output.turns.copy_from_slice(turns),
            None => self.output.turns.fill(0),
        }
        formulation.start(t, q, v, &mut self.y)?;
        self.track.forget();
        self.watches.prescribed.start(formulation, t, &self.y)?;
        self.set_sizes(formulation);
        Ok(())
    }

    /// Find these events from the current state on.
    pub fn observe(&mut self, Observe { events, functions, most }: Observe) {
        self.track.observe(Observed::new(functions, events.len()));
        self.watches.events = Some(EventWatch::new(events, most));
    }

    /// The events that have occurred since the last call, in the order of time.
    pub fn take_occurrences(&mut self) -> Vec<Occurrence> {
        self.watches.events.as_mut().map(EventWatch::take_occurrences).unwrap_or_default()
    }

    /// Events since then did not occur: the motion is set back.
    pub fn forget_occurrences(&mut self) {
        if let Some(events) = &mut self.watches.events {
            events.forget_occurrences();
        }
    }

    /// The event that ended the integration.
    pub(crate) fn ending(&self) -> Option<&str> {
        self.watches.events.as_ref().and_then(EventWatch::ending)
    }

    /// The state at the event that ended the integration.
    fn ended_by_event(&self) -> Option<&Output> {
        let events = self.watches.events.as_ref()?;
        events.ending().and_then(|_| events.last()).map(|x| &x.state)
    }

    /// The elements of the mechanism that were passed through, in sentences.
    pub fn notes(&self) -> impl Iterator<Item = String> + '_ {
        let events = self.watches.events.iter().flat_map(EventWatch::notes);
        self.stepper.notes().into_iter().chain(self.watches.guards.notes()).chain(events)
    }

    /// Time reached.
    pub fn time(&self) -> f64 {
        self.t
    }

    /// State of the formulation there.
    pub fn state(&self) -> &[f64] {
        &self.y
    }

    /// Whole turns taken off each coordinate.
    pub fn turns(&self) -> &[i32] {
        &self.output.turns
    }

    /// Work of the steps since the march was made.
    pub fn counters(&self) -> Counters {
        *self.stepper.counters() + *self.crossing.counters()
    }

    /// Integrate from the current state to `t_end`, with the outputs up to there; `watch` is called after each step.
    ///
    /// # Errors
    /// The cause of an early end. The integration must [`begin`](Self::begin) again then, at its state or elsewhere.
    pub fn advance_to(
        &mut self,
        formulation: &mut dyn Formulation,
        t_end: f64,
        outputs: &mut Outputs,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Status, StepFailure<SystemError>> {
        self.set_out(formulation, t_end)?;
        self.go_on(formulation, outputs, watch)
    }

    /// Evaluate the start of the integration to `t_end`: the loads may have changed since the last step.
    pub(crate) fn set_out(
        &mut self,
        formulation: &mut dyn Formulation,
        t_end: f64,
    ) -> Result<(), StepFailure<SystemError>> {
        let (track, turns) = (&mut self.track, &self.output.turns);
        if track.observed.is_some() {
            track.forget(); // what acts may have changed, and with it the rates of velocities
        }
        if track.waits() {
            let mut first = |t: f64, formulation: &mut dyn Formulation| {
                if track.waits() {
                    track.end_at(t, formulation, turns);
                }
                Depth::Rates
            };
            let after: Option<After> = Some(&mut first);
            let mut ode = Adapter { depth: Depth::Levels, after, ..Adapter::new(formulation) };
            self.stepper.start(&mut ode, self.t, &self.y, t_end)?;
            self.watches.accept_start(&self.track);
        } else {
            self.stepper.start(&mut Adapter::new(formulation), self.t, &self.y, t_end)?;
        }
        (self.course, self.proposed, self.reason) = (Course::Along, self.stepper.current().next, None);
        match self.lengths {
            Lengths::Controlled => self.commit(formulation, StepDecision::Begin, Findings::default()),
            Lengths::Fixed => {
                self.aim();
                Ok(())
            }
        }
    }

    /// Natural sizes of the state as it is now.
    fn set_sizes(&mut self, formulation: &dyn Formulation) {
        let sizes = &formulation.layout().sizes;
        self.stepper.set_sizes(sizes);
        self.crossing.set_sizes(sizes);
    }

    /// A method that remembers earlier steps forgets them where a fixed step ends at a known time.
    fn aim(&mut self) {
        let now = self.stepper.current();
        if let Some(goal) = self.watches.times.ahead(now.t_old, now.t_end) {
            let length = now.next;
            self.stepper.plan(&StepPlan { length, goal: Some(goal) });
        }
    }

    /// The next step from where the stepper stands.
    fn plan(&mut self, pace: Pace) {
        let from = self.stepper.current();
        let Some(across) = pace.across else {
            self.course = Course::Along;
            let to = (from.t_old, from.t_end);
            let goal = self.watches.ahead(&self.track, to, pace.next, self.tolerance.0);
            return self.stepper.plan(&StepPlan { length: pace.next, goal });
        };
        self.course = Course::Across;
        self.crossing.replace_start(from.t_old, from.y_old, from.dy_old);
        // an output next to the position is taken from both sides of it
        let beside = across.whole * OUTPUTS_BESIDE;
        let free = matches!(self.control, Control::Free { .. });
        let beyond = free && (from.t_end - across.zero).abs() < beside;
        let end = if beyond { f64::INFINITY } else { from.t_end };
        self.crossing.aim(across.zero, (across.whole, across.longest), across.tries, end);
    }

    /// Attempt the step under way. Where it crosses a singular position, that is located on the polynomial of the step, and
    /// the step taken anew if a node came close to it.
    fn attempt(&mut self, formulation: &mut dyn Formulation) -> Result<(), StepFailure<SystemError>> {
        self.located.forget();
        if self.course == Course::Along {
            let reason = Some(&mut self.reason);
            return self.stepper.attempt(&mut Adapter { reason, ..Adapter::new(formulation) });
        }
        let attempted = self.crossing.attempt(&mut Adapter::new(formulation));
        // one that was not exact enough tells where the position is, too
        if !matches!(attempted, Ok(()) | Err(StepFailure::TooSmall { .. })) || !self.crossing.has_polynomial() {
            return attempted;
        }
        self.locate_crossing(formulation);
        if !self.crossing.aim_again(&self.located.times) {
            return attempted;
        }
        let again = self.crossing.attempt(&mut Adapter::new(formulation));
        if again.is_ok() {
            self.locate_crossing(formulation);
        }
        again
    }

    /// Locate the singular positions on the polynomial of the crossing step.
    fn locate_crossing(&mut self, formulation: &mut dyn Formulation) {
        let ends = (self.crossing.current().t_old, self.crossing.current().t_new);
        let mut side = |t: f64| {
            self.crossing.polynomial(t, &mut self.buffer);
            formulation.point().side(t, &self.buffer)
        };
        let found = find_singular_times(ends, f64::INFINITY, &mut side, &mut self.located.times);
        self.located.note(found);
    }

    /// What takes the step under way.
    fn active(&mut self) -> &mut dyn Stepper<SystemError> {
        match self.course {
            Course::Across => &mut self.crossing,
            Course::Along => &mut *self.stepper,
        }
    }

    /// The integration loop.
    pub(crate) fn go_on(
        &mut self,
        formulation: &mut dyn Formulation,
        outputs: &mut Outputs,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Status, StepFailure<SystemError>> {
        let ended = self.steps(formulation, outputs, watch).map_err(|failure| self.explained(formulation, failure));
        let reached = self.stepper.current();
        self.t = reached.t_old;
        self.y.copy_from_slice(reached.y_old);
        ended
    }

    /// Where no step led across a singular position: that this is the cause, and the accuracy that rounding left to the
    /// best of them.
    fn explained(
        &self,
        formulation: &mut dyn Formulation,
        mut failure: StepFailure<SystemError>,
    ) -> StepFailure<SystemError> {
        let off = self.crossing.least_error();
        let enough = 10f64.powf((off * self.tolerance.0).log10().ceil());
        if let StepFailure::Rhs { error, .. } | StepFailure::TooSmall { last: Some(error), .. } = &mut failure {
            if let SystemError::Singular { t, .. } = *error {
                if let Some(failed) = formulation.point().obstacle(t) {
                    *error = failed;
                }
            }
            if let SystemError::Crossing { outcome: outcome @ CrossingOutcome::Unsolved, .. } = error {
                if off > 1.0 && enough < LOOSEST {
                    *outcome = CrossingOutcome::Inaccurate { off, enough };
                }
            }
        }
        failure
    }

    fn steps(
        &mut self,
        formulation: &mut dyn Formulation,
        outputs: &mut Outputs,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Status, StepFailure<SystemError>> {
        let mut attempts = match self.control {
            Control::Free { .. } => MOST_ATTEMPTS,
            Control::Ticks { steps } => ATTEMPTS * steps,
        };
        let mut finished = self.stepper.current().finished();
        while !finished {
            if let Control::Free { max_steps } = self.control {
                if self.stepper.counters().steps + self.crossing.counters().steps >= max_steps {
                    return Ok(Status::MaxSteps);
                }
            }
            self.step(formulation, outputs, &mut attempts)?;
            if let Some(last) = self.ended_by_event() {
                outputs.end_with(last).map_err(|error| StepFailure::Rhs { t: last.t, error })?;
                return Ok(Status::Event);
            }
            let now = self.stepper.current();
            finished = now.finished();
            if watch(now.t_old).is_break() {
                return Ok(Status::Interrupted);
            }
        }
        Ok(Status::Finished)
    }

    /// One accepted step with its outputs.
    fn step(
        &mut self,
        formulation: &mut dyn Formulation,
        outputs: &mut Outputs,
        attempts: &mut u32,
    ) -> Result<(), StepFailure<SystemError>> {
        if let Control::Free { .. } = self.control {
            *attempts = MOST_ATTEMPTS;
        }
        let mut last = None;
        loop {
            if *attempts == 0 {
                let (t, h) = (self.stepper.current().t_old, self.stepper.current().next);
                let why = || {
                    let reason = self.reason.take()?;
                    Some(SystemError::argument("dt", format!("the step at t = {t} cannot be taken: {reason}")))
                };
                let last = last.or_else(why);
                return Err(StepFailure::TooSmall { t, h, last });
            }
            *attempts -= 1;
            let Some(end) = self.concluded(formulation, &mut last)? else { continue };
            if end.decision == StepDecision::Repeat {
                self.repeat(formulation, None)?;
                continue;
            }
            self.refuse_tick_at_singular_position(&end)?;
            let mut hidden = None;
            let looked = self.look(formulation, &end, &mut hidden);
            if let Fate::Again = self.carry_out(formulation, looked, &mut last)? {
                continue;
            }
            match self.outputs(formulation, outputs).and_then(|()| self.occurrences(formulation)) {
                Ok(()) => return self.take(formulation, &end, hidden),
                Err(StepFailure::Interpolation { .. }) if self.active().current().may_shrink => {
                    self.active().reject(0.5);
                }
                Err(failure) => return Err(failure),
            }
        }
    }

    /// Attempt and conclude the step under way; none where another attempt follows, with the `last` reason.
    fn concluded(
        &mut self,
        formulation: &mut dyn Formulation,
        last: &mut Option<SystemError>,
    ) -> Result<Option<TrialEnd>, StepFailure<SystemError>> {
        let (course, lengths) = (self.course, self.lengths);
        let (mut end, mut refused) = (TrialEnd::undecided(StepDecision::Keep), None);
        let attempted = self.attempt(formulation);
        let beyond = self.ends_beyond();
        let stepper = self.active();
        let mut concluded = attempted.and_then(|()| {
            stepper.conclude(&mut |t, y, dy, known| {
                end = formulation.trial_end(t, y, dy, known).map_err(|e| match e {
                    // no shorter step is allowed that could distinguish a jump from a drift
                    SystemError::Jump { .. } if lengths == Lengths::Fixed => RhsError::Fatal(e),
                    e if e.is_local() => {
                        refused = Some(e);
                        RhsError::Retry(SystemError::NotFinite { what: "the end of a step".into(), t })
                    }
                    e => RhsError::Fatal(e),
                })?;
                Ok(end.evaluated)
            })
        });
        if refused.is_some() {
            match &mut concluded {
                Err(StepFailure::TooSmall { last: why, .. }) => *why = refused,
                _ => *last = refused,
            }
        }
        match concluded {
            Ok(Conclusion::Rejected) => return Ok(None),
            Ok(Conclusion::Done) => {}
            // what acts may not be given beyond the end
            Err(StepFailure::Rhs { .. }) if beyond => {
                self.crossing.end_by(self.stepper.current().t_end);
                return Ok(None);
            }
            // a step across a singular position has one length; the formulation decides on another
            Err(StepFailure::TooSmall { .. }) if course == Course::Across => {
                return Ok(Some(TrialEnd::undecided(StepDecision::Repeat)));
            }
            Err(StepFailure::TooSmall { t, h, last: None }) => {
                return Err(StepFailure::TooSmall { t, h, last: self.obstacle_ahead(formulation) })
            }
            Err(failure) => return Err(failure),
        }
        let t = end.t;
        self.watches.prescribed.read_end(formulation).map_err(|error| StepFailure::Rhs { t, error })?;
        if !self.track.is_empty() {
            self.track.end_at(t, formulation, &self.output.turns);
        }
        // however short, a step over a jump of what is prescribed is repeated: the jump is named
        if end.decision == StepDecision::Repeat && !self.active().current().may_shrink {
            let mut hidden = None;
            let (watches, mut view) = self.view(formulation, &end, &mut hidden);
            match watches.prescribed.look(&mut view) {
                Ok(Look::Refuse(t, error)) => return Err(StepFailure::Rhs { t, error }),
                Ok(_) | Err(StepFailure::Interpolation { .. }) => {}
                Err(failure) => return Err(failure),
            }
        }
        Ok(Some(end))
    }

    /// The concluded step, for the watches.
    fn view<'m>(
        &'m mut self,
        formulation: &'m mut dyn Formulation,
        end: &'m TrialEnd,
        hidden: &'m mut Option<(f64, usize)>,
    ) -> (&'m mut Watches, StepView<'m>) {
        let stepper: &mut dyn Stepper<SystemError> = match self.course {
            Course::Across => &mut self.crossing,
            Course::Along => &mut *self.stepper,
        };
        let view = StepView {
            formulation,
            stepper,
            track: &mut self.track,
            located: &mut self.located,
            hidden,
            state: &mut self.buffer,
            end,
            course: self.course,
            lengths: self.lengths,
            tolerance: self.tolerance,
            turns: &self.output.turns,
        };
        (&mut self.watches, view)
    }

    /// What the watches make of the concluded step.
    fn look(
        &mut self,
        formulation: &mut dyn Formulation,
        end: &TrialEnd,
        hidden: &mut Option<(f64, usize)>,
    ) -> Result<Look, StepFailure<SystemError>> {
        let (watches, mut view) = self.view(formulation, end, hidden);
        watches.look(&mut view)
    }

    /// Carry out what the watches decided.
    fn carry_out(
        &mut self,
        formulation: &mut dyn Formulation,
        looked: Result<Look, StepFailure<SystemError>>,
        last: &mut Option<SystemError>,
    ) -> Result<Fate, StepFailure<SystemError>> {
        match looked {
            Ok(Look::Clear) => return Ok(Fate::Stands),
            Ok(Look::Refuse(t, error)) => return Err(StepFailure::Rhs { t, error }),
            // a step across a singular position has too few nodes to see what happens between them
            Ok(Look::EndAt { t, .. }) if self.course == Course::Across => {
                self.repeat(formulation, Some(Repeated::Abrupt(t)))?;
            }
            Ok(Look::EndAt { t, corner: true }) => self.active().end_at_corner(t),
            Ok(Look::EndAt { t, corner: false }) => self.active().end_at(t),
            Ok(Look::Repeat(None)) => self.active().reject(0.5),
            Ok(Look::Repeat(why)) => self.repeat(formulation, why)?,
            Err(StepFailure::Interpolation { error, .. }) if self.active().current().may_shrink => {
                *last = Some(error);
                self.active().reject(0.5);
            }
            Err(StepFailure::Rhs { error, .. }) if self.active().current().may_shrink && error.is_local() => {
                *last = Some(error);
                self.active().reject(0.5);
            }
            Err(failure) => return Err(failure),
        }
        Ok(Fate::Again)
    }

    /// Reject the step: the formulation plans another.
    fn repeat(
        &mut self,
        formulation: &mut dyn Formulation,
        why: Option<Repeated>,
    ) -> Result<(), StepFailure<SystemError>> {
        self.active().reject(0.5);
        self.commit(formulation, StepDecision::Repeat, Findings { repeated: why, ..Findings::default() })
    }

    /// A tick that would end next to a singular position is refused.
    fn refuse_tick_at_singular_position(&mut self, end: &TrialEnd) -> Result<(), StepFailure<SystemError>> {
        let near = end.margin.is_some_and(|m| m.abs() < tolerance::LANDED);
        if !near || !matches!(self.control, Control::Ticks { .. }) {
            return Ok(());
        }
        let t = self.active().current().t_new;
        let message = "the step would end next to a singular position (links in line, where the motion can branch), \
                       where velocities are not determined; step over it with another number of substeps or another \
                       step length";
        Err(StepFailure::Rhs { t, error: SystemError::Tick { t, message: message.into() } })
    }

    /// The step stands: go on from its end.
    fn take(
        &mut self,
        formulation: &mut dyn Formulation,
        end: &TrialEnd,
        hidden: Option<(f64, usize)>,
    ) -> Result<(), StepFailure<SystemError>> {
        if self.lengths == Lengths::Fixed && !end.crosses {
            self.located.forget(); // a touch that no step was made for
        }
        let across = self.course == Course::Across;
        let t_end = if across { self.stepper.current().t_end } else { f64::INFINITY };
        let beyond = across && self.crossing.current().t_new > t_end;
        if beyond {
            self.crossing.interpolate(&mut Adapter::new(formulation), t_end, &mut self.y)?;
        }
        self.watches.accept(&mut self.track);
        self.log_step(formulation);
        self.active().commit();
        if across {
            let end = self.crossing.current();
            self.stepper.replace_start(end.t_old, end.y_old, end.dy_old);
        } else {
            self.proposed = self.stepper.current().next;
        }
        let turns = beyond.then(|| self.output.turns.clone());
        self.commit(formulation, end.decision, Findings { hidden, ..Findings::default() })?;
        if let Some(turns) = turns {
            self.output.turns = turns;
            self.stepper.replace_start(t_end, &self.y, self.crossing.current().dy_old);
        }
        Ok(())
    }

    /// Why the motion cannot be evaluated shortly after the last step, where no step leads on: ends of steps, and errors of
    /// those that could be evaluated, have no reason of their own.
    fn obstacle_ahead(&mut self, formulation: &mut dyn Formulation) -> Option<SystemError> {
        let step = self.stepper.current();
        // not beyond the end, where what acts may not be given
        let (t, rest) = (step.t_old, step.t_end - step.t_old);
        let h = rest.signum() * rest.abs().min(tolerance::NEGLIGIBLE * (rest.abs() + t.abs()));
        for (x, (y, dy)) in self.buffer.iter_mut().zip(step.y_old.iter().zip(step.dy_old)) {
            *x = y + h * dy;
        }
        match Adapter::new(formulation).rhs(t + h, &self.buffer, &mut self.slope) {
            Ok(()) => None,
            Err(RhsError::Retry(error) | RhsError::Fatal(error)) => Some(error),
        }
    }

    /// Whether the step under way crosses a singular position and may end after the run, whose end lies beside it.
    fn ends_beyond(&self) -> bool {
        self.course == Course::Across && self.crossing.current().t_end > self.stepper.current().t_end
    }

    /// Carry out a decision at the current state: the end of an accepted step, its start, or that of the integration.
    fn commit(
        &mut self,
        formulation: &mut dyn Formulation,
        decision: StepDecision,
        findings: Findings,
    ) -> Result<(), StepFailure<SystemError>> {
        let step = self.stepper.current();
        let t = step.t_old;
        // at the end there is nothing to plan: what lies ahead may be too close to be crossed from there
        let plans = self.lengths == Lengths::Controlled && t < step.t_end;
        self.buffer.copy_from_slice(step.y_old);
        self.slope.copy_from_slice(step.dy_old);
        let repeats = decision == StepDecision::Repeat;
        let next = if self.course == Course::Across || !repeats { self.proposed } else { step.next };
        let mut pace = Pace { next, across: None };
        let located = self.located.known();
        let longest = if repeats { None } else { self.watches.guards.entered(&self.track) };
        let mut step = Step {
            t,
            y: &mut self.buffer,
            dy: &mut self.slope,
            turns: &mut self.output.turns,
            pace: plans.then_some(&mut pace),
            findings: Findings { located, longest, ..findings },
        };
        let rewritten = formulation.commit(decision, &mut step);
        let now = step.t;
        if rewritten.map_err(|error| StepFailure::Rhs { t, error })? {
            self.stepper.replace_start(now, &self.buffer, &self.slope);
            self.set_sizes(formulation);
        }
        if now != t && !self.track.is_empty() {
            // set back to an earlier state
            self.track.end_at(now, formulation, &self.output.turns);
            self.watches.accept(&mut self.track);
        }
        if self.observes {
            self.stepper.set_reference(formulation.point().checks().1.exchanged());
        }
        match self.lengths {
            Lengths::Controlled if plans => self.plan(pace),
            Lengths::Controlled => {}
            Lengths::Fixed => self.aim(),
        }
        Ok(())
    }
}
