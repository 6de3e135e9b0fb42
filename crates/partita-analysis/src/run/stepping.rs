//! A motion advanced tick by tick, for control loops: the same formulation, corrections and switches as a run.

use super::prepared::{Entry, CANNOT_MOVE};
use super::singular_start::BranchStart;
use super::{verdict, Limits, Prepared, Recipe, Request, Run, SolutionLog};
use crate::error::AnalysisError;
use partita_integrate::counters::Counters;
use partita_integrate::failure::StepFailure;
use partita_integrate::march::{Control, March, Outputs};
use partita_integrate::method::Method;
use partita_integrate::options::Options;
use partita_integrate::simulate::{explain, Observe, Outcome, Status};
use partita_model::Model;
use partita_system::event::Occurrence;
use partita_system::formulation::{Formulation, Purpose};
use partita_system::positions::turns;
use partita_system::record::{Crossings, Gaps, Output, StepChecks};
use partita_system::{SystemError, SystemRef};
use std::mem;
use std::ops::ControlFlow;

/// Parts of a tick that the time must resolve where it begins. Unit: number. Reason: a step is as exact as its two times.
const RESOLVED: f64 = 16.0;

/// Refuse ticks that are lost beside the time at which they begin.
fn resolved(t: f64, length: f64) -> Result<(), AnalysisError> {
    if t + length / RESOLVED != t {
        return Ok(());
    }
    let spacing = partita_math::formatted(f64::EPSILON * t.abs());
    let message = format!(
        "times near t = {t} s are {spacing} s apart, too far for steps of {} s; start nearer to t = 0, with loads and \
         drives shifted as much",
        partita_math::formatted(length)
    );
    Err(AnalysisError::Argument { argument: "dt", message })
}

/// What advances a formulation by ticks of this length, in so many steps each.
fn ticking(
    formulation: &mut dyn Formulation,
    coordinates: usize,
    method: &'static dyn Method,
    (length, steps): (f64, u32),
) -> Result<March, AnalysisError> {
    let options = Options { fixed_step: Some(length / f64::from(steps)), ..Options::default() };
    March::new(formulation, coordinates, method, options, Control::Ticks { steps })
        .map_err(|e| AnalysisError::Argument { argument: "dt", message: e.to_string() })
}

/// Makes what finds the events of a motion that starts.
pub type Observing = Box<dyn Fn() -> Result<Observe, AnalysisError> + Send + Sync>;

/// A motion between two ticks.
pub struct Stepping<'s> {
    system: SystemRef<'s, Model>,
    formulation: Box<dyn Formulation + Send + 's>,
    march: March,
    /// Method, and steps of it in a tick.
    method: &'static dyn Method,
    substeps: u32,
    /// Length of a tick, when the first one began, and ticks since.
    length: f64,
    origin: f64,
    count: u64,
    rtol: f64,
    /// The first step of a start at a singular position, while the stepper is there.
    singular_start: Option<BranchStart<'s, Model>>,
    /// Its note.
    departed: Option<String>,
    /// How the last start was corrected.
    corrected: Option<String>,
    recipe: Recipe,
    limits: Limits,
    notes: Vec<String>,
    /// Current state.
    now: Output,
    /// Work done before the formulation was started the last time.
    work: f64,
    /// Data recorded for a result, if requested.
    kept: Option<Vec<Output>>,
    steps: u64,
    /// Makes what finds events, if there are some.
    observing: Option<Observing>,
    /// Events of the last tick, and of those before, if these are recorded.
    occurred: Vec<Occurrence>,
    occurrences: Vec<Occurrence>,
    /// Largest constraint violations at the ends of the accepted steps, and their other checks.
    gaps: Gaps,
    checks: StepChecks,
}

