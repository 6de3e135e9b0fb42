//! The compact form F1: the k independent velocities by P3 and all coordinates by S2, with the projective criterion
//! and exchanges between steps.
//!
//! No equation for q_D is solved inside a step: along solutions Φ is a first integral, and `C v + a = 0` holds to
//! round-off because v is computed, not integrated. After a step the remainder of S3 is removed. A change of
//! independent coordinates costs nothing: it is the identity on (q, v).
//! (Blajer, Schiehlen, Schirm 1994, with the collective choice P5 and the exchange rule P6.)

use super::chooser::{Change, Chooser};
use super::instant::Describer;
use super::reduction::Reduction;
use super::{dead_point, turns, Correction, Formulation, FormulationCounters, Output, PartitionEvent, Review, Sample};
use crate::kinematics::correction::close_with;
use crate::kinematics::projection::correct_orthogonally;
use crate::partition::exchange::Exchange;
use crate::partition::Selection;
use crate::system::{ConstrainedSystem, SystemError};

/// Inside a step the gain of an exchange may grow up to this before the step is repeated.
const HARD_LIMIT: f64 = 8.0;
/// Where a singular position is expected, the distance must be below this part of what it is now: a little beside it the
/// distance is small already, and a guess that is off by more than this is none.
const CONFIRMED: f64 = 0.3;
/// Steps after which the scales are looked at again: they are only scales.
const SCALE_PERIOD: u32 = 8;

/// How to choose and to correct.
#[derive(Clone, Debug)]
pub struct ProjectiveOptions {
    /// Exchange when one gains more than this (hysteresis); infinite: never.
    pub exchange: f64,
    /// Removal of the remainder of S3.
    pub correction: Correction,
    /// The user's own independent velocities, kept through the run.
    pub fixed: Option<Vec<usize>>,
    /// Preferences that multiply ρ.
    pub weights: Option<Vec<f64>>,
    /// Rule that chooses the independent velocities.
    pub selection: Selection,
    /// Length of the persistence window (s).
    pub window: Option<f64>,
}

impl Default for ProjectiveOptions {
    fn default() -> Self {
        Self {
            exchange: 1.25,
            correction: Correction::Partition,
            fixed: None,
            weights: None,
            selection: Selection::Collective,
            window: None,
        }
    }
}

/// The compact k + nq form with the projective criterion.
pub struct Projective<'s, S: ConstrainedSystem> {
    r: Reduction<'s, S>,
    describer: Describer<'s, S>,
    options: ProjectiveOptions,
    observes_work: bool,
    events: Vec<PartitionEvent>,
    counters: FormulationCounters,
    pending: bool,
    /// The rule at work, where it is not the collective one.
    chooser: Option<Chooser>,
    rejects_in_a_row: u32,
    steps_since_scales: u32,
    close_stages: bool,
    stage: Vec<f64>,
    q: Vec<f64>,
    vdot: Vec<f64>,
    lambda: Vec<f64>,
    weighted: Vec<f64>,
}

impl<'s, S: ConstrainedSystem> Projective<'s, S> {
    /// For a system of the given rank (see [`crate::start::analyse`]).
    pub fn new(system: &'s S, rank: usize, options: ProjectiveOptions) -> Self {
        let size = system.size();
        Self {
            // the other rules look at D and M_d in full
            r: match options.selection {
                Selection::Collective => Reduction::new(system, rank),
                _ => Reduction::dense(system, rank),
            },
            describer: Describer::new(system, rank),
            observes_work: system.has_power() || system.rheonomic(),
            options,
            events: Vec::new(),
            counters: FormulationCounters::default(),
            pending: false,
            chooser: None,
            rejects_in_a_row: 0,
            steps_since_scales: 0,
            close_stages: false,
            stage: vec![0.0; size.nq],
            q: vec![0.0; size.nq],
            vdot: vec![0.0; size.nv],
            lambda: vec![0.0; size.rows],
            weighted: vec![1.0; size.nv],
        }
    }

