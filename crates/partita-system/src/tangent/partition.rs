//! The partition as a tangent: independent velocities chosen by a rule, exchanged between steps.
//!
//! A change of independent coordinates costs nothing: it is the identity on (q, v).
//! (Blajer, Schiehlen, Schirm 1994, with the collective choice P5 and the exchange rule P6.)

use super::chooser::{Change, Chooser};
use super::{counted, kept_rows, Occasion, Tangent};
use crate::kinematics::projection::correct_orthogonally;
use crate::options::FormulationOptions;
use crate::partition::exchange::Exchange;
use crate::partition::Selection;
use crate::record::Verdict;
use crate::record::{Correction, FormulationCounters, Journal, PartitionEvent};
use crate::reduction::Reduction;
use crate::singular::dead_point;
use crate::system::{ConstrainedSystem, SystemError};

/// Inside a step the gain of an exchange may grow up to this before the step is repeated.
const HARD_LIMIT: f64 = 8.0;
/// Steps after which the scales are looked at again: they are only scales.
const SCALE_PERIOD: u32 = 8;

/// Independent velocities, chosen and exchanged by a rule.
pub struct Chosen<'s, S: ConstrainedSystem> {
    r: Reduction<'s, S>,
    options: FormulationOptions,
    /// The rule at work, where it is not the collective one.
    chooser: Option<Chooser>,
    weighted: Vec<f64>,
    events: Vec<PartitionEvent>,
    exchanges: u64,
    rejects_in_a_row: u32,
    steps_since_scales: u32,
    /// Of redundant rows, do others serve better?
    fading: bool,
}

impl<'s, S: ConstrainedSystem> Chosen<'s, S> {
    /// For a system of the given rank (see [`crate::start::analyse`]). Of the options it reads `independent`, `exchange`,
    /// `weights`, `selection` and `window`.
    pub fn new(system: &'s S, rank: usize, options: &FormulationOptions) -> Self {
        Self {
            // the other rules look at D and M_d in full
            r: match options.selection {
                Selection::Collective => Reduction::new(system, rank),
                _ => Reduction::dense(system, rank),
            },
            options: options.clone(),
            chooser: None,
            weighted: vec![1.0; system.size().nv],
            events: Vec::new(),
            exchanges: 0,
            rejects_in_a_row: 0,
            steps_since_scales: 0,
            fading: false,
        }
    }

    fn log(&mut self, t: f64, q: &[f64], before: &[usize], reason: String) -> Result<(), SystemError> {
        // M_d of the new choice, at the same (q, v)
        self.r.velocity(t, q)?;
        self.r.acceleration(t, q)?;
        let quality = self.r.quality(t, q)?;
        let p = &self.r.partition;
        self.events.push(PartitionEvent::new(t, before, &p.independent, &p.dependent, reason, quality));
        Ok(())
    }

    /// Scales of the choice: s_i divided by the user's preference.
    fn refresh_weighted(&mut self) {
        let s = self.r.scales();
        match &self.options.weights {
            Some(w) => self.weighted.iter_mut().zip(s.iter().zip(w)).for_each(|(x, (s, w))| *x = s / w),
            None => self.weighted.copy_from_slice(s),
        }
    }

    /// The best exchanges, one a cluster, that gain more than this.
    fn best_exchanges(&mut self, threshold: f64) -> Vec<Exchange> {
        self.r.best_exchanges(&self.weighted, threshold)
    }

    /// Swap one pair in each of some clusters at the point last evaluated; the position level must be that of `t`.
    fn exchange(
        &mut self,
        t: f64,
        q: &[f64],
        pairs: &[Exchange],
        why: impl Fn(&Exchange) -> String,
    ) -> Result<(), SystemError> {
        let before = self.r.partition.independent.clone();
        let name = |i: usize| self.r.system.velocity_name(i);
        let mut next = before.clone();
        let mut reasons = Vec::new();
        for x in pairs {
            let (enters, leaves) = (self.r.partition.dependent[x.enters], before[x.leaves]);
            next[x.leaves] = enters;
            reasons.push(format!("{} takes the place of {}: {}", name(enters), name(leaves), why(x)));
        }
        next.sort_unstable();
        if self.r.set_partition(t, &next).is_err() {
            // the exchange rule and the elimination disagree by round-off near a singular position: stay as we were
            return self.r.set_partition(t, &before);
        }
        self.exchanges += pairs.len() as u64;
        self.r.tangent(t)?;
        self.log(t, q, &before, reasons.join("; "))
    }

