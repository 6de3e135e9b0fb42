//! Marching: steps, corrections, changes of coordinates.

mod outputs;
mod replay;

use outputs::OUTPUTS_BESIDE;
pub use outputs::{Outputs, Sink};
pub use replay::StepReader;

use crate::counters::Counters;
use crate::crossing_step::CrossingStep;
use crate::discontinuity::{Location, Search};
use crate::failure::StepFailure;
use crate::method::Method;
use crate::ode::{Ode, RhsError};
use crate::options::{AbsoluteTolerance, Options, OptionsError};
use crate::singular_times;
use crate::step_log::StepLog;
use crate::stepper::{Conclusion, StepControl, StepPlan, Stepper};
use partita_math::tolerance;
use partita_system::breakpoints::Passing;
use partita_system::error::CrossingOutcome;
use partita_system::formulation::{Formulation, Pace, PrescribedLevel, Step, StepDecision};
use partita_system::guards::Look;
use partita_system::record::Output;
use partita_system::SystemError;
use std::ops::ControlFlow;

struct Adapter<'f, F: Formulation>(&'f mut F);

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

fn sorted(e: SystemError) -> RhsError<SystemError> {
    if e.is_local() {
        RhsError::Retry(e)
    } else {
        RhsError::Fatal(e)
    }
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// At its end.
    Finished,
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

/// Whether the failure is due to a position rather than a function.
pub(crate) fn is_of_a_position(e: &SystemError) -> bool {
    matches!(
        e,
        SystemError::Singular { .. }
            | SystemError::DeadPoint { .. }
            | SystemError::Limit { .. }
            | SystemError::Crossing { .. }
    )
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
    /// Steps across singular positions, and whether the next one is of them.
    crossing: CrossingStep,
    crosses: bool,
    /// When the step under way is in one, and whether it was searched for them.
    located: Vec<f64>,
    searched: bool,
    /// Length of the next step as the stepper would have it.
    proposed: f64,
    /// Whether the step length is controlled by the error.
    free: bool,
    /// Whether it is bounded by that of a component which is not controlled.
    observes: bool,
    t: f64,
    y: Vec<f64>,
    buffer: Vec<f64>,
    slope: Vec<f64>,
    /// State passed to the sink; its turns are those of the integration.
    output: Output,
    /// Error that breakpoints may add to a step, relative to the velocities.
    tolerance: f64,
    /// Absolute tolerance, in natural sizes.
    absolute: f64,
    /// The steps taken.
    log: StepLog,
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
    pub fn new<F: Formulation>(
        formulation: &F,
        nq: usize,
        method: &'static dyn Method,
        options: Options,
        control: Control,
    ) -> Result<Self, OptionsError> {
        let dim = formulation.dim();
        let (free, tolerance) = (options.fixed_step.is_none(), options.rtol.max(tolerance::SUM_ROUNDING));
        let absolute = match &options.atol {
            AbsoluteTolerance::Same(x) => *x,
            AbsoluteTolerance::Each(x) => x.iter().copied().fold(f64::INFINITY, f64::min),
        };
        let observed = formulation.observed();
        let options = Options { controlled: formulation.controlled(), observed, ..options };
        let crossing = CrossingStep::new(dim, &options);
        let stepper = method.stepper(dim, options)?;
        Ok(Self {
            control,
            stepper,
            crossing,
            crosses: false,
            located: Vec::new(),
            searched: false,
            proposed: 0.0,
            free,
            observes: free && observed.is_some(),
            t: 0.0,
            y: vec![0.0; dim],
            buffer: vec![0.0; dim],
            slope: vec![0.0; dim],
            output: Output { turns: vec![0; nq], ..Output::default() },
            tolerance,
            absolute: absolute.clamp(f64::MIN_POSITIVE, f64::MAX),
            log: StepLog::default(),
        })
    }

    /// Start at (t, q, v), from which `turns` whole turns of each coordinate were removed.
    ///
    /// # Errors
    /// Where the formulation cannot start.
    pub fn begin<F: Formulation>(
        &mut self,
        formulation: &mut F,
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
        self.set_sizes(formulation);
        Ok(())
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
    pub fn advance_to<F: Formulation>(
        &mut self,
        formulation: &mut F,
        t_end: f64,
        outputs: &mut Outputs,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Status, StepFailure<SystemError>> {
        self.set_out(formulation, t_end)?;
        self.go_on(formulation, outputs, watch)
    }

    /// Evaluate the start of the integration to `t_end`: the loads may have changed since the last step.
    pub(crate) fn set_out<F: Formulation>(
        &mut self,
        formulation: &mut F,
        t_end: f64,
    ) -> Result<(), StepFailure<SystemError>> {
        self.stepper.start(&mut Adapter(formulation), self.t, &self.y, t_end)?;
        (self.crosses, self.proposed) = (false, self.stepper.current().next);
        if !self.free {
            return Ok(());
        }
        let t = self.t;
        self.buffer.copy_from_slice(&self.y);
        self.slope.copy_from_slice(self.stepper.current().dy_old);
        let mut pace = Pace { next: self.proposed, across: None };
        let (y, dy, turns) = (&mut self.buffer[..], &mut self.slope[..], &mut self.output.turns[..]);
        formulation
            .set_out(&mut Step { t, y, dy, turns, pace: Some(&mut pace), located: None })
            .map_err(|error| StepFailure::Rhs { t, error })?;
        self.plan(formulation, pace);
        Ok(())
    }

    /// Natural sizes of the state as it is now.
    fn set_sizes<F: Formulation>(&mut self, formulation: &F) {
        formulation.natural_sizes(&mut self.buffer);
        self.stepper.set_sizes(&self.buffer);
        self.crossing.set_sizes(&self.buffer);
    }

    /// The next step from where the stepper stands.
    fn plan<F: Formulation>(&mut self, formulation: &F, pace: Pace) {
        let from = self.stepper.current();
        self.crosses = pace.across.is_some();
        if let Some(across) = pace.across {
            self.crossing.replace_start(from.t_old, from.y_old, from.dy_old);
            // an output next to the position is taken from both sides of it
            let beside = across.whole * OUTPUTS_BESIDE;
            let free = matches!(self.control, Control::Free { .. });
            let beyond = free && (from.t_end - across.zero).abs() < beside;
            let end = if beyond { f64::INFINITY } else { from.t_end };
            self.crossing.aim(across.zero, (across.whole, across.longest), across.tries, end);
        } else {
            let goal = formulation.breakpoint_ahead(pace.next, self.tolerance);
            self.stepper.plan(&StepPlan { length: pace.next, goal });
        }
    }

    /// Attempt the step under way. Where it crosses a singular position, that is located on the polynomial of the step, and
    /// the step taken anew if a node came close to it.
    fn attempt<F: Formulation>(&mut self, formulation: &mut F) -> Result<(), StepFailure<SystemError>> {
        self.searched = false;
        self.located.clear();
        if !self.crosses {
            return self.stepper.attempt(&mut Adapter(formulation));
        }
        let attempted = self.crossing.attempt(&mut Adapter(formulation));
        // one that was not exact enough tells where the position is, too
        if !matches!(attempted, Ok(()) | Err(StepFailure::TooSmall { .. })) || !self.crossing.has_polynomial() {
            return attempted;
        }
        self.locate_crossing(formulation);
        if !self.crossing.aim_again(&self.located) {
            return attempted;
        }
        let again = self.crossing.attempt(&mut Adapter(formulation));
        if again.is_ok() {
            self.locate_crossing(formulation);
        }
        again
    }

    /// Locate the singular positions on the polynomial of the crossing step.
    fn locate_crossing<F: Formulation>(&mut self, formulation: &mut F) {
        let ends = (self.crossing.current().t_old, self.crossing.current().t_new);
        let mut side = |t: f64| {
            self.crossing.polynomial(t, &mut self.buffer);
            formulation.side(t, &self.buffer)
        };
        self.searched = singular_times::find(ends, f64::INFINITY, &mut side, &mut self.located).is_some();
    }

    /// Locate those that an ordinary step passed, on its dense output. True if it was not to pass them, or came near to one
    /// where it was to end farther away.
    fn locate_passed<F: Formulation>(&mut self, formulation: &mut F) -> bool {
        let Some(rate) = formulation.may_have_passed().filter(|_| !self.crosses) else { return false };
        let ends = (self.stepper.current().t_old, self.stepper.current().t_new);
        let mut side = |t: f64| {
            self.stepper.interpolate(&mut Adapter(formulation), t, &mut self.buffer).ok()?;
            formulation.side(t, &self.buffer)
        };
        let found = singular_times::find(ends, rate, &mut side, &mut self.located);
        self.searched = found.is_some();
        let Some(nearest) = found.filter(|_| self.free) else { return false };
        match self.located.is_empty() {
            true => formulation.nears_unforeseen(nearest),
            false => formulation.passed_unforeseen(),
        }
    }

    /// What takes the step under way.
    fn active(&mut self) -> &mut dyn Stepper<SystemError> {
        match self.crosses {
            true => &mut self.crossing,
            false => &mut *self.stepper,
        }
    }

    /// The integration loop.
    pub(crate) fn go_on<F: Formulation>(
        &mut self,
        formulation: &mut F,
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
    fn explained<F: Formulation>(
        &self,
        formulation: &F,
        mut failure: StepFailure<SystemError>,
    ) -> StepFailure<SystemError> {
        let off = self.crossing.least_error();
        let enough = 10f64.powf((off * self.tolerance).log10().ceil());
        if let StepFailure::Rhs { error, .. } | StepFailure::TooSmall { last: Some(error), .. } = &mut failure {
            if let SystemError::Singular { t, .. } = *error {
                if let Some(failed) = formulation.crossing_failed(t) {
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

    fn steps<F: Formulation>(
        &mut self,
        formulation: &mut F,
        outputs: &mut Outputs,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Status, StepFailure<SystemError>> {
        let mut attempts = match self.control {
            Control::Free { .. } => MOST_ATTEMPTS,
            Control::Ticks { steps } => ATTEMPTS * steps,
        };
        while !self.stepper.current().finished() {
            if let Control::Free { max_steps } = self.control {
                if self.counters().steps >= max_steps {
                    return Ok(Status::MaxSteps);
                }
            }
            self.step(formulation, outputs, &mut attempts)?;
            if watch(self.stepper.current().t_old).is_break() {
                return Ok(Status::Interrupted);
            }
        }
        Ok(Status::Finished)
    }

    /// One accepted step with its outputs.
    fn step<F: Formulation>(
        &mut self,
        formulation: &mut F,
        outputs: &mut Outputs,
        attempts: &mut u32,
    ) -> Result<(), StepFailure<SystemError>> {
        if let Control::Free { .. } = self.control {
            *attempts = MOST_ATTEMPTS;
        }
        loop {
            if *attempts == 0 {
                let step = self.stepper.current();
                return Err(StepFailure::TooSmall { t: step.t_old, h: step.next, last: None });
            }
            *attempts -= 1;
            let crosses = self.crosses;
            let mut verdict = StepDecision::Keep;
            let free = self.free;
            let attempted = self.attempt(formulation);
            let beyond = self.ends_beyond();
            let stepper = self.active();
            let concluded = attempted.and_then(|()| {
                stepper.conclude(&mut |t, y, dy, known| {
                    let judged = formulation.trial_end(t, y, dy, known).map_err(|e| match e {
                        // no shorter step is allowed that could distinguish a jump from a drift
                        SystemError::Jump { .. } if !free => RhsError::Fatal(e),
                        e => sorted(e),
                    });
                    let (judged, evaluated) = judged?;
                    verdict = judged;
                    Ok(evaluated)
                })
            });
            match concluded {
                Ok(Conclusion::Done) => {}
                Ok(Conclusion::Rejected) => continue,
                // what acts may not be given beyond the end
                Err(StepFailure::Rhs { .. }) if beyond => {
                    self.crossing.end_by(self.stepper.current().t_end);
                    continue;
                }
                // a step across a singular position has one length; the formulation decides on another
                Err(StepFailure::TooSmall { .. }) if crosses => verdict = StepDecision::Repeat,
                Err(StepFailure::TooSmall { t, h, last: None }) => {
                    return Err(StepFailure::TooSmall { t, h, last: self.obstacle_ahead(formulation) })
                }
                Err(failure) => return Err(failure),
            }
            if verdict == StepDecision::Repeat {
                // however short, a step over a jump of what is prescribed is repeated: the jump is named
                if !stepper.current().may_shrink {
                    match self.shortened(formulation) {
                        Ok(_) | Err(StepFailure::Interpolation { .. }) => {}
                        Err(failure) => return Err(failure),
                    }
                }
                self.active().reject(0.5);
                self.commit(formulation, verdict)?;
                continue;
            }
            let near = || formulation.margin().is_some_and(|m| m.abs() < tolerance::LANDED);
            if matches!(self.control, Control::Ticks { .. }) && near() {
                let t = self.active().current().t_new;
                let message =
                    "the step would end next to a singular position (links in line, where the motion can branch), \
                     where velocities are not determined; step over it with another number of substeps or another \
                     step length";
                return Err(StepFailure::Rhs { t, error: SystemError::Tick { t, message: message.into() } });
            }
            if !self.guards_hold(formulation)? {
                continue;
            }
            if self.free && !self.passes_no_breakpoint(formulation)? {
                continue;
            }
            if self.locate_passed(formulation) {
                self.stepper.reject(0.5);
                self.commit(formulation, StepDecision::Repeat)?;
                continue;
            }
            match self.shortened(formulation) {
                Ok(false) => {}
                Ok(true) => continue,
                Err(StepFailure::Interpolation { .. }) if self.free && self.active().current().may_shrink => {
                    self.active().reject(0.5);
                    continue;
                }
                Err(failure) => return Err(failure),
            }
            match self.outputs(formulation, outputs) {
                Ok(()) => {}
                Err(StepFailure::Interpolation { .. }) if self.active().current().may_shrink => {
                    self.active().reject(0.5);
                    continue;
                }
                Err(failure) => return Err(failure),
            }
            let t_end = self.stepper.current().t_end;
            let beyond = self.crosses && self.crossing.current().t_new > t_end;
            if beyond {
                self.crossing.interpolate(&mut Adapter(formulation), t_end, &mut self.y)?;
            }
            self.log_step(formulation);
            self.active().commit();
            match self.crosses {
                true => {
                    let end = self.crossing.current();
                    self.stepper.replace_start(end.t_old, end.y_old, end.dy_old);
                }
                false => self.proposed = self.stepper.current().next,
            }
            let turns = beyond.then(|| self.output.turns.clone());
            self.commit(formulation, verdict)?;
            if let Some(turns) = turns {
                self.output.turns = turns;
                self.stepper.replace_start(t_end, &self.y, self.crossing.current().dy_old);
            }
            return Ok(());
        }
    }

    /// Where a prescribed row misses the integral of its derivative over the concluded step: refuse a jump, and end the
    /// step where a derivative jumps or changes fast. True if the step was rejected.
    fn shortened<F: Formulation>(&mut self, formulation: &mut F) -> Result<bool, StepFailure<SystemError>> {
        let stepper: &mut dyn Stepper<SystemError> = if self.crosses { &mut self.crossing } else { &mut *self.stepper };
        let step = stepper.current();
        let (from, to, may) = (step.t_old, step.t_new, self.free && step.may_shrink);
        // a rate that jumps leaves a gap of positions as well
        for level in [PrescribedLevel::Rate, PrescribedLevel::Position] {
            let Some(gap) = formulation.prescribed_gap(level, (self.tolerance, self.absolute)) else { continue };
            let search = Search::new(from, to);
            let mut at = |t: f64| {
                stepper.interpolate(&mut Adapter(formulation), t, &mut self.buffer)?;
                formulation.prescribed_at(t, &self.buffer, &gap).map_err(|error| StepFailure::Rhs { t, error })
            };
            let mut location = search.jump(&mut at, gap.by)?;
            if may && gap.shorten && location == Location::Smooth && level == PrescribedLevel::Rate {
                location = search.kink(&mut at, gap.by)?;
            }
            match location {
                Location::Jump { t, by } => {
                    return Err(StepFailure::Rhs { t, error: formulation.prescribed_jump(t, &gap, by) })
                }
                _ if !(may && gap.shorten) => continue,
                Location::Within { before, .. } if before > from => stepper.end_at(before),
                Location::Within { after, .. } if after < to => stepper.end_at(after),
                _ => stepper.reject(0.5),
            }
            return Ok(true);
        }
        Ok(false)
    }

    /// Check the guards along the concluded step. False where it was rejected, to end where it crosses one.
    fn guards_hold<F: Formulation>(&mut self, formulation: &mut F) -> Result<bool, StepFailure<SystemError>> {
        loop {
            match formulation.guard(self.tolerance, self.free) {
                Look::Clear => return Ok(true),
                Look::Crossed { .. } if self.crosses => return self.cross_otherwise(formulation),
                // it ends there as exactly as times can say
                Look::Crossed { t, .. } if self.ends_at(t) => return Ok(true),
                Look::Crossed { t, .. } => {
                    self.active().end_at_corner(t);
                    return Ok(false);
                }
                Look::At(t) if self.sees(formulation, t)? => {}
                Look::At(_) => return Ok(false),
            }
        }
    }

    /// Check the breakpoints along the concluded step. False where it was rejected, to end at one.
    fn passes_no_breakpoint<F: Formulation>(&mut self, formulation: &mut F) -> Result<bool, StepFailure<SystemError>> {
        loop {
            match formulation.breakpoint_within(self.tolerance) {
                Passing::Clear => return Ok(true),
                Passing::Until(_) if self.crosses => return self.cross_otherwise(formulation),
                Passing::Until(t) => {
                    self.active().end_at(t);
                    return Ok(false);
                }
                Passing::At(t) if self.sees(formulation, t)? => {}
                Passing::At(_) => return Ok(false),
            }
        }
    }

    /// Why the motion cannot be evaluated shortly after the last step, where no step leads on: ends of steps, and errors of
    /// those that could be evaluated, have no reason of their own.
    fn obstacle_ahead<F: Formulation>(&mut self, formulation: &mut F) -> Option<SystemError> {
        let step = self.stepper.current();
        // not beyond the end, where what acts may not be given
        let (t, rest) = (step.t_old, step.t_end - step.t_old);
        let h = rest.signum() * rest.abs().min(tolerance::NEGLIGIBLE * (rest.abs() + t.abs()));
        for (x, (y, dy)) in self.buffer.iter_mut().zip(step.y_old.iter().zip(step.dy_old)) {
            *x = y + h * dy;
        }
        match Adapter(formulation).rhs(t + h, &self.buffer, &mut self.slope) {
            Ok(()) => None,
            Err(RhsError::Retry(error) | RhsError::Fatal(error)) => Some(error),
        }
    }

    /// Whether the concluded step ends at t, except for rounding of times.
    fn ends_at(&mut self, t: f64) -> bool {
        (self.active().current().t_new - t).abs() <= tolerance::SUM_ROUNDING * t.abs()
    }

    /// Reject a step across a singular position inside which something acts abruptly; the formulation decides on another.
    fn cross_otherwise<F: Formulation>(&mut self, formulation: &mut F) -> Result<bool, StepFailure<SystemError>> {
        self.crossing.reject(0.5);
        self.commit(formulation, StepDecision::Repeat)?;
        Ok(false)
    }

    /// Evaluate the dense output of the concluded step at t. False where that cannot be, and a shorter step is tried.
    fn sees<F: Formulation>(&mut self, formulation: &mut F, t: f64) -> Result<bool, StepFailure<SystemError>> {
        let stepper: &mut dyn Stepper<SystemError> = if self.crosses { &mut self.crossing } else { &mut *self.stepper };
        let seen = match stepper.interpolate(&mut Adapter(formulation), t, &mut self.buffer) {
            Ok(()) => formulation.look_at(t, &self.buffer).map_err(|error| StepFailure::Rhs { t, error }),
            Err(failure) => Err(failure),
        };
        let shrinks = match &seen {
            Err(StepFailure::Interpolation { .. }) => stepper.current().may_shrink,
            Err(StepFailure::Rhs { error, .. }) => error.is_local() && stepper.current().may_shrink,
            _ => false,
        };
        if shrinks {
            stepper.reject(0.5);
            return Ok(false);
        }
        seen.map(|()| true)
    }

    /// Whether the step under way crosses a singular position and may end after the run, whose end lies beside it.
    fn ends_beyond(&self) -> bool {
        self.crosses && self.crossing.current().t_end > self.stepper.current().t_end
    }

    /// Apply a verdict at the current state: the end of an accepted step, or its start.
    fn commit<F: Formulation>(
        &mut self,
        formulation: &mut F,
        verdict: StepDecision,
    ) -> Result<(), StepFailure<SystemError>> {
        let step = self.stepper.current();
        let t = step.t_old;
        // at the end there is nothing to plan: what lies ahead may be too close to be crossed from there
        let free = self.free && t < step.t_end;
        self.buffer.copy_from_slice(step.y_old);
        self.slope.copy_from_slice(step.dy_old);
        let next = if self.crosses || verdict != StepDecision::Repeat { self.proposed } else { step.next };
        let mut pace = Pace { next, across: None };
        let (y, dy, turns) = (&mut self.buffer[..], &mut self.slope[..], &mut self.output.turns[..]);
        let located = self.searched.then_some(&self.located[..]);
        let mut step = Step { t, y, dy, turns, pace: free.then_some(&mut pace), located };
        let rewritten = formulation.commit(verdict, &mut step);
        let now = step.t;
        if rewritten.map_err(|error| StepFailure::Rhs { t, error })? {
            self.stepper.replace_start(now, &self.buffer, &self.slope);
            self.set_sizes(formulation);
        }
        if self.observes {
            self.stepper.set_reference(formulation.checks().exchanged());
        }
        if free {
            self.plan(formulation, pace);
        }
        Ok(())
    }
}
