//! A mechanism whose events act, tick by tick: a tick ends at its own time, whatever happens within it.
//!
//! Between events each mode is stepped as any mechanism is. A tick in which something acts is taken back and made of
//! segments.

use super::maker::Maker;
use super::mode::Mode;
use super::{Happening, Plan, RunState, Segment, Segments};
use crate::error::AnalysisError;
use crate::run::{Request, Run, SolutionLog, Stepping};
use partita_integrate::simulate::{Observe, Outcome, Status};
use partita_integrate::tableau::{self, ErrorWeights};
use partita_model::Model;
use partita_system::event::EventFunctions;
use partita_system::record::Output;
use partita_system::SystemError;
use std::mem;
use std::ops::ControlFlow;
use std::sync::Arc;

/// In place of a method with fixed steps alone.
const ADAPTING: &str = "dop853";
/// The relative tolerance of the steps of a tick in which something acts. Scale: as that of a run. Reason: a hundred times
/// below that of a run, as the ticks of a stepper are short and few of them are made of segments.
const TICK_RTOL: f64 = 1e-10;
/// The absolute tolerance of these steps. Scale: as that of a run. Reason: a hundred times below the relative one, as in a
/// run.
const TICK_ATOL: f64 = 1e-12;

/// Makes the functions of the events, from the start of a motion on.
pub type MakeFunctions = Box<dyn Fn() -> Result<Box<dyn EventFunctions>, AnalysisError> + Send + Sync>;

/// Ticks of one mode, or segments of one tick, with their work before.
struct Stint {
    mode: Mode,
    run: Run,
}

/// A motion between two ticks.
pub struct Ticks {
    plan: Arc<Plan>,
    functions: MakeFunctions,
    request: Request,
    /// Length of a tick, and steps in it.
    length: f64,
    steps: u32,
    keeps: bool,
    /// Whether its method can adapt its steps.
    adapts: bool,
    /// When the first tick began, and ticks since.
    origin: f64,
    count: u64,
    /// Where the motion in this mode began.
    state: RunState,
    stepping: Stepping<'static>,
    /// Ticks and segments before, and what happened in them, where these are recorded.
    stints: Vec<Stint>,
    happened: Vec<Happening>,
    /// What happened in the last tick.
    occurred: Vec<Happening>,
}

/// What steps the mode in which a motion stands.
fn stepping(
    state: &mut RunState,
    request: &Request,
    (length, steps): (f64, u32),
    keeps: bool,
    (origin, count): (f64, u64),
) -> Result<Stepping<'static>, AnalysisError> {
    let whole = state.maker.whole(&state.mode.whole)?;
    let (model, _) = state.maker.model(&state.mode)?;
    let now = &state.now;
    let start = (now.t, &now.q[..], &now.v[..]);
    let mut stepping = Stepping::new(model.clone().into(), request, (length, steps), start, keeps)?;
    stepping.count_from(origin, count);
    let Observe { mut events, functions, most } = state.maker.observe(&state.mode, &whole, &model);
    // a tick goes on to its end
    events.iter_mut().for_each(|event| event.last = None);
    stepping.observe_once(Observe { events, functions, most });
    Ok(stepping)
}

impl Ticks {
    /// From a closed state; `keeps` states whether every tick is recorded for a result.
    ///
    /// # Errors
    /// The request is invalid, or the stepper cannot start there.
    pub fn new(
        plan: Plan,
        functions: MakeFunctions,
        request: &Request,
        (length, steps): (f64, u32),
        (t, q, v): (f64, &[f64], &[f64]),
        keeps: bool,
    ) -> Result<Self, AnalysisError> {
        let plan = Arc::new(plan);
        let step = Some(length / f64::from(steps));
        let request = Request { t0: t, t_end: t + length, step, step_bytes: 0, ..request.clone() };
        let mut state = RunState::new(plan.clone(), functions()?, &request, (q, v))?;
        let stepping = stepping(&mut state, &request, (length, steps), keeps, (t, 0))?;
        let (stints, occurred) = (Vec::new(), Vec::new());
        let happened = mem::take(&mut state.maker.happenings);
        let (origin, count) = (t, 0);
        let adapts = !tableau::by_name(&request.method).is_some_and(|x| matches!(x.error, ErrorWeights::None));
        Ok(Self {
            plan,
            functions,
            request,
            length,
            steps,
            keeps,
            adapts,
            origin,
            count,
            state,
            stepping,
            stints,
            happened,
            occurred,
        })
    }