impl<'s> Stepping<'s> {
    /// From a closed state; `keeps` states whether every tick is recorded for a result.
    ///
    /// # Errors
    /// The request is invalid, or the stepper cannot start there.
    pub fn new(
        system: SystemRef<'s, Model>,
        request: &Request,
        (length, steps): (f64, u32),
        (t, q, v): (f64, &[f64], &[f64]),
        keeps: bool,
    ) -> Result<Self, AnalysisError> {
        resolved(t, length)?;
        // its steps have bounded work
        let request = Request { t0: t, t_end: t + length, compiles_beside: true, ..request.clone() };
        let prepared = Prepared::new(system.clone(), &request, None, (q, v))?;
        if prepared.rests() {
            return Err(AnalysisError::Argument { argument: "dt", message: CANNOT_MOVE.into() });
        }
        let Prepared { mut formulation, recipe, settings, limits, notes, singular_start, corrected, q, v, .. } =
            prepared;
        let march = ticking(&mut *formulation, q.len(), settings.method, (length, steps))?;
        let now = Output { turns: vec![0; q.len()], ..Output::default() };
        let kept = keeps.then(Vec::new);
        let mut stepping = Self {
            system,
            formulation,
            march,
            method: settings.method,
            substeps: steps,
            length,
            origin: t,
            count: 0,
            rtol: request.rtol,
            singular_start: None,
            departed: None,
            corrected,
            recipe,
            limits,
            notes,
            now,
            work: 0.0,
            kept,
            steps: 0,
            occurred: Vec::new(),
            occurrences: Vec::new(),
            observing: None,
            gaps: Gaps::default(),
            checks: StepChecks::default(),
        };
        stepping.start_at((t, &q, &v), singular_start)?;
        Ok(stepping)
    }

    /// Find events from the start of the motion on.
    ///
    /// # Errors
    /// Where their functions cannot be made.
    pub fn observe(&mut self, observing: Observing) -> Result<(), AnalysisError> {
        self.march.observe(observing()?);
        self.observing = Some(observing);
        Ok(())
    }

    /// Find events from here on, until the motion begins anew.
    pub(super) fn observe_once(&mut self, observe: Observe) {
        self.march.observe(observe);
    }

    /// Count ticks from another one on.
    pub(super) fn count_from(&mut self, origin: f64, count: u64) {
        (self.origin, self.count) = (origin, count);
    }

    /// Strike the last tick from the record.
    pub(super) fn withdraw(&mut self) {
        self.count -= 1;
        self.steps -= 1;
        if let Some(kept) = &mut self.kept {
            kept.pop();
        }
    }

    /// Go on from the state before a tick that was withdrawn.
    ///
    /// # Errors
    /// Where it cannot be evaluated.
    pub(super) fn go_back(&mut self, before: Output) -> Result<(), AnalysisError> {
        self.now = Output { turns: vec![0; before.q.len()], ..before };
        self.back()
    }

    /// The events of the last tick, in the order of time.
    pub fn occurred(&self) -> &[Occurrence] {
        &self.occurred
    }

    /// Restart at a closed state, without history: as a stepper made there.
    ///
    /// # Errors
    /// Where the motion cannot start; then the state is unchanged, and `undo` has restored the inputs.
    pub fn begin(&mut self, t: f64, q: &[f64], v: &[f64], undo: &mut dyn FnMut()) -> Result<(), AnalysisError> {
        let end = t + self.length;
        let mut recipe = self.recipe.clone();
        let entry = resolved(t, self.length)
            .and_then(|()| Entry::at(&self.system, &mut recipe, (t, q, v), (end, self.rtol), self.length));
        let entry = entry.and_then(|entry| {
            if recipe.rank == self.recipe.rank {
                return Ok(entry);
            }
            let message = format!(
                "its constraints have rank {} there, but rank {} where the stepper was made; make a new stepper",
                recipe.rank, self.recipe.rank
            );
            Err(SystemError::Tick { t, message }.into())
        });
        // a choice of coordinates, its order and its scales follow from the motion before
        let entry = entry.and_then(|entry| {
            let mut formulation = recipe.make(self.system.clone())?;
            let mut march = ticking(&mut *formulation, entry.q.len(), self.method, (self.length, self.substeps))?;
            if let Some(observing) = &self.observing {
                march.observe(observing()?);
            }
            Ok((entry, formulation, march))
        });
        match entry {
            Ok((Entry { looked, q, v, corrected }, formulation, march)) => {
                let before = (mem::replace(&mut self.formulation, formulation), mem::replace(&mut self.march, march));
                let begun = self.start_at((t, &q, &v), looked.singular_start);
                if begun.is_err() {
                    (self.formulation, self.march) = before;
                    undo();
                    return begun;
                }
                (self.corrected, self.steps) = (corrected, 0);
                Ok(())
            }
            Err(e) => {
                undo();
                Err(e)
            }
        }
    }

