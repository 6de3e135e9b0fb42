//! Closing the loops with a frozen S: along G, or by the least move.

use super::super::Correction;
use super::Selector;
use crate::kinematics::correction;
use crate::kinematics::projection::correct_orthogonally;
use crate::system::{ConstrainedSystem, SystemError};

impl<S: ConstrainedSystem> Selector<'_, S> {
    /// One step `q ← q − G Φ`: the tangent part S·Δ stays untouched. The analogue of (34); needs all rows holonomic.
    pub fn along_the_constraints(&mut self, t: f64, q: &mut [f64]) -> Result<bool, SystemError> {
        let k = self.r.k();
        self.r.position(t, q)?;
        self.factor(t)?;
        let mut x = std::mem::take(&mut self.rhs);
        x[..k].fill(0.0);
        for (x, &row) in x[k..].iter_mut().zip(&self.r.partition.rows) {
            *x = -self.r.phi[row];
        }
        self.solve(&mut x);
        self.r.system.step(q, &x);
        self.rhs = x;
        Ok(true)
    }

    /// One correction of q by the chosen rule; with nonholonomic rows always by the least move (33).
    pub fn correct_once(&mut self, t: f64, q: &mut [f64], rule: Correction) -> Result<bool, SystemError> {
        let size = self.r.size();
        match rule {
            Correction::None => Ok(false),
            Correction::Partition if size.rows == size.holonomic => self.along_the_constraints(t, q),
            _ => {
                self.r.position(t, q)?;
                correct_orthogonally(&mut self.r, t, q)?;
                Ok(true)
            }
        }
    }

    /// Close the loops at q to round-off by the chosen rule.
    pub fn close(&mut self, t: f64, q: &mut [f64], rule: Correction) -> Result<(), SystemError> {
        if rule == Correction::None || self.r.size().holonomic == 0 || self.r.rank() == 0 {
            return Ok(());
        }
        let open = |x: &mut Self, q: &[f64]| {
            x.r.position(t, q)?;
            Ok((!x.r.is_closed()).then(|| x.r.closure()))
        };
        correction::close_with(self, q, open, |x, q| x.correct_once(t, q, rule))?;
        Ok(())
    }
}
