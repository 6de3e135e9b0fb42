//! Closing the loops with a frozen S: along G, or by the least move.

use super::Frozen;
use crate::kinematics::projection::correct_orthogonally;
use crate::record::Correction;
use crate::system::{ConstrainedSystem, SystemError};

impl<S: ConstrainedSystem> Frozen<'_, S> {
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
}