    /// See `begin`; at an examined position. Where the motion cannot start, nothing but the formulation has changed.
    fn start_at(
        &mut self,
        (t, q, v): (f64, &[f64], &[f64]),
        mut singular_start: Option<BranchStart<'s, Model>>,
    ) -> Result<(), AnalysisError> {
        let zero = vec![0; q.len()];
        let mut now = Output { turns: zero, ..Output::default() };
        let purpose = if self.kept.is_some() { Purpose::Keep } else { Purpose::Look };
        let begun = match &mut singular_start {
            None => self
                .march
                .begin(&mut *self.formulation, t, (q, v), None)
                .and_then(|()| self.formulation.state_at(t, self.march.state(), purpose, &mut now)),
            Some(x) => {
                let begun = self.march.begin(&mut *self.formulation, x.step.t, (&x.step.q, &x.step.v), None);
                begun.and_then(|()| x.step.output(t, &mut now))
            }
        };
        begun?;
        self.now = now;
        self.work = singular_start.as_ref().map_or(0.0, |x| x.step.work);
        self.departed = singular_start.as_ref().map(|x| x.note.clone());
        self.singular_start = singular_start;
        (self.gaps, self.checks) = (Gaps::default(), StepChecks::default());
        (self.origin, self.count) = (t, 0);
        self.occurred.clear();
        self.occurrences.clear();
        if let Some(kept) = &mut self.kept {
            kept.clear();
            kept.push(self.now.clone());
        }
        Ok(())
    }

    /// Restore the state before a tick or a start that failed.
    fn back(&mut self) -> Result<(), AnalysisError> {
        self.march.forget_occurrences();
        let f = &mut *self.formulation;
        if let Some(x) = &self.singular_start {
            return Ok(self.march.begin(f, x.step.t, (&x.step.q, &x.step.v), None)?);
        }
        self.work = self.now.work;
        Ok(self.march.begin(f, self.now.t, (&self.now.q, &self.now.v), Some(&self.now.turns))?)
    }

    /// The end of a tick: computed as a multiple, so that errors do not accumulate.
    fn end_of(&self, tick: u64) -> f64 {
        self.origin + tick as f64 * self.length
    }

