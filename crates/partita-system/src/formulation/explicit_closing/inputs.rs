//! The choice of inputs: how good it is, and whether others would be better.

use super::super::reduction::quality_of;
use super::super::PartitionEvent;
use super::{ExplicitClosing, PERIOD};
use crate::partition::{criterion, exchange};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense;

impl<S: ConstrainedSystem> ExplicitClosing<'_, S> {
    pub(super) fn quality(&mut self, t: f64) -> Result<criterion::Quality, SystemError> {
        let inputs = self.inputs().to_vec();
        quality_of(self.system, t, &self.q, &inputs, &self.md, &mut self.scratch)
    }

    /// Largest gain that a dependent velocity in the place of an input promises.            (P6)
    pub(super) fn best_gain(&mut self) -> f64 {
        let k = self.k;
        let Some(loops) = &self.loops else { return 0.0 };
        for (p, &i) in loops.unknown.iter().enumerate() {
            self.gains[p * k..(p + 1) * k].copy_from_slice(&self.dt[i * k..(i + 1) * k]);
        }
        exchange::best(&self.gains, &self.s, &loops.unknown, loops.closing.inputs()).map_or(0.0, |x| x.gain)
    }

    /// By how much the volume of the choice grows with other inputs: `|det D_I'| Π s_I / Π s_I'`.      (31)
    pub(super) fn growth(&self, inputs: &[usize]) -> f64 {
        let k = self.k;
        if inputs.len() != k {
            return 0.0;
        }
        let mut block: Vec<f64> = inputs.iter().flat_map(|&i| self.dt[i * k..(i + 1) * k].iter().copied()).collect();
        let mut pivots = vec![0; k];
        if dense::lu(&mut block, k, &mut pivots).is_err() {
            return 0.0;
        }
        let scales = self.inputs().iter().zip(inputs).map(|(&old, &new)| self.s[old] / self.s[new]);
        scales.fold(dense::lu_determinant(&block, k, &pivots).abs(), |x, s| x * s)
    }

    /// Ask the system for other inputs, now and then or when matters got worse; keeps them in `self.next`.
    pub(super) fn better_inputs(&mut self, t: f64, gain: f64) -> bool {
        self.patience = self.patience.saturating_sub(1);
        if self.patience > 0 && gain < 2.0 * self.asked_at {
            return false;
        }
        (self.patience, self.asked_at) = (PERIOD, gain);
        // a system that knows no closing here keeps the one in use, which reports its own limits
        let Ok(next) = self.system.closing(t, &self.q, None) else { return false };
        if next.inputs() == self.inputs() {
            return false;
        }
        // what looks better by scales of some steps ago need not be; a failure here would be met by the next evaluation
        if self.refresh_scales(t).is_err() || self.growth(next.inputs()) <= self.exchange {
            return false;
        }
        self.next = Some(next);
        true
    }

    pub(super) fn log(&mut self, t: f64, before: &[usize], reason: String) -> Result<(), SystemError> {
        let quality = self.quality(t)?;
        let unknown: &[usize] = self.loops.as_ref().map_or(&[], |l| &l.unknown);
        let event = PartitionEvent::new(t, before, self.inputs(), unknown, reason, quality);
        self.events.push(event);
        Ok(())
    }
}
