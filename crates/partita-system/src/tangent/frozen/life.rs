//! The life of a frozen S: from its first choice over judging and renewing it to what the run tells about it.

use super::super::dense::best_partition;
use super::Frozen;
use crate::record::PartitionEvent;
use crate::record::Verdict;
use crate::start;
use crate::system::{ConstrainedSystem, SystemError};
use std::sync::Arc;

/// A basis whose quality fell to this part of its threshold within one step spoils the step, which is repeated.
const HARD_PART: f64 = 0.125;

impl<S: ConstrainedSystem> Frozen<'_, S> {
    /// Keep the rows of a good partition at `(t, q)` and freeze the first S there.
    pub fn begin(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        start::choose_partition(&mut self.r, t, q, None, None)?;
        self.freeze(t, q)?;
        let reason = format!(
            "tangent basis \"{}\" frozen: its velocities are integrated; named is the best choice of coordinates at this time",
            self.name()
        );
        self.log(t, q, reason)
    }

    /// Judge the frozen S at the end of a step; the last evaluation was there.
    ///
    /// S is to be renewed when √μ_S falls below `renew` times its value when frozen; 0: never.
    pub(super) fn look(&mut self, t: f64, q: &[f64]) -> Verdict {
        if self.r.k() == 0 || self.r.rank() == 0 {
            return Verdict::Keep;
        }
        self.fading = self.r.rank() < self.r.size().rows && (self.r.factor(t).is_err() || self.r.rows_fade());
        // a failure here would be met by the next evaluation too, which reports it
        let Ok(now) = self.quality_here(t, q) else { return Verdict::Keep };
        self.lowest = self.lowest.min(now.sqrt_mu);
        let part = now.sqrt_mu / self.fresh.sqrt_mu;
        if self.renew <= 0.0 || part >= self.renew {
            self.rejects_in_a_row = 0;
            return Verdict::Keep;
        }
        if part < HARD_PART * self.renew && self.rejects_in_a_row < 3 {
            self.rejects_in_a_row += 1;
            return Verdict::Repeat;
        }
        self.rejects_in_a_row = 0;
        Verdict::Change
    }

    /// Freeze anew at `(t, q)` and log it; a basis that cannot be had there leaves the old one in place. True if renewed.
    pub(super) fn freeze_anew(&mut self, t: f64, q: &[f64], why: &str) -> Result<bool, SystemError> {
        self.r.position(t, q)?;
        self.factor(t)?;
        self.basis_vectors();
        let before = match self.quality_here(t, q) {
            Ok(now) => now.sqrt_mu,
            Err(_) => 0.0,
        };
        match self.freeze(t, q) {
            Ok(()) => {}
            Err(e) if e.is_local() => {
                self.kept += 1;
                return Ok(false);
            }
            Err(e) => return Err(e),
        }
        let reason = format!(
            "tangent basis \"{}\" renewed ({why}): its quality sqrt(mu) rises from {before:.4} to {:.4}",
            self.name(),
            self.fresh.sqrt_mu
        );
        self.log(t, q, reason)?;
        Ok(true)
    }

    fn log(&mut self, t: f64, q: &[f64], reason: String) -> Result<(), SystemError> {
        let best = best_partition(self.r.system, self.r.rank(), t, q)?;
        self.events.push(PartitionEvent {
            t,
            independent: best.independent,
            dependent: best.dependent,
            entering: Vec::new(),
            leaving: Vec::new(),
            reason,
            quality: self.fresh,
            basis: Some(Arc::new(self.selector.clone())),
        });
        Ok(())
    }

    /// What the run should tell about the basis.
    pub(super) fn told(&self) -> Vec<String> {
        if self.r.k() == 0 || self.r.rank() == 0 {
            return Vec::new();
        }
        let renewed = self.frozen.saturating_sub(1);
        let mut notes = vec![match self.renew > 0.0 {
            true => format!(
                "tangent basis \"{}\": frozen at the start and renewed {renewed} times; its quality sqrt(mu) was {:.3} at the \
                 lowest",
                self.name(),
                self.lowest
            ),
            false => format!(
                "tangent basis \"{}\": frozen at the start and never renewed (renew = 0); its quality sqrt(mu) was {:.3} at \
                 the lowest",
                self.name(),
                self.lowest
            ),
        }];
        if self.kept > 0 {
            notes.push(format!(
                "{} times no new tangent basis could be had (next to a singular position) and the old one was kept",
                self.kept
            ));
        }
        notes
    }
}