    /// Restart at a closed state, without history: as a stepper made there.
    ///
    /// # Errors
    /// Where the motion cannot start; then the state is unchanged, and `undo` has restored the inputs.
    pub fn begin(&mut self, t: f64, q: &[f64], v: &[f64], undo: &mut dyn FnMut()) -> Result<(), AnalysisError> {
        let request = Request { t0: t, t_end: t + self.length, ..self.request.clone() };
        let ticks = (self.length, self.steps);
        let begun = (self.functions)().and_then(|functions| {
            let mut state = RunState::new(self.plan.clone(), functions, &request, (q, v))?;
            let stepping = stepping(&mut state, &request, ticks, self.keeps, (t, 0))?;
            Ok((state, stepping))
        });
        let (mut state, stepping) = begun.inspect_err(|_| undo())?;
        self.happened = mem::take(&mut state.maker.happenings);
        (self.state, self.stepping) = (state, stepping);
        (self.origin, self.count) = (t, 0);
        self.stints.clear();
        self.occurred.clear();
        Ok(())
    }

    /// One tick.
    ///
    /// # Errors
    /// Where something could not be evaluated or crossed; then the state is unchanged.
    pub fn step(&mut self) -> Result<(), AnalysisError> {
        let before = super::whole(self.stepping.now(), self.stepping.now().v.clone());
        let work = self.stepping.now().work;
        if let Err(error) = self.stepping.step() {
            // as beyond a stop, or where a step of this length does not see whether something happened
            return self.in_segments(before, work).map_err(|_| error);
        }
        let actions = &self.plan.actions;
        let acts = |event: usize| actions.get(event).is_none_or(|actions| !actions.is_empty());
        if self.stepping.occurred().iter().any(|x| acts(x.event)) {
            self.stepping.withdraw();
            return self.in_segments(before, work);
        }
        self.count += 1;
        let maker = &mut self.state.maker;
        maker.note(self.stepping.occurred());
        self.occurred.clear();
        self.occurred.append(&mut maker.happenings);
        self.record();
        Ok(())
    }

    /// A tick in which something acts, from this state on, where this work has been done in the mode.
    fn in_segments(&mut self, before: Output, work: f64) -> Result<(), AnalysisError> {
        let t = self.origin + (self.count + 1) as f64 * self.length;
        // steps that may be shorter
        let method = if self.adapts { self.request.method.clone() } else { ADAPTING.into() };
        let (step, max_step) = (None, self.request.step);
        let request = Request {
            t0: before.t,
            t_end: t,
            method,
            step,
            max_step,
            rtol: TICK_RTOL,
            atol: TICK_ATOL,
            ..self.request.clone()
        };
        let state = &mut self.state;
        let saved = (state.mode.clone(), state.now.clone(), state.work, state.exchanged);
        let counts = state.maker.count.clone();
        state.now = before.clone();
        state.work += work;
        state.at_once = 0;
        let done = state.go_on(&request, &[t], &mut |_| ControlFlow::Continue(())).and_then(|all| {
            let outcome = all.last().map(|x| &x.1.run.outcome);
            match outcome.filter(|x| !matches!(x.status, Status::Finished | Status::Event)) {
                None => Ok(all),
                Some(outcome) => {
                    let message = format!("{}; change the inputs, or take shorter steps", outcome.message);
                    Err(SystemError::Tick { t: before.t, message }.into())
                }
            }
        });
        let ticks = (self.length, self.steps);
        let next = done.and_then(|all| {
            let next = stepping(&mut self.state, &self.request, ticks, self.keeps, (self.origin, self.count + 1))?;
            Ok((all, next))
        });
        let (all, next) = match next {
            Ok(found) => found,
            Err(error) => {
                let state = &mut self.state;
                (state.mode, state.now, state.work, state.exchanged) = saved;
                state.maker.count = counts;
                state.maker.happenings.clear();
                self.stepping.go_back(before)?;
                return Err(error);
            }
        };
        let mut last = mem::replace(&mut self.stepping, next);
        if self.keeps {
            self.stints.push(Stint { mode: saved.0, run: worked(last.reported(false), saved.2) });
            self.stints.extend(all.into_iter().map(|(mode, Segment { run, .. })| Stint { mode, run }));
        }
        self.count += 1;
        self.occurred.clear();
        self.occurred.append(&mut self.state.maker.happenings);
        self.record();
        Ok(())
    }

