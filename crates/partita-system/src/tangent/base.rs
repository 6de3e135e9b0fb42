//! Common part of all tangents: the levels of the system with their rows, and the choices so far.

use crate::error::Result;
use crate::record::{ChoiceLog, FormulationCounters, History, PartitionEvent};
use crate::reduction::{Reduction, ReductionSnapshot};
use crate::system::ConstrainedSystem;
use partita_math::dense::Matrix;
use std::mem::size_of;
use std::sync::Arc;

/// Number of steps after which the scales are refreshed: they are only scales.
pub(super) const PERIOD: u32 = 8;

/// A choice with which steps were taken.
#[derive(Clone, Debug)]
pub struct ChoiceSnapshot {
    /// Rows and coordinates.
    pub reduction: ReductionSnapshot,
    /// Where it is frozen: the basis S, S made orthonormal, and the factor between both.
    pub(super) basis: Option<(Arc<Matrix>, Vec<f64>, Vec<f64>)>,
}

impl ChoiceSnapshot {
    /// Memory that it takes, about.
    pub fn bytes(&self) -> usize {
        let of_basis = |(s, orthonormal, lower): &(Arc<Matrix>, Vec<f64>, Vec<f64>)| {
            size_of::<f64>() * (s.data().len() + orthonormal.len() + lower.len())
        };
        self.reduction.bytes() + self.basis.as_ref().map_or(0, of_basis)
    }
}

/// Levels, rows and choices of a tangent.
pub struct Base<'s, S: ConstrainedSystem> {
    /// The levels at the point last evaluated. D, γ, δ, M_d and u' of any tangent are stored here.
    pub r: Reduction<'s, S>,
    pub(super) choices: ChoiceLog,
    pub(super) switches: u64,
    /// Whether among redundant rows others serve better.
    pub(super) fading: bool,
    pub(super) steps_since_scales: u32,
}

impl<'s, S: ConstrainedSystem> Base<'s, S> {
    pub(super) fn new(r: Reduction<'s, S>) -> Self {
        Self { r, choices: ChoiceLog::default(), switches: 0, fading: false, steps_since_scales: 0 }
    }

    /// Choices so far.
    pub fn events(&self) -> &[PartitionEvent] {
        &self.choices.events
    }

    /// An output that is kept uses the present choice.
    pub fn keep_choice(&mut self) {
        self.choices.keep();
    }

    /// Whether nothing is chosen.
    pub(super) fn is_rigid_or_free(&self) -> bool {
        self.r.rank() == 0 || self.r.k() == 0
    }

    /// All levels at the closed (t, q) with velocities v.
    pub(super) fn evaluate(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<()> {
        let speeds: Vec<f64> = self.r.planned.partition.independent.iter().map(|&i| v[i]).collect();
        self.r.evaluate(t, q, &speeds)
    }

    /// Record the choice of independent velocities, at the tangent last evaluated.
    pub(super) fn log(&mut self, t: f64, q: &[f64], before: &[usize], reason: String) -> Result<()> {
        // M_d of the new choice, at the same (q, v)
        self.r.velocity(t, q)?;
        self.r.acceleration(t, q)?;
        self.log_evaluated(t, q, before, reason)
    }

    /// As `log`, at the point last evaluated.
    pub(super) fn log_evaluated(&mut self, t: f64, q: &[f64], before: &[usize], reason: String) -> Result<()> {
        let quality = self.r.quality(t, q)?;
        let p = &self.r.planned.partition;
        self.choices.record(PartitionEvent::new(t, before, &p.independent, &p.dependent, reason, quality));
        Ok(())
    }

    /// Whether among redundant rows others serve better than those kept. For tangents that do not factor C_D
    /// themselves.
    pub(super) fn look_at_factors(&mut self, t: f64) {
        let r = &mut self.r;
        self.fading = r.rank() < r.size().rows && (r.factor(t).is_err() || r.rows_fade());
    }

    /// At the end of an accepted step: other rows where those kept weaken, and, if `scaled`, occasionally fresh scales;
    /// true if they are.
    pub(super) fn accept(&mut self, t: f64, q: &[f64], scaled: bool) -> bool {
        if std::mem::take(&mut self.fading) {
            // if no better rows are found, the next evaluation reports it
            let _ = self.r.renew_rows(t);
        }
        self.steps_since_scales += u32::from(scaled);
        if self.steps_since_scales < PERIOD {
            return false;
        }
        self.steps_since_scales = 0;
        // a failure here also occurs in the next evaluation, which reports it; until then the old scales are kept
        self.r.refresh_scales(t, q).is_ok()
    }

    /// Names of velocities.
    pub(super) fn names(&self, velocities: &[usize]) -> String {
        self.r.system.structure().names(velocities)
    }

    /// Choices, rows and counts of a run.
    pub fn report(&self, history: &mut History) {
        let (factorisations, plans, switches) = (self.r.counts.factorisations, self.r.counts.plans, self.switches);
        let unlisted_switches = self.choices.unlisted_switches;
        let none = FormulationCounters::default();
        history.counters = FormulationCounters { factorisations, plans, switches, unlisted_switches, ..none };
        history.events.clone_from(&self.choices.events);
        if self.choices.unlisted > 0 {
            history.notes.push(format!(
                "{} of {} choices of coordinates are counted, but not listed: the first ones are, and those in use at \
                 outputs; ask for more outputs to see more",
                self.choices.unlisted,
                self.choices.unlisted + self.choices.events.len() as u64
            ));
        }
        history.rows.clone_from(&self.r.planned.partition.rows);
        history.rows.sort_unstable();
    }
}