    /// Take the choice of the rule at the point last evaluated.
    fn obey(&mut self, t: f64, q: &[f64], change: &Change) -> Result<(), SystemError> {
        let before = self.r.partition.independent.clone();
        let Some(chooser) = &mut self.chooser else { return Ok(()) };
        chooser.change(&mut self.r, t, change)?;
        let name = |of: &[usize], without: &[usize]| -> Vec<String> {
            of.iter().filter(|i| !without.contains(i)).map(|&i| self.r.system.velocity_name(i)).collect()
        };
        let (enter, leave) = (name(&change.independent, &before), name(&before, &change.independent));
        self.exchanges += enter.len() as u64;
        let verb = if enter.len() == 1 { "takes" } else { "take" };
        let reason = format!("{} {verb} the place of {}: {}", enter.join(", "), leave.join(", "), change.reason);
        self.log(t, q, &before, reason)
    }

    /// Exchange, or ask the rule, until nothing gains any more.
    fn choose_anew(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<(), SystemError> {
        for _ in 0..4 * self.r.k() {
            if let Some(chooser) = &mut self.chooser {
                let Some(change) = chooser.propose(&self.r, t)? else { break };
                self.obey(t, q, &change)?;
                // the rule looks at M_d of the new choice
                let speeds: Vec<f64> = self.r.partition.independent.iter().map(|&i| v[i]).collect();
                self.r.evaluate(t, q, &speeds)?;
                continue;
            }
            let pairs = self.best_exchanges(self.options.exchange);
            if pairs.is_empty() {
                break;
            }
            self.exchange(t, q, &pairs, |x| format!("the volume of the choice grows by {:.3}", x.gain))?;
        }
        Ok(())
    }

    /// Does the choice stay as it is?
    fn stays(&self) -> bool {
        self.options.independent.is_some() || self.r.rank() == 0 || self.r.k() == 0
    }
}

impl<'s, S: ConstrainedSystem> Tangent<'s, S> for Chosen<'s, S> {
    fn reduction(&mut self) -> &mut Reduction<'s, S> {
        &mut self.r
    }
    fn seen(&self) -> &Reduction<'s, S> {
        &self.r
    }
    fn start(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<(), SystemError> {
        let o = &self.options;
        let mut chooser = Chooser::new(o.selection, o.exchange, o.weights.as_deref(), o.window)?;
        let reason = chooser.start(&mut self.r, t, q, o.independent.as_deref())?;
        self.chooser = (o.selection != Selection::Collective).then_some(chooser);
        self.refresh_weighted();
        let speeds: Vec<f64> = self.r.partition.independent.iter().map(|&i| v[i]).collect();
        self.r.evaluate(t, q, &speeds)?;
        self.log(t, q, &[], reason)
    }
    fn resume(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<(), SystemError> {
        self.start(t, q, v)?;
        if let Some(event) = self.events.last_mut() {
            event.reason = "gone back to this time, to cross a singular position from farther away".into();
        }
        Ok(())
    }
    fn select(&mut self, v: &[f64], u: &mut [f64]) -> Result<(), SystemError> {
        u.iter_mut().zip(&self.r.partition.independent).for_each(|(u, &i)| *u = v[i]);
        Ok(())
    }
    fn tangent(&mut self, t: f64, _q: &[f64], _factored: bool) -> Result<(), SystemError> {
        self.r.tangent(t)
    }
    fn spread(&mut self, u: &[f64]) {
        self.r.spread(u);
    }
    fn accelerate(&mut self, t: f64, q: &[f64], _u: &[f64]) -> Result<(), SystemError> {
        self.r.velocity(t, q)?;
        self.r.acceleration(t, q)
    }
    fn rates(&self, du: &mut [f64]) {
        du.copy_from_slice(&self.r.vdot_independent);
    }
    fn full_acceleration(&self, out: &mut [f64]) {
        self.r.full_acceleration(out);
    }
    fn offset(&self) -> &[f64] {
        &self.r.gamma
    }
    fn correct(&mut self, t: f64, q: &mut [f64], rule: Correction) -> Result<bool, SystemError> {
        let size = self.r.size();
        if rule == Correction::MassOrthogonal || size.rows != size.holonomic {
            correct_orthogonally(&mut self.r, t, q)?;
            return Ok(true);
        }
        self.r.factor(t)?;
        Ok(self.r.correct_dependent(q))
    }
    fn judge(&mut self, t: f64, _q: &[f64]) -> Verdict {
        self.fading = self.r.k() > 0 && self.r.rows_fade();
        if self.stays() {
            return Verdict::Keep;
        }
        if let Some(chooser) = &mut self.chooser {
            chooser.record(&self.r, t); // a step that is repeated replaces what it left
                                        // what fails here fails again in `renew`, which can tell
            return if matches!(chooser.propose(&self.r, t), Ok(None)) { Verdict::Keep } else { Verdict::Change };
        }
        let best = self.best_exchanges(self.options.exchange);
        if best.is_empty() {
            self.rejects_in_a_row = 0;
            return Verdict::Keep;
        }
        if best.iter().any(|x| x.gain > HARD_LIMIT) && self.options.exchange.is_finite() && self.rejects_in_a_row < 3 {
            self.rejects_in_a_row += 1;
            return Verdict::Repeat;
        }
        self.rejects_in_a_row = 0;
        Verdict::Change
    }
    fn attends(&self) -> bool {
        self.fading || (!self.stays() && self.steps_since_scales + 1 >= SCALE_PERIOD)
    }
    fn accept(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        if std::mem::take(&mut self.fading) {
            // should no better rows be found, the next evaluation tells
            let _ = self.r.renew_rows(t);
        }
        if self.stays() {
            return Ok(());
        }
        self.steps_since_scales += 1;
        if self.steps_since_scales >= SCALE_PERIOD {
            self.steps_since_scales = 0;
            // a failure here would be met by the next evaluation too, which reports it; the old scales serve till then
            if self.r.refresh_scales(t, q).is_ok() {
                self.refresh_weighted();
            }
        }
        Ok(())
    }
    fn renew(&mut self, t: f64, q: &mut [f64], v: &[f64], why: Occasion) -> Result<bool, SystemError> {
        // what looked better by scales of some steps ago need not be
        self.r.refresh_scales(t, q)?;
        self.refresh_weighted();
        let before = self.exchanges;
        if why == Occasion::Decayed {
            self.choose_anew(t, q, v)?;
        } else {
            let pairs = self.best_exchanges(1.0 + 1e-6);
            if !pairs.is_empty() {
                self.exchange(t, q, &pairs, |_| "the old choice went bad inside the step, which is repeated".into())?;
            }
        }
        Ok(self.exchanges > before)
    }
    fn margin(&mut self) -> Option<(f64, u64)> {
        (self.r.rank() > 0).then(|| self.r.distance())
    }
    fn gain(&mut self) -> f64 {
        self.r.best_exchange().map_or(0.0, |x| x.gain)
    }
    fn blame(&self, t: f64, q: &[f64], e: SystemError) -> SystemError {
        let stays = self.options.independent.is_some() || !self.options.exchange.is_finite();
        match &self.chooser {
            Some(chooser) => chooser.blame(&self.r, t, q, e),
            None if stays => dead_point::blame(&self.r, t, q, e),
            None => e,
        }
    }
    fn independent<'a>(&'a self, within: Option<&'a PartitionEvent>) -> Option<&'a [usize]> {
        Some(within.map_or(&self.r.partition.independent, |event| &event.independent))
    }
    fn events(&self) -> &[PartitionEvent] {
        &self.events
    }
    fn report(&self, journal: &mut Journal) {
        journal.counters = FormulationCounters { exchanges: self.exchanges, ..counted(&self.r) };
        journal.rows = kept_rows(&self.r);
        journal.notes.extend(self.chooser.iter().flat_map(Chooser::notes));
    }
}