    /// The reduction, at the point last evaluated.
    pub fn reduction(&mut self) -> &mut Reduction<'s, S> {
        &mut self.r
    }

    fn nq(&self) -> usize {
        self.r.size().nq
    }

    /// dE/dt that is not the work of conservative forces: applied power and, for driven constraints, −λᵀa.
    fn power(&mut self, t: f64, q: &[f64]) -> Result<f64, SystemError> {
        let mut p = self.r.system.power(t, q, &self.r.v, &mut self.r.scratch)?;
        if self.r.system.rheonomic() {
            self.r.full_acceleration(&mut self.vdot);
            self.r.multipliers(t, q, &self.vdot, &mut self.lambda)?;
            p -= partita_math::dense::dot(&self.lambda, &self.r.a);
        }
        Ok(p)
    }

    fn log(&mut self, t: f64, before: &[usize], reason: String) -> Result<(), SystemError> {
        let q = std::mem::take(&mut self.q);
        // M_d of the new choice, at the same (q, v)
        let levels = self.r.velocity(t, &q).and_then(|()| self.r.acceleration(t, &q));
        let quality = levels.and_then(|()| self.r.quality(t, &q));
        self.q = q;
        let p = &self.r.partition;
        self.events.push(PartitionEvent::new(t, before, &p.independent, &p.dependent, reason, quality?));
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
    fn exchange(&mut self, t: f64, pairs: &[Exchange], why: impl Fn(&Exchange) -> String) -> Result<(), SystemError> {
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
        if let Err(e) = self.r.set_partition(t, &next) {
            // the exchange rule and the elimination disagree by round-off near a singular position: stay as we were
            self.r.set_partition(t, &before)?;
            let _ = e;
            return Ok(());
        }
        self.counters.exchanges += pairs.len() as u64;
        self.r.tangent(t)?;
        self.log(t, &before, reasons.join("; "))
    }

    /// Take the choice of the rule at the point last evaluated.
    fn obey(&mut self, t: f64, change: &Change) -> Result<(), SystemError> {
        let before = self.r.partition.independent.clone();
        let Some(chooser) = &mut self.chooser else { return Ok(()) };
        chooser.change(&mut self.r, t, change)?;
        let name = |of: &[usize], without: &[usize]| -> Vec<String> {
            of.iter().filter(|i| !without.contains(i)).map(|&i| self.r.system.velocity_name(i)).collect()
        };
        let (enter, leave) = (name(&change.independent, &before), name(&before, &change.independent));
        self.counters.exchanges += enter.len() as u64;
        let verb = if enter.len() == 1 { "takes" } else { "take" };
        let reason = format!("{} {verb} the place of {}: {}", enter.join(", "), leave.join(", "), change.reason);
        self.log(t, &before, reason)
    }

    /// Is a choice that stays, or that of a rule, to blame for a singular C_D?
    pub(super) fn blame(&self, t: f64, q: &[f64], e: SystemError) -> SystemError {
        let stays = self.options.fixed.is_some() || !self.options.exchange.is_finite();
        match &self.chooser {
            Some(chooser) => chooser.blame(&self.r, t, q, e),
            None if stays => dead_point::blame(&self.r, t, q, e),
            None => e,
        }
    }

    /// The derivative at the closed position next to y, reached by moving the dependent coordinates.
    fn closed_derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError> {
        let (nq, k) = (self.nq(), self.r.k());
        let mut q = std::mem::take(&mut self.stage);
        q.copy_from_slice(&y[..nq]);
        let done = self.evaluate_closed(t, &mut q, &y[nq..nq + k]);
        if done.is_ok() {
            self.r.system.rate(&q, &self.r.v, &mut dy[..nq]);
            dy[nq..nq + k].copy_from_slice(&self.r.vdot_independent);
            if self.observes_work {
                dy[nq + k] = self.power(t, &q)?;
            }
        }
        self.stage = q;
        done
    }

    fn evaluate_closed(&mut self, t: f64, q: &mut [f64], speeds: &[f64]) -> Result<(), SystemError> {
        for _ in 0..3 {
            self.r.position(t, q)?;
            if self.r.is_closed() {
                break;
            }
            self.r.factor(t)?;
            if !self.r.correct_dependent(q) {
                break;
            }
        }
        self.r.evaluate(t, q, speeds)
    }

    fn all_holonomic(&self) -> bool {
        let s = self.r.size();
        s.rows == s.holonomic
    }

    /// One correction of q by the chosen rule at the position level of q; true if q moved.
    fn correct_once(&mut self, t: f64, q: &mut [f64], rule: Correction) -> Result<bool, SystemError> {
        if rule == Correction::MassOrthogonal || !self.all_holonomic() {
            correct_orthogonally(&mut self.r, t, q)?;
            return Ok(true);
        }
        self.r.factor(t)?;
        Ok(self.r.correct_dependent(q))
    }
}

