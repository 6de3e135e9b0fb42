//! A motion taken tick by tick, for control loops: the same formulation, corrections and exchanges as a run.

use super::{inconsistent, note_of_dropped, registry, verdict, Balance, Journal, Limits, Request, Run, CANNOT_MOVE};
use crate::error::AnalysisError;
use partita_integrate::clock::{Clock, Ticks};
use partita_integrate::counters::Counters;
use partita_integrate::simulate::{explain, Outcome, Status};
use partita_system::formulation::Formulation;
use partita_system::options::FormulationOptions;
use partita_system::positions::turns;
use partita_system::record::{Gaps, Output, StepChecks};
use partita_system::reduction::bridged_gap;
use partita_system::singular::consistency;
use partita_system::start;
use partita_system::{weight, SystemError};

/// A motion between two ticks.
pub struct Stepping<'s, S: Balance> {
    system: &'s S,
    formulation: Box<dyn Formulation + Send + 's>,
    clock: Clock,
    name: String,
    rank: usize,
    options: FormulationOptions,
    limits: Limits,
    notes: Vec<String>,
    /// Where it stands.
    now: Output,
    /// Work done before the formulation was started the last time.
    work: f64,
    /// What is kept for a result, if anything is.
    kept: Option<Vec<Output>>,
    steps: u64,
    /// The worst that stood open at the ends of the steps that were kept, and what else they were held against.
    gaps: Gaps,
    checks: StepChecks,
}

impl<'s, S: Balance<Scratch: Send>> Stepping<'s, S> {
    /// From a closed state; `keeps` says whether every tick is kept for a result.
    ///
    /// # Errors
    /// What was asked makes no sense, or nothing can start there.
    pub fn new(
        system: &'s S,
        request: &Request,
        (length, steps): (f64, u32),
        (t, q, v): (f64, &[f64], &[f64]),
        keeps: bool,
    ) -> Result<Self, AnalysisError> {
        let settings = request.settings()?;
        let mut options = request.formulation_options(system, None)?;
        let mut limits = Limits::of(request);
        let mut notes = Vec::new();
        let found = start::analyse(system, t, q)?;
        if found.misfit > 0.0 {
            options.misfit = bridged_gap(system.drawing_tolerance());
            limits.misfit = options.misfit;
        }
        if !found.dropped.is_empty() {
            notes.push(note_of_dropped(system, &found));
            consistency::check(system, &found, (t, q, v), length)?;
        }
        inconsistent::refuse(system, found.rank, t, q)?;
        let driven = system.rheonomic() || (0..system.size().rows).any(|i| system.row_is_drive(i));
        if found.rank == system.size().nv && !driven {
            return Err(AnalysisError::Argument { argument: "dt", message: CANNOT_MOVE.into() });
        }
        weight::refuse(system, t, q, found.rank)?;
        notes.extend(system.start_notes(q, v)?);
        let formulation = registry::by_name(&request.formulation, system, found.rank, &options)?;
        let ticks = Ticks { tableau: settings.tableau, length, steps };
        let clock = Clock::new(ticks, formulation.dim(), system.size().nq)
            .map_err(|e| AnalysisError::Argument { argument: "dt", message: e.to_string() })?;
        let (name, rank) = (request.formulation.clone(), found.rank);
        let now = Output { turns: vec![0; q.len()], ..Output::default() };
        let kept = keeps.then(Vec::new);
        let mut stepping = Self {
            system,
            formulation,
            clock,
            name,
            rank,
            options,
            limits,
            notes,
            now,
            work: 0.0,
            kept,
            steps: 0,
            gaps: Gaps::default(),
            checks: StepChecks::default(),
        };
        stepping.stand(t, q, v, || ())?;
        Ok(stepping)
    }

    /// Stand at a closed state, as if nothing had been before.
    ///
    /// # Errors
    /// The motion cannot start there; then it stays where it was, and `undo` has made what acts what it was there.
    pub fn begin(&mut self, t: f64, q: &[f64], v: &[f64], undo: impl FnOnce()) -> Result<(), AnalysisError> {
        let seen = start::analyse(self.system, t, q).map_err(AnalysisError::from).and_then(|found| {
            inconsistent::refuse(self.system, found.rank, t, q)?;
            if found.rank == self.rank {
                return Ok(());
            }
            let message = format!(
                "its conditions have the rank {} there and {} where the stepper was made; make another one",
                found.rank, self.rank
            );
            Err(SystemError::Tick { t, message }.into())
        });
        if let Err(e) = seen {
            undo();
            return Err(e);
        }
        self.stand(t, q, v, undo)
    }