    fn record(&mut self) {
        if self.keeps {
            self.happened.extend_from_slice(&self.occurred);
        }
    }

    /// What happened in the last tick, in the order of time.
    pub fn occurred(&self) -> &[Happening] {
        &self.occurred
    }

    /// Current state; angles without whole turns.
    pub fn now(&self) -> &Output {
        self.stepping.now()
    }

    /// Coordinate i there, whole turns included.
    pub fn coordinate(&self, i: usize) -> f64 {
        self.stepping.coordinate(i)
    }

    /// Everything recorded, in the form that a run returns; with `here` only the current state. The mechanism is this
    /// one, where its inputs are known over time.
    ///
    /// # Errors
    /// Where the models of its modes cannot be made.
    pub fn reported(&mut self, here: bool, model: Option<&Arc<Model>>) -> Result<Segments, AnalysisError> {
        let plan = match model {
            None => self.plan.clone(),
            Some(model) => Arc::new(self.plan.of(model)),
        };
        let (mut maker, _) = Maker::new(plan, (self.functions)()?)?;
        let now = Stint { mode: self.state.mode.clone(), run: worked(self.stepping.reported(here), self.state.work) };
        let before: &[Stint] = if here { &[] } else { &self.stints };
        let mut all = Vec::with_capacity(before.len() + 1);
        let mut ends = f64::NEG_INFINITY;
        for Stint { mode, run } in before.iter().chain([&now]) {
            let mut run = again(run);
            // the end of one is the start of the next
            run.log.outputs.retain(|x| x.t > ends);
            ends = run.log.outputs.last().map_or(ends, |x| x.t);
            all.push(maker.with_run(mode, run, Output::default())?);
        }
        let happenings = if here { self.occurred.clone() } else { self.happened.clone() };
        Ok(Segments::new(all, happenings))
    }
}

/// The same without its steps, of a run that ended well.
fn again(run: &Run) -> Run {
    let Run { outcome, log, occurrences, counters, rows, closure_error, gaps, notes, exchanged, findings } = run;
    Run {
        outcome: Outcome {
            status: outcome.status,
            message: outcome.message.clone(),
            t: outcome.t,
            counters: outcome.counters,
            crossings: outcome.crossings.clone(),
            notes: outcome.notes.clone(),
            error: None,
        },
        log: SolutionLog {
            recipe: log.recipe.clone(),
            events: log.events.clone(),
            outputs: log.outputs.clone(),
            limits: log.limits,
            steps: None,
        },
        occurrences: occurrences.clone(),
        counters: *counters,
        rows: rows.clone(),
        closure_error: *closure_error,
        gaps: *gaps,
        notes: notes.clone(),
        exchanged: *exchanged,
        findings: findings.clone(),
    }
}

/// With the work done before.
fn worked(mut run: Run, work: f64) -> Run {
    run.log.outputs.iter_mut().for_each(|x| x.work += work);
    run
}
