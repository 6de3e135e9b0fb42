//! The partition as a tangent: independent velocities chosen by a rule, switched between steps.
//!
//! A change of independent coordinates costs nothing: it is the identity on (q, v).
//! (Blajer, Schiehlen, Schirm 1994, with the collective choice P5 and the switch rule P6.)

use super::base::PERIOD;
use super::chooser::{Change, Chooser};
use super::{Base, Occasion, TangentChoice, TangentClosing, TangentLevels, TangentReplay};
use crate::error::Result;
use crate::manifold::orthogonal::orthogonal_step;
use crate::options::FormulationOptions;
use crate::partition::switch::CoordinateSwitch;
use crate::partition::Selection;
use crate::record::{Correction, History, PartitionEvent, StepDecision};
use crate::reduction::{Reduction, Sides};
use crate::singular::dead_point;
use crate::system::{ConstrainedSystem, SystemError, SystemRef};
use partita_math::tolerance;

/// Independent velocities, chosen and switched by a rule.
pub struct Chosen<'s, S: ConstrainedSystem> {
    base: Base<'s, S>,
    options: FormulationOptions,
    /// The rule at work, where it is not the collective one.
    chooser: Option<Chooser>,
    weighted: Vec<f64>,
    rejects_in_a_row: u32,
}

impl<'s, S: ConstrainedSystem> Chosen<'s, S> {
    /// For a system of the given rank (see [`crate::start::analyse`]). Of the options it reads `independent`,
    /// `switch_threshold`, `weights`, `selection` and `window`.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, options: &FormulationOptions) -> Self {
        let system = system.into();
        Self {
            weighted: vec![1.0; system.size().nv],
            // the other rules need D and M_d in full
            base: Base::new(match options.selection {
                Selection::Collective => Reduction::new(system, rank),
                _ => Reduction::dense(system, rank),
            }),
            options: options.clone(),
            chooser: None,
            rejects_in_a_row: 0,
        }
    }

    /// Scales of the choice: s_i divided by the user's preference.
    fn refresh_weighted(&mut self) {
        let s = self.base.r.scales();
        match &self.options.weights {
            Some(w) => self.weighted.iter_mut().zip(s.iter().zip(w)).for_each(|(x, (s, w))| *x = s / w),
            None => self.weighted.copy_from_slice(s),
        }
    }

    /// The best switches, one per cluster, with a gain above this.
    fn best_switches(&mut self, threshold: f64) -> Vec<CoordinateSwitch> {
        self.base.r.best_switches(&self.weighted, threshold)
    }

    /// Swap one pair in each of some clusters at the point last evaluated; the position level must be that of `t`.
    fn switch(
        &mut self,
        t: f64,
        q: &[f64],
        pairs: &[CoordinateSwitch],
        why: impl Fn(&CoordinateSwitch) -> String,
    ) -> Result<()> {
        let before = self.base.r.planned.partition.independent.clone();
        let velocities = &self.base.r.system.structure().velocities;
        let name = |i: usize| velocities[i].name.to_string();
        let mut next = before.clone();
        let mut reasons = Vec::new();
        for x in pairs {
            let (enters, leaves) = (self.base.r.planned.partition.dependent[x.enters], before[x.leaves]);
            next[x.leaves] = enters;
            reasons.push(format!("{} takes the place of {}: {}", name(enters), name(leaves), why(x)));
        }
        next.sort_unstable();
        if self.base.r.set_partition(t, &next).is_err() {
            // the switch rule and the elimination disagree by round-off near a singular position: keep the present
            // choice
            return self.base.r.set_partition(t, &before);
        }
        self.base.switches += pairs.len() as u64;
        self.base.r.tangent(t)?;
        self.base.log(t, q, &before, reasons.join("; "))
    }

    /// Take the choice of the rule at the point last evaluated.
    fn obey(&mut self, t: f64, q: &[f64], change: &Change) -> Result<()> {
        let before = self.base.r.planned.partition.independent.clone();
        let Some(chooser) = &mut self.chooser else { return Ok(()) };
        chooser.change(&mut self.base.r, t, change)?;
        let velocities = &self.base.r.system.structure().velocities;
        let name = |of: &[usize], without: &[usize]| -> Vec<String> {
            of.iter().filter(|i| !without.contains(i)).map(|&i| velocities[i].name.to_string()).collect()
        };
        let (enter, leave) = (name(&change.independent, &before), name(&before, &change.independent));
        self.base.switches += enter.len() as u64;
        let verb = if enter.len() == 1 { "takes" } else { "take" };
        let reason = format!("{} {verb} the place of {}: {}", enter.join(", "), leave.join(", "), change.reason);
        self.base.log(t, q, &before, reason)
    }

    /// Switch, or ask the rule, until there is no further gain.
    fn choose_anew(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<()> {
        for _ in 0..4 * self.base.r.k() {
            if let Some(chooser) = &mut self.chooser {
                let Some(change) = chooser.propose(&self.base.r, t)? else { break };
                self.obey(t, q, &change)?;
                // the rule needs M_d of the new choice
                self.base.evaluate(t, q, v)?;
                continue;
            }
            let pairs = self.best_switches(self.options.switch_threshold);
            if pairs.is_empty() {
                break;
            }
            self.switch(t, q, &pairs, |x| format!("the volume of the choice grows by {:.3}", x.gain))?;
        }
        Ok(())
    }

    /// Whether the choice is fixed.
    fn stays(&self) -> bool {
        self.options.independent.is_some() || self.base.is_rigid_or_free()
    }
}