    /// See `begin`; at a position that was looked at.
    fn stand(&mut self, t: f64, q: &[f64], v: &[f64], undo: impl FnOnce()) -> Result<(), AnalysisError> {
        let before = (self.clock.origin(), self.clock.count());
        let zero = vec![0; q.len()];
        let begun = self.clock.start(&mut self.formulation, (t, 0), (q, v), &zero).and_then(|()| {
            let mut now = Output { turns: zero.clone(), ..Output::default() };
            self.formulation.state_at(t, self.clock.state(), &mut now)?;
            Ok(now)
        });
        match begun {
            Ok(now) => {
                (self.now, self.work) = (now, 0.0);
                (self.gaps, self.checks) = (Gaps::default(), StepChecks::default());
                self.formulation.forget_gaps();
                if let Some(kept) = &mut self.kept {
                    kept.clear();
                    kept.push(self.now.clone());
                }
                Ok(())
            }
            Err(e) => {
                undo();
                if !self.now.q.is_empty() {
                    self.back(before)?;
                }
                Err(e.into())
            }
        }
    }

    /// Back to where it stood, after a tick or a start that failed.
    fn back(&mut self, place: (f64, u64)) -> Result<(), AnalysisError> {
        self.work = self.now.work;
        self.formulation.forget_gaps();
        Ok(self.clock.start(&mut self.formulation, place, (&self.now.q, &self.now.v), &self.now.turns)?)
    }

    /// One tick.
    ///
    /// # Errors
    /// What could not be evaluated or passed; then it stays where it was.
    pub fn step(&mut self) -> Result<(), AnalysisError> {
        let place = (self.clock.origin(), self.clock.count());
        let mut taken = self.clock.tick(&mut self.formulation);
        if taken.is_ok() {
            // closed anew, and the choice in use told
            let mut now = std::mem::take(&mut self.now);
            let before = (now.t, now.work);
            now.turns.copy_from_slice(self.clock.turns());
            let t = self.clock.time();
            let told = self.formulation.state_at(t, self.clock.state(), &mut now);
            match told.and_then(|()| self.holds(t)) {
                Ok(()) => {
                    now.work += self.work;
                    self.now = now;
                    self.steps += 1;
                    self.gaps.raise(&self.formulation.gaps());
                    self.checks.raise(&self.formulation.checks());
                    if let Some(kept) = &mut self.kept {
                        kept.push(self.now.clone());
                    }
                    return Ok(());
                }
                Err(error) => {
                    (now.t, now.work) = before;
                    self.now = now;
                    taken = Err(partita_integrate::failure::StepFailure::Rhs { t, error });
                }
            }
        }
        let Err(failure) = taken else { return Ok(()) };
        let (status, message, error) = explain(failure, self.now.t);
        self.back(place)?;
        Err(match error {
            Some(e) => e.into(),
            None if status == Status::StepTooSmall => {
                let message = "coordinates cannot be kept or exchanged in it, as in a singular position or next to one; step over \
                               it: another number of substeps, another length of steps, other inputs";
                SystemError::Tick { t: self.now.t, message: message.into() }.into()
            }
            None => AnalysisError::Argument { argument: "dt", message: format!("{message}; take shorter steps") },
        })
    }

    /// Does what the last tick left hold?
    fn holds(&self, t: f64) -> Result<(), SystemError> {
        let mut findings = Vec::new(); // which takes memory where there are some
        self.limits.judge(self.system, &self.formulation.gaps(), "the end of the step", &mut findings);
        self.limits.judge_checks(self.system, &self.formulation.checks(), &mut findings);
        match findings.into_iter().find(|x| x.broken) {
            None => Ok(()),
            Some(found) => {
                let message = format!(
                    "{}; the mechanism does not reach so far, or a singular position lies in the step: give other inputs, or \
                     take shorter steps",
                    found.sentence
                );
                Err(SystemError::Tick { t, message })
            }
        }
    }

    /// Where it stands; angles without their whole turns.
    pub fn now(&self) -> &Output {
        &self.now
    }

    /// Coordinate i there, whole turns included.
    pub fn coordinate(&self, i: usize) -> f64 {
        turns::whole(self.now.q[i], self.now.turns[i])
    }

    /// All that was kept, as what a run leaves; with `here` no more than where it stands.
    pub fn told(&mut self, here: bool) -> Run {
        let told = self.formulation.journal();
        let outputs = match &self.kept {
            Some(kept) if !here => kept.clone(),
            _ => vec![self.now.clone()],
        };
        let mut outcome = Outcome {
            status: Status::Finished,
            message: format!("stepped to t = {}", self.now.t),
            t: self.now.t,
            counters: Counters { steps: self.steps, ..Counters::default() },
            passages: Vec::new(),
            error: None,
        };
        let mut notes = self.notes.clone();
        notes.extend(told.notes);
        let mut findings = Vec::new();
        self.limits.judge(self.system, &self.gaps, "the end of the step", &mut findings);
        self.limits.judge_checks(self.system, &self.checks, &mut findings);
        let journal = Journal {
            formulation: self.name.clone(),
            rank: self.rank,
            options: self.options.clone(),
            events: told.events,
            outputs,
            limits: self.limits,
        };
        if !here {
            verdict::conclude(self.system, &mut self.formulation, &journal, &mut outcome, &mut findings);
        }
        let (counters, rows, open, gaps) = (told.counters, told.rows, told.open, self.gaps);
        Run { outcome, journal, counters, rows, open, gaps, notes, findings }
    }
}
