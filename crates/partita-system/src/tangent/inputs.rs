//! The choice of inputs: how good it is, and whether others would be better.

use super::blocks::{Blocks, PERIOD};
use crate::partition::exchange;
use crate::record::PartitionEvent;
use crate::reduction::quality_of;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense;

impl<S: ConstrainedSystem> Blocks<'_, S> {
    /// Largest gain that a dependent velocity in the place of an input promises.            (P6)
    pub(super) fn best_gain(&mut self) -> f64 {
        let k = self.r.k();
        let Some(loops) = &self.loops else { return 0.0 };
        for (p, &i) in loops.unknown.iter().enumerate() {
            self.gains[p * k..(p + 1) * k].copy_from_slice(&self.d.dt[i * k..(i + 1) * k]);
        }
        exchange::best(&self.gains, self.r.scales(), &loops.unknown, loops.closing.inputs()).map_or(0.0, |x| x.gain)
    }

    /// By how much the volume of the choice grows with other inputs: `|det D_I'| Π s_I / Π s_I'`.      (31)
    pub(super) fn growth(&self, inputs: &[usize]) -> f64 {
        let k = self.r.k();
        if inputs.len() != k {
            return 0.0;
        }
        let mut block: Vec<f64> = inputs.iter().flat_map(|&i| self.d.dt[i * k..(i + 1) * k].iter().copied()).collect();
        let mut pivots = vec![0; k];
        if dense::lu(&mut block, k, &mut pivots).is_err() {
            return 0.0;
        }
        let scales = self.inputs().iter().zip(inputs).map(|(&old, &new)| self.r.scales()[old] / self.r.scales()[new]);
        scales.fold(dense::lu_determinant(&block, k, &pivots).abs(), |x, s| x * s)
    }

    /// Ask the system for other inputs, now and then or when matters got worse; keeps them in `self.next`.
    pub(super) fn better_inputs(&mut self, t: f64, q: &[f64], gain: f64) -> bool {
        self.patience = self.patience.saturating_sub(1);
        if self.patience > 0 && gain < 2.0 * self.asked_at {
            return false;
        }
        (self.patience, self.asked_at) = (PERIOD, gain);
        // a system that knows no closing here keeps the one in use, which reports its own limits
        let Ok(next) = self.r.system.closing(t, q, None) else { return false };
        if next.inputs() == self.inputs() {
            return false;
        }
        // what looks better by scales of some steps ago need not be; a failure here would be met by the next evaluation
        if self.r.refresh_scales(t, q).is_err() || self.growth(next.inputs()) <= self.exchange {
            return false;
        }
        self.next = Some(next);
        true
    }

    pub(super) fn log(&mut self, t: f64, q: &[f64], before: &[usize], reason: String) -> Result<(), SystemError> {
        let inputs = self.inputs().to_vec();
        let quality = quality_of(self.r.system, t, q, &inputs, &self.d.md, &mut self.r.scratch)?;
        let unknown: &[usize] = self.loops.as_ref().map_or(&[], |l| &l.unknown);
        self.events.push(PartitionEvent::new(t, before, &inputs, unknown, reason, quality));
        Ok(())
    }
}
