//! The end of a step: closed, judged, accepted or repeated, the choice renewed, the next step planned.

use super::crossing::Shown;
use super::{LevelsOf, Motion};
use crate::error::Result;
use crate::formulation::{ChoiceSnapshot, Point as _, Repeated, Step, StepDecision, StepReplay, TrialEnd};
use crate::positions::Positions;
use crate::record::Gap;
use crate::system::{ConstrainedSystem, SystemError};
use crate::tangent::{Occasion, Tangent};
use partita_math::tolerance;

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    /// The end (t, y) of a step: closed, evaluated and judged.
    pub(super) fn end(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], known: bool) -> Result<TrialEnd> {
        let (p, w) = self.offsets();
        let mut evaluated = self.positions.settle(&mut self.tangent, t, y)? || !known;
        let (of_q, rest) = y.split_at_mut(p);
        if self.tangent.integrates_velocities() {
            self.checks.integrated(&rest[..w - p]);
        }
        evaluated |= self.tangent.settle(t, of_q, &mut rest[..w - p])?;
        let behind = self.levels_of == LevelsOf::Behind;
        self.levels_of = if self.positions.is_found() { LevelsOf::Settled } else { LevelsOf::Elsewhere };
        if evaluated {
            if !self.end_by_code(t, y, Some(dy), behind)? {
                self.derivative_by_levels(t, y, dy)?;
            }
        } else if behind {
            // counted where it was evaluated by code
            let r = self.tangent.reduction();
            r.counts.factorisations -= u64::from(r.rank() > 0);
            if !self.end_by_code(t, y, None, behind)? {
                self.evaluate(t, y)?;
            }
        }
        self.levels_of = LevelsOf::End(self.levels_at);
        self.prescribed.look_at_end(self.positions.q(), &self.tangent.seen().at.v);
        self.closure.look(t, self.tangent.seen());
        self.closure.check(t, self.positions.q(), self.tangent.seen())?;
        self.margin = self.tangent.margin();
        self.look_back(t);
        self.check_step(t);
        let shown = self.monitor.attempted.shown;
        if shown == Shown::Jumped {
            return Err(self.not_crossed(t));
        }
        let decision = match shown {
            Shown::Lost | Shown::Spoilt => StepDecision::Repeat,
            _ => self.decision(t),
        };
        Ok(TrialEnd {
            t,
            decision,
            evaluated,
            margin: self.margin.map(|m| m.0),
            passing: if decision == StepDecision::Repeat { None } else { self.passing() },
            crosses: self.monitor.passes_a_singular_position(),
            most: (self.closure.fastest_yet(), self.checks.strongest()),
        })
    }

    /// What the positions and the tangent make of the step that ends at the point last evaluated.
    fn decision(&mut self, t: f64) -> StepDecision {
        let judged = self.positions.judge(&mut self.tangent, t, self.margin.map(|m| m.0));
        if judged == StepDecision::Repeat && self.monitor.crosses_next() {
            self.monitor.lose(); // one that crosses a singular position is repeated with another length
        }
        if judged != StepDecision::Keep {
            return judged;
        }
        match self.tangent.judge(t, self.positions.q()) {
            StepDecision::Keep => match (self.positions.wants_change(), self.positions.is_stuck()) {
                (Some(_), _) => StepDecision::Change,
                (None, true) => StepDecision::Repeat,
                (None, false) => StepDecision::Keep,
            },
            other => other,
        }
    }

    /// The integration begins at the current state: plan its first step. Nothing is rewritten.
    pub(super) fn begin_at(&mut self, step: &mut Step) -> Result<bool> {
        self.evaluate(step.t, step.y)?;
        self.margin = self.tangent.margin();
        self.look_back(step.t);
        self.begin();
        // what acts may have changed: no way leads back
        self.monitor.checkpoints.clear();
        self.levels_of = LevelsOf::Planning;
        self.plan_ahead(step)?;
        self.levels_of = LevelsOf::Elsewhere;
        Ok(false)
    }

    /// The step is rejected: cross a singular position otherwise, or choose anew at its start.
    pub(super) fn repeat(&mut self, step: &mut Step) -> Result<bool> {
        let t = step.t;
        match step.findings.repeated {
            Some(Repeated::Abrupt(at)) => {
                self.monitor.abrupt = Some(at);
                self.monitor.lose();
            }
            Some(Repeated::Passed) => self.monitor.lose(),
            Some(Repeated::Near) | None => {}
        }
        let shown = self.monitor.attempted.shown;
        let failed = self.monitor.crosses_next() && self.monitor.judgement.is_none();
        if shown == Shown::Lost || failed {
            return self.cross_again(step);
        }
        self.monitor.judgement = None;
        let serving = self.monitor.serving.take();
        let spoilt = shown == Shown::Spoilt;
        if spoilt || step.findings.repeated == Some(Repeated::Near) {
            self.monitor.spoilt_in_a_row += 1;
        }
        if spoilt && serving.is_none() {
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
        Ok(true)
    }

    /// The step is accepted: choose anew where required, and plan the next one.
    pub(super) fn accept(&mut self, decision: StepDecision, step: &mut Step) -> Result<bool> {
        let t = step.t;
        self.closure.accept();
        self.checks.accept(step.findings.hidden.map(|hidden| Gap { part: 1.0, t: hidden.0, row: hidden.1 }));
        self.monitor.spoilt_in_a_row = 0;
        let moved = !matches!(self.levels_of, LevelsOf::End(_));
        if moved && (decision == StepDecision::Change || self.tangent.attends()) {
            self.evaluate(t, step.y)?; // outputs were evaluated since
        }
        let why = self.positions.wants_change().map_or(Occasion::Decayed, Occasion::Positions);
        self.positions.accept(&mut self.tangent, t, self.margin.map(|m| m.0));
        self.prescribed.accept(&mut step.y[self.layout.beside..]);
        let mut rewritten = !self.prescribed.is_empty();
        rewritten |= decision == StepDecision::Change && self.choose_anew(t, step.y, step.dy, why)?;
        self.tangent.accept(t, self.positions.q())?;
        let taken = (t, self.monitor.length().unwrap_or(0.0));
        let passes = |located: &&[f64]| self.monitor.passes_a_singular_position() || !located.is_empty();
        let located = step.findings.located.filter(passes);
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
        self.levels_of = LevelsOf::Elsewhere;
        self.v.copy_from_slice(&self.tangent.seen().at.v);
        self.tangent.full_acceleration(&mut self.vdot);
        let mut q = self.positions.q().to_vec();
        if !self.tangent.renew(t, &mut q, &self.v, why)? {
            return Ok(false);
        }
        self.positions.rewrite(&mut self.tangent, &q, y);
        self.tangent.select(&self.v, &mut y[p..w]);
        self.tangent.select(&self.vdot, &mut dy[p..w]); // S δ = 0
        self.tangent.reduction().at.v.copy_from_slice(&self.v);
        self.positions.rates(&mut self.tangent, &y[p..w], dy);
        Ok(true)
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
    fn step_margins(&self) -> [f64; 2] {
        self.margins().map(|margin| margin.unwrap_or(f64::NAN))
    }
    fn replay(&mut self, choice: Option<&ChoiceSnapshot>, margins: [f64; 2]) {
        if let Some(choice) = choice {
            self.tangent.restore(choice);
        }
        self.replay_between(margins);
    }
}