    /// One tick.
    ///
    /// # Errors
    /// Where something could not be evaluated or crossed; then the state is unchanged.
    pub fn step(&mut self) -> Result<(), AnalysisError> {
        let t = self.end_of(self.count + 1);
        let mut none = |_: &Output| Ok(());
        let mut outputs = Outputs::new(&[], &mut none);
        let go_on = &mut |_: f64| ControlFlow::Continue(());
        let mut taken = self.march.advance_to(&mut *self.formulation, t, &mut outputs, go_on);
        if taken.is_ok() {
            // closed again, with the choice in use
            let mut now = std::mem::take(&mut self.now);
            let before = (now.t, now.work);
            now.turns.copy_from_slice(self.march.turns());
            let purpose = if self.kept.is_some() { Purpose::Keep } else { Purpose::Look };
            let reported = self.formulation.state_at(t, self.march.state(), purpose, &mut now);
            match reported.and_then(|()| self.check_end(t)) {
                Ok(()) => {
                    now.work += self.work;
                    self.now = now;
                    self.singular_start = None;
                    self.count += 1;
                    self.steps += 1;
                    let (gaps, checks) = self.formulation.point().checks();
                    self.gaps.raise(&gaps);
                    self.checks.raise(&checks);
                    self.occurred = self.march.take_occurrences();
                    self.occurred.iter_mut().for_each(|x| x.state.work += self.work);
                    if let Some(kept) = &mut self.kept {
                        kept.push(self.now.clone());
                        self.occurrences.extend_from_slice(&self.occurred);
                    }
                    return Ok(());
                }
                Err(error) => {
                    (now.t, now.work) = before;
                    self.now = now;
                    taken = Err(StepFailure::Rhs { t, error });
                }
            }
        }
        let Err(failure) = taken else { return Ok(()) };
        let (status, message, error) = explain(failure, self.now.t);
        self.back()?;
        Err(match error {
            Some(e) => e.into(),
            None if status == Status::StepTooSmall => {
                let message = "no independent coordinates determine the others there, as at or near a singular \
                    position; step over the position with another number of substeps, another step length or other \
                    inputs";
                SystemError::Tick { t: self.now.t, message: message.into() }.into()
            }
            None => AnalysisError::Argument { argument: "dt", message: format!("{message}; take shorter steps") },
        })
    }

    /// Whether the end of the last tick is valid.
    fn check_end(&mut self, t: f64) -> Result<(), SystemError> {
        let mut findings = Vec::new(); // which takes memory where there are some
        let (gaps, checks) = self.formulation.point().checks();
        self.limits.judge(&*self.system, &gaps, "the end of the step", &mut findings);
        self.limits.judge_checks(&*self.system, &checks, &mut findings);
        match findings.into_iter().find(|x| x.invalid) {
            None => Ok(()),
            Some(found) => {
                let message = format!(
                    "{}; the mechanism cannot reach this position, or a singular position lies within the step; \
                     change the inputs, or take shorter steps",
                    found.sentence
                );
                Err(SystemError::Tick { t, message })
            }
        }
    }

    /// Current state; angles without whole turns.
    pub fn now(&self) -> &Output {
        &self.now
    }

    /// Coordinate i there, whole turns included.
    pub fn coordinate(&self, i: usize) -> f64 {
        turns::whole(self.now.q[i], self.now.turns[i])
    }

    /// Everything recorded, in the form that a run returns; with `here` only the current state.
    pub fn reported(&mut self, here: bool) -> Run {
        let reported = self.formulation.history();
        let outputs = match &self.kept {
            Some(kept) if !here => kept.clone(),
            _ => vec![self.now.clone()],
        };
        let mut outcome = Outcome {
            status: Status::Finished,
            message: format!("stepped to t = {}", self.now.t),
            t: self.now.t,
            counters: Counters { steps: self.steps, ..Counters::default() },
            crossings: Crossings::default(),
            notes: Vec::new(),
            error: None,
        };
        let mut notes = self.notes.clone();
        notes.extend(self.departed.clone());
        notes.extend(self.corrected.clone());
        notes.extend(reported.notes);
        notes.extend(self.march.notes());
        notes.extend(verdict::note_of_nearness(&*self.system, &self.checks));
        let mut findings = Vec::new();
        self.limits.judge(&*self.system, &self.gaps, "the end of the step", &mut findings);
        self.limits.judge_checks(&*self.system, &self.checks, &mut findings);
        let (recipe, limits, events) = (self.recipe.clone(), self.limits, reported.events);
        let log = SolutionLog { recipe, events, outputs, limits, steps: None };
        if !here {
            verdict::conclude(&*self.system, &mut *self.formulation, (&log, None), &mut outcome, &mut findings);
        }
        let (counters, rows, closure_error, gaps) =
            (reported.counters, reported.rows, reported.closure_error, self.gaps);
        let exchanged = self.checks.exchanged();
        let occurrences = if here { self.occurred.clone() } else { self.occurrences.clone() };
        Run { outcome, log, occurrences, counters, rows, closure_error, gaps, notes, exchanged, findings }
    }
}