impl<'s, S: ConstrainedSystem> TangentLevels<'s, S> for Chosen<'s, S> {
    fn base(&self) -> &Base<'s, S> {
        &self.base
    }
    fn base_mut(&mut self) -> &mut Base<'s, S> {
        &mut self.base
    }
}

impl<'s, S: ConstrainedSystem> TangentChoice<'s, S> for Chosen<'s, S> {
    fn start(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<()> {
        let o = &self.options;
        let mut chooser = Chooser::new(o.selection, o.switch_threshold, o.weights.as_deref(), o.window)?;
        let reason = chooser.start(&mut self.base.r, t, q, o.independent.as_deref())?;
        self.chooser = (o.selection != Selection::Collective).then_some(chooser);
        self.refresh_weighted();
        self.base.evaluate(t, q, v)?;
        self.base.log_evaluated(t, q, &[], reason)
    }
    fn resume(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<()> {
        self.start(t, q, v)?;
        if let Some(event) = self.base.choices.events.last_mut() {
            event.reason = "returned to this time to cross a singular position from farther away".into();
        }
        Ok(())
    }
    fn judge(&mut self, t: f64, _q: &[f64]) -> StepDecision {
        let r = &mut self.base.r;
        self.base.fading = r.rows_fade();
        if self.stays() {
            return StepDecision::Keep;
        }
        let r = &self.base.r;
        if let Some(chooser) = &mut self.chooser {
            chooser.record(r, t); // a step that is repeated replaces what it left
                                  // a failure here recurs in `renew`, which reports it
            return if matches!(chooser.propose(r, t), Ok(None)) { StepDecision::Keep } else { StepDecision::Change };
        }
        let best = self.best_switches(self.options.switch_threshold);
        let spoilt = best.iter().any(|x| x.gain > tolerance::CLEARLY) && self.options.switch_threshold.is_finite();
        if spoilt && self.rejects_in_a_row < 3 {
            self.rejects_in_a_row += 1;
            return StepDecision::Repeat;
        }
        self.rejects_in_a_row = 0;
        match best.is_empty() {
            true => StepDecision::Keep,
            false => StepDecision::Change,
        }
    }
    fn attends(&self) -> bool {
        self.base.fading || (!self.stays() && self.base.steps_since_scales + 1 >= PERIOD)
    }
    fn accept(&mut self, t: f64, q: &[f64]) -> Result<()> {
        if self.base.accept(t, q, !self.stays()) {
            self.refresh_weighted();
        }
        Ok(())
    }
    fn renew(&mut self, t: f64, q: &mut [f64], v: &[f64], why: Occasion) -> Result<bool> {
        // a gain by scales of some steps ago may have vanished
        self.base.r.refresh_scales(t, q)?;
        self.refresh_weighted();
        let before = self.base.switches;
        if why == Occasion::Decayed {
            self.choose_anew(t, q, v)?;
        } else {
            let pairs = self.best_switches(1.0 + tolerance::TIE);
            if !pairs.is_empty() {
                self.switch(t, q, &pairs, |_| "the old choice became poor within the step, which is repeated".into())?;
            }
        }
        Ok(self.base.switches > before)
    }
    fn blame(&self, t: f64, q: &[f64], e: SystemError) -> SystemError {
        let stays = self.options.independent.is_some() || !self.options.switch_threshold.is_finite();
        match &self.chooser {
            Some(chooser) => chooser.blame(&self.base.r, t, q, e),
            None if stays => dead_point::blame(&self.base.r, t, q, e),
            None => e,
        }
    }
    fn independent<'a>(&'a self, within: Option<&'a PartitionEvent>) -> Option<&'a [usize]> {
        Some(within.map_or(&self.base.r.planned.partition.independent, |event| &event.independent))
    }
    fn report(&self, history: &mut History) {
        history.notes.extend(self.chooser.iter().flat_map(Chooser::notes));
    }
}

impl<'s, S: ConstrainedSystem> TangentReplay<'s, S> for Chosen<'s, S> {
    fn version(&self) -> Option<u64> {
        Some(self.base.r.version())
    }
}

impl<'s, S: ConstrainedSystem> TangentClosing<'s, S> for Chosen<'s, S> {
    fn correction(&mut self, t: f64, q: &[f64], rule: Correction, dv: &mut [f64]) -> Result<bool> {
        let (size, r) = (self.base.r.size(), &mut self.base.r);
        if rule == Correction::MassOrthogonal || size.rows != size.holonomic {
            dv.copy_from_slice(&orthogonal_step(r, t, q)?);
            return Ok(true);
        }
        if rule != Correction::Kantorovich {
            r.factor(t)?;
        }
        Ok(r.dependent_correction(dv))
    }
    fn sides(&self, sides: &mut Sides) {
        self.base.r.sides(sides);
    }
    fn choice_of_sides(&self) -> (u64, u64) {
        (self.base.r.choices(), 0)
    }
    fn margin(&mut self) -> Option<(f64, u64)> {
        (self.base.r.rank() > 0).then(|| self.base.r.distance())
    }
}
