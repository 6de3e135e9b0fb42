//! The end of a step: closed, judged, accepted or repeated, the choice renewed, the next step planned.

use super::Motion;
use crate::breakpoints::Passing;
use crate::error::Result;
use crate::formulation::{ChoiceSnapshot, FormulationSteps, SingularSteps, Step, StepDecision, StepReplay};
use crate::guards::Look;
use crate::positions::Positions;
use crate::record::{Crossings, Gaps, History, StepChecks};
use crate::system::{ConstrainedSystem, SystemError};
use crate::tangent::{Occasion, Tangent};
use partita_math::tolerance;

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    /// Accept or reject the step, and choose anew where required.
    fn conclude(&mut self, verdict: StepDecision, step: &mut Step) -> Result<bool> {
        let t = step.t;
        if verdict == StepDecision::Repeat {
            let failed = self.monitor.crosses_next && !self.monitor.judged;
            if self.monitor.lost || failed {
                return self.cross_again(step);
            }
            self.monitor.judged = false;
            let serving = self.monitor.serving.take();
            if self.monitor.spoilt || self.monitor.near_inside {
                self.monitor.spoilt_in_a_row += 1;
            }
            if self.monitor.spoilt && serving.is_none() {
                let (half_t, half) = self.half_way();
                let singular = SystemError::Singular { t: half_t, pivot: 0.0, limit: tolerance::SINGULAR_PIVOT };
                // a fixed choice has no alternative
                if let e @ SystemError::DeadPoint { .. } = self.tangent.blame(half_t, &half, singular) {
                    return Err(e);
                }
            }
            self.evaluate(t, step.y)?;
            if let Some(e) = self.positions.failure(&mut self.tangent, t) {
                return Err(e);
            }
            match serving {
                // where they do not serve at the start of the step it is repeated with a shorter one
                Some(rows) => drop(self.tangent.reduction().keep_rows(t, &rows)),
                None => drop(self.choose_anew(t, step.y, step.dy, Occasion::Spoilt)?),
            }
            self.derivative_by_levels(t, step.y, step.dy)?;
            self.tangent.sides(&mut self.monitor.sides);
            if let (Some(zero), Some(pace)) = (self.monitor.crossing.zero(), step.pace.as_deref_mut()) {
                self.monitor.crossing.cross(zero, pace);
            }
            return Ok(true);
        }
        self.watch.accept();
        self.checks.accept();
        self.monitor.spoilt_in_a_row = 0;
        if self.moved && (verdict == StepDecision::Change || self.tangent.attends()) {
            self.evaluate(t, step.y)?; // outputs were evaluated since
        }
        let why = self.positions.wants_change().map_or(Occasion::Decayed, Occasion::Positions);
        self.positions.accept(&mut self.tangent, t, self.margin.map(|m| m.0));
        let beside = self.place_of_prescribed();
        self.prescribed.accept(&mut step.y[beside..]);
        let mut rewritten = !self.prescribed.is_empty();
        rewritten |= verdict == StepDecision::Change && self.choose_anew(t, step.y, step.dy, why)?;
        self.tangent.accept(t, self.positions.q())?;
        let taken = (t, self.monitor.length().unwrap_or(0.0));
        let located = step.located.filter(|_| self.monitor.passes_a_singular_position());
        if self.monitor.crossing.crossed(taken, self.flip(t), located) {
            self.monitor.checkpoints.clear();
        }
        self.begin();
        rewritten |= self.positions.wrap(&self.tangent, step.y, step.turns);
        rewritten |= self.plan_ahead(step)?;
        Ok(rewritten)
    }

    /// A new choice at the point last evaluated; (q, v, v') stay the same. True if y and y' were rewritten.
    fn choose_anew(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], why: Occasion) -> Result<bool> {
        let (p, w) = self.offsets();
        self.moved = true;
        self.v.copy_from_slice(&self.tangent.seen().v);
        self.tangent.full_acceleration(&mut self.vdot);
        let mut q = self.positions.q().to_vec();
        if !self.tangent.renew(t, &mut q, &self.v, why)? {
            return Ok(false);
        }
        self.positions.rewrite(&mut self.tangent, &q, y);
        self.tangent.select(&self.v, &mut y[p..w]);
        self.tangent.select(&self.vdot, &mut dy[p..w]); // S δ = 0
        self.tangent.reduction().v.copy_from_slice(&self.v);
        self.positions.rates(&mut self.tangent, &y[p..w], dy);
        Ok(true)
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> FormulationSteps
    for Motion<'s, S, T, P>
{
    fn trial_end(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], known: bool) -> Result<(StepDecision, bool)> {
        self.looking = false;
        let (p, w) = self.offsets();
        if !self.prescribed.is_empty() {
            let beside = self.place_of_prescribed();
            self.prescribed.look(self.tangent.seen(), t, &y[beside..], self.positions.q())?;
        }
        let mut evaluates = self.positions.settle(&mut self.tangent, t, y)? || !known;
        let (of_q, rest) = y.split_at_mut(p);
        if self.tangent.integrates_velocities() {
            self.checks.integrated(&rest[..w - p]);
        }
        evaluates |= self.tangent.settle(t, of_q, &mut rest[..w - p])?;
        self.settled = self.positions.is_found();
        if evaluates {
            if !self.end_by_code(t, y, Some(dy))? {
                self.derivative_by_levels(t, y, dy)?;
            }
        } else if self.behind {
            // counted where it was evaluated by code
            let r = self.tangent.reduction();
            r.factorisations -= u64::from(r.rank() > 0);
            if !self.end_by_code(t, y, None)? {
                self.evaluate(t, y)?;
            }
        }
        (self.moved, self.settled) = (false, false);
        self.prescribed.look_at_end(self.tangent.seen(), self.positions.q());
        self.watch.look(t, self.tangent.seen());
        self.watch.check(t, self.positions.q(), self.tangent.seen())?;
        self.margin = self.tangent.margin();
        self.look_back(t);
        self.check_step(t);
        if self.monitor.jumped {
            return Err(self.not_crossed(t));
        }
        if self.monitor.lost || self.monitor.spoilt {
            return Ok((StepDecision::Repeat, evaluates));
        }
        let mut verdict = self.positions.judge(&mut self.tangent, t, self.margin.map(|m| m.0));
        // one that crosses a singular position is repeated with another length
        self.monitor.lost = verdict == StepDecision::Repeat && self.monitor.crosses_next;
        if verdict == StepDecision::Keep {
            verdict = self.tangent.judge(t, self.positions.q());
        }
        if verdict == StepDecision::Keep {
            verdict = match (self.positions.wants_change(), self.positions.is_stuck()) {
                (Some(_), _) => StepDecision::Change,
                (None, true) => StepDecision::Repeat,
                (None, false) => StepDecision::Keep,
            };
        }
        Ok((verdict, evaluates))
    }
    fn breakpoint_within(&mut self, tolerance: f64) -> Passing {
        let found = self.breakpoints.look(tolerance);
        if let Passing::Until(t) = found {
            self.monitor.is_interrupted(t);
        }
        found
    }
    fn breakpoint_ahead(&self, h: f64, tolerance: f64) -> Option<f64> {
        (!self.monitor.crosses_next).then(|| self.breakpoints.ahead(h, tolerance))?
    }
    fn guard(&mut self, tolerance: f64, may_end: bool) -> Look {
        let look = self.guards.look(tolerance);
        self.looking = matches!(look, Look::At(_));
        match look {
            Look::Crossed { t, .. } if may_end && self.monitor.is_interrupted(t) => look,
            Look::Crossed { t, guard, hidden } if !may_end => {
                if hidden {
                    self.checks.hidden(t, guard);
                }
                Look::Clear
            }
            _ => look,
        }
    }
    fn look_at(&mut self, t: f64, y: &[f64]) -> Result<()> {
        (self.moved, self.looking) = (true, false);
        self.evaluate(t, y)?;
        let r = self.tangent.reduction();
        let (q, fastest) = (self.positions.q(), r.fastest());
        if !self.guards.is_empty() {
            self.guards.inside(t, fastest, |out| r.system.guard_readings(t, q, &r.v, &mut r.scratch, out));
        }
        if !self.breakpoints.is_empty() {
            self.breakpoints.inside(t, fastest, |out| r.system.breakpoint_readings(t, q, &r.v, &mut r.scratch, out));
        }
        Ok(())
    }
    fn commit(&mut self, verdict: StepDecision, step: &mut Step) -> Result<bool> {
        self.conclude(verdict, step)
    }
    fn crossings(&self) -> Crossings {
        self.monitor.crossing.times.clone()
    }
    fn gaps(&self) -> Gaps {
        self.watch.gaps
    }
    fn checks(&self) -> StepChecks {
        self.checks.taken
    }
    fn forget_gaps(&mut self) {
        self.watch.gaps = Gaps::default();
        self.checks.forget();
    }
    fn margin(&self) -> Option<f64> {
        self.margin.map(|m| m.0)
    }
    fn history(&self) -> History {
        let mut history = History { name: self.name, crossings: self.crossings(), ..History::default() };
        (history.closure_error, history.gaps, history.checks) =
            (self.watch.closure_error, self.watch.gaps, self.checks.taken);
        self.tangent.base().report(&mut history);
        self.tangent.report(&mut history);
        self.positions.report(&mut history);
        if let Some(compiled) = &self.compiled {
            compiled.report(&mut history);
        }
        history.notes.extend(self.guards.notes());
        history
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> SingularSteps for Motion<'s, S, T, P> {
    fn crossing_failed(&self, t: f64) -> Option<SystemError> {
        (self.monitor.crossing.tries().0 > 0).then(|| self.not_crossed(t))
    }
    fn may_have_passed(&self) -> Option<f64> {
        (self.monitor.flipped() || self.may_flip_twice()).then(|| self.monitor.rate())
    }
    fn nears_unforeseen(&mut self, distance: f64) -> bool {
        let at_ends = self.margins().into_iter().flatten().fold(f64::INFINITY, f64::min);
        self.monitor.nears_unforeseen(distance, at_ends)
    }
    fn passed_unforeseen(&mut self) -> bool {
        self.monitor.passed_unforeseen(P::CLOSED)
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> StepReplay for Motion<'s, S, T, P> {
    fn choice_version(&self) -> Option<u64> {
        // coordinates that are solved for also depend on the position last found
        self.tangent.version().filter(|_| self.positions.has_all())
    }
    fn choice_snapshot(&self) -> Option<ChoiceSnapshot> {
        self.choice_version().map(|_| self.tangent.snapshot())
    }
    fn step_margins(&self) -> [Option<f64>; 2] {
        self.margins()
    }
    fn replay(&mut self, choice: Option<&ChoiceSnapshot>, margins: [Option<f64>; 2]) {
        if let Some(choice) = choice {
            self.tangent.restore(choice);
        }
        self.replay_between(margins);
    }
}