impl<S: ConstrainedSystem> Formulation for Projective<'_, S> {
    fn name(&self) -> &'static str {
        if self.options.exchange.is_finite() {
            "projective"
        } else {
            "fixed"
        }
    }

    fn dim(&self) -> usize {
        self.controlled() + usize::from(self.observes_work)
    }

    fn controlled(&self) -> usize {
        self.nq() + self.r.k()
    }

    fn natural_sizes(&self, out: &mut [f64]) {
        out.fill(1.0);
        let (coordinates, rates) = out.split_at_mut(self.nq());
        super::sizes_of_coordinates(self.r.system, coordinates);
        rates.iter_mut().zip(&self.r.partition.independent).for_each(|(x, &i)| *x = self.r.system.reach(i));
    }

    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<(), SystemError> {
        let o = &self.options;
        let mut chooser = Chooser::new(o.selection, o.exchange, o.weights.as_deref(), o.window)?;
        let reason = chooser.start(&mut self.r, t, q, o.fixed.as_deref())?;
        self.chooser = (o.selection != Selection::Collective).then_some(chooser);
        let nq = self.nq();
        y.fill(0.0);
        y[..nq].copy_from_slice(q);
        for (j, &i) in self.r.partition.independent.iter().enumerate() {
            y[nq + j] = v[i];
        }
        self.refresh_weighted();
        self.q.copy_from_slice(q);
        let speeds: Vec<f64> = y[nq..nq + self.r.k()].to_vec();
        self.r.evaluate(t, q, &speeds)?;
        self.log(t, &[], reason)
    }

    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError> {
        let (nq, k) = (self.nq(), self.r.k());
        let (q, rest) = y.split_at(nq);
        if self.close_stages && self.all_holonomic() && self.r.rank() > 0 {
            return self.closed_derivative(t, y, dy);
        }
        if let Err(e) = self.r.evaluate(t, q, &rest[..k]) {
            return Err(self.blame(t, q, e));
        }
        self.r.system.rate(q, &self.r.v, &mut dy[..nq]);
        dy[nq..nq + k].copy_from_slice(&self.r.vdot_independent);
        if self.observes_work {
            dy[nq + k] = self.power(t, q)?;
        }
        Ok(())
    }

    fn correct(&mut self, t: f64, y: &mut [f64]) -> Result<bool, SystemError> {
        let nq = self.nq();
        let q = &mut y[..nq];
        let moved = self.r.system.normalise(q);
        if self.options.correction == Correction::None || self.r.size().holonomic == 0 {
            return Ok(moved);
        }
        self.r.position(t, q)?;
        if self.r.is_closed() {
            return Ok(moved);
        }
        let rule = self.options.correction;
        if self.correct_once(t, q, rule)? {
            self.counters.corrections += 1;
            return Ok(true);
        }
        Ok(moved)
    }

    fn review(&mut self, t: f64, y: &[f64]) -> Review {
        self.pending = false;
        if self.r.k() > 0 && self.r.rows_fade() {
            // of redundant rows others serve better; should none be found, the next evaluation tells
            let _ = self.r.renew_rows(t);
        }
        if self.options.fixed.is_some() || self.r.rank() == 0 || self.r.k() == 0 {
            return Review::Keep;
        }
        self.steps_since_scales += 1;
        if self.steps_since_scales >= SCALE_PERIOD {
            self.steps_since_scales = 0;
            let nq = self.nq();
            // a failure here would be met by the next evaluation too, which reports it; the old scales serve till then
            if self.r.refresh_scales(t, &y[..nq]).is_ok() {
                self.refresh_weighted();
            }
        }
        if let Some(chooser) = &mut self.chooser {
            chooser.record(&self.r, t);
            // what fails here fails again in `change`, which can tell
            self.pending = !matches!(chooser.propose(&self.r, t), Ok(None));
            return if self.pending { Review::Change } else { Review::Keep };
        }
        let best = self.best_exchanges(self.options.exchange);
        if best.is_empty() {
            self.rejects_in_a_row = 0;
            return Review::Keep;
        }
        if best.iter().any(|x| x.gain > HARD_LIMIT) && self.options.exchange.is_finite() && self.rejects_in_a_row < 3 {
            self.rejects_in_a_row += 1;
            return Review::Reject;
        }
        self.rejects_in_a_row = 0;
        self.pending = true;
        Review::Change
    }

    fn confirms_passage(&mut self, t: f64, y: &[f64], ahead: f64) -> bool {
        let (nq, k) = (self.nq(), self.r.k());
        if self.r.evaluate(t, &y[..nq], &y[nq..nq + k]).is_err() {
            return true;
        }
        let (here, _) = self.r.distance();
        self.r.full_acceleration(&mut self.vdot);
        let moved: Vec<f64> = self.r.v.iter().zip(&self.vdot).map(|(v, a)| ahead * (v + 0.5 * ahead * a)).collect();
        let mut q = y[..nq].to_vec();
        self.r.system.step(&mut q, &moved);
        let found = self.r.position(t + ahead, &q).and_then(|()| self.r.tangent(t + ahead));
        // a plan made there was made for a place that the step keeps away from; one for here follows with the next evaluation
        found.is_err() || self.r.distance().0 < CONFIRMED * here
    }

    fn wrap(&mut self, y: &mut [f64], turns: &mut [i32]) -> bool {
        let nq = self.nq();
        turns::reduce(self.r.system, &mut y[..nq], turns)
    }

    fn close_stages(&mut self, on: bool) {
        self.close_stages = on;
    }

    fn distance(&mut self) -> Option<(f64, u64)> {
        (self.r.rank() > 0).then(|| self.r.distance())
    }

    fn change(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        let (nq, k) = (self.nq(), self.r.k());
        if !std::mem::take(&mut self.pending) {
            return Ok(());
        }
        // outputs may have been evaluated since: come back to the end of the step
        let speeds: Vec<f64> = y[nq..nq + k].to_vec();
        self.r.evaluate(t, &y[..nq], &speeds)?;
        self.q.copy_from_slice(&y[..nq]);
        let (v, mut vdot) = (self.r.v.clone(), std::mem::take(&mut self.vdot));
        self.r.full_acceleration(&mut vdot);
        // what looked better by scales of some steps ago need not be
        self.r.refresh_scales(t, &y[..nq])?;
        self.refresh_weighted();
        for _ in 0..4 * k {
            if let Some(chooser) = &mut self.chooser {
                let Some(change) = chooser.propose(&self.r, t)? else { break };
                self.obey(t, &change)?;
                // the rule looks at M_d of the new choice
                let speeds: Vec<f64> = self.r.partition.independent.iter().map(|&i| v[i]).collect();
                self.r.evaluate(t, &y[..nq], &speeds)?;
                continue;
            }
            let pairs = self.best_exchanges(self.options.exchange);
            if pairs.is_empty() {
                break;
            }
            self.exchange(t, &pairs, |x| format!("the volume of the choice grows by {:.3}", x.gain))?;
        }
        for (j, &i) in self.r.partition.independent.iter().enumerate() {
            y[nq + j] = v[i];
            dy[nq + j] = vdot[i];
        }
        self.vdot = vdot;
        Ok(())
    }

    fn recover(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        let (nq, k) = (self.nq(), self.r.k());
        let speeds: Vec<f64> = y[nq..nq + k].to_vec();
        self.r.evaluate(t, &y[..nq], &speeds)?;
        self.q.copy_from_slice(&y[..nq]);
        let v = self.r.v.clone();
        self.r.refresh_scales(t, &y[..nq])?;
        self.refresh_weighted();
        let pairs = self.best_exchanges(1.0 + 1e-6);
        {
            if !pairs.is_empty() {
                self.exchange(t, &pairs, |_| "the old choice went bad inside the step, which is repeated".into())?;
                for (j, &i) in self.r.partition.independent.iter().enumerate() {
                    y[nq + j] = v[i];
                }
            }
        }
        self.derivative(t, y, dy)
    }

    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<(), SystemError> {
        let (nq, k) = (self.nq(), self.r.k());
        let mut q = std::mem::take(&mut out.q);
        q.clear();
        q.extend_from_slice(&y[..nq]);
        self.r.system.normalise(&mut q);
        if self.options.correction != Correction::None && self.r.size().holonomic > 0 {
            let rule = self.options.correction;
            let open = |x: &mut Self, q: &[f64]| {
                x.r.position(t, q)?;
                Ok((!x.r.is_closed()).then(|| x.r.closure()))
            };
            // what cannot be removed here, next to a singular position, stays
            close_with(self, &mut q, open, |x, q| Ok(matches!(x.correct_once(t, q, rule), Ok(true))))?;
        }
        self.r.position(t, &q)?;
        self.r.tangent(t)?;
        self.r.spread(&y[nq..nq + k]);
        out.set(t, &q, &self.r.v, if self.observes_work { y[nq + k] } else { 0.0 });
        Ok(())
    }

    fn describe(
        &mut self,
        t: f64,
        q: &[f64],
        v: &[f64],
        within: Option<&PartitionEvent>,
        out: &mut Sample,
    ) -> Result<(), SystemError> {
        let independent = match within {
            Some(event) => &event.independent,
            None => &self.r.partition.independent,
        };
        self.describer.describe(t, q, v, Some(independent), out).map(|_| ())
    }

    fn events(&self) -> &[PartitionEvent] {
        &self.events
    }

    fn counters(&self) -> FormulationCounters {
        FormulationCounters { factorisations: self.r.factorisations, plans: self.r.plans, ..self.counters }
    }

    fn rows(&self) -> Vec<usize> {
        let mut rows = self.r.partition.rows.clone();
        rows.sort_unstable();
        rows
    }

    fn notes(&self) -> Vec<String> {
        self.chooser.as_ref().map(Chooser::notes).unwrap_or_default()
    }
}
