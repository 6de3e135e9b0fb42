//! Options of formulations. Each reads its own; a missing required one is an error.

use crate::compiled::Compilation;
use crate::error::{Result, SystemError};
use crate::partition::Selection;
use crate::record::Correction;
use crate::start;

use std::sync::Arc;

/// User-defined tangent velocities: `v = Dᵀ(t, q) u + γ(t, q)`, `v' = Dᵀ u' + δ(t, q, v)`.
pub trait TangentMap: Send + Sync {
    /// `Dᵀ` (nv x k), row by row, with `C Dᵀ = 0`.
    fn tangent(&self, t: f64, q: &[f64], dt: &mut [f64]) -> Result<()>;
    /// `γ` (nv) with `C γ + a = 0`. Zero where the constraints do not depend on time.
    fn offset(&self, _t: f64, _q: &[f64], gamma: &mut [f64]) -> Result<()> {
        gamma.fill(0.0);
        Ok(())
    }
    /// `δ = (dDᵀ/dt) u + dγ/dt` (nv) at v; false: not known, and computed by differences along the motion.
    fn bias(&self, _t: f64, _q: &[f64], _v: &[f64], _delta: &mut [f64]) -> Result<bool> {
        Ok(false)
    }
}

/// When a frozen tangent basis is renewed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Renew {
    /// When its √μ has fallen below this fraction of its value when frozen (which is 1 for mass-orthonormal bases); 0:
    /// never.
    Below(f64),
    /// After every accepted step, whatever its quality.
    EachStep,
}

impl Renew {
    /// Whether a frozen basis is never renewed.
    pub fn never(self) -> bool {
        matches!(self, Self::Below(part) if part <= 0.0)
    }
}

impl From<f64> for Renew {
    fn from(part: f64) -> Self {
        Self::Below(part)
    }
}

/// Options of all formulations.
#[derive(Clone)]
pub struct FormulationOptions {
    /// Correction of closure errors of S3 (and of S4, where v is integrated).
    pub correction: Correction,
    /// Switch of independent coordinates when one gains more than this; infinite: never.
    pub switch_threshold: f64,
    /// Independent velocities given by the user, kept through the run.
    pub independent: Option<Vec<usize>>,
    /// Preferences that multiply ρ.
    pub weights: Option<Vec<f64>>,
    /// Rule that chooses the independent coordinates.
    pub selection: Selection,
    /// Length of the persistence window (P8) (s).
    pub window: Option<f64>,
    /// Baumgarte's α and β [1/s]: `Φ̈ + 2αΦ̇ + β²Φ = 0`. Never a default.
    pub baumgarte: Option<(f64, f64)>,
    /// When a frozen tangent basis is renewed.
    pub renew: Renew,
    /// The user-defined tangent velocities.
    pub tangent: Option<Arc<dyn TangentMap>>,
    /// When rates are compiled.
    pub compilation: Compilation,
}

impl FormulationOptions {
    /// Refuses invalid numbers for a system of n velocities, whatever the formulation.
    ///
    /// # Errors
    /// `Argument`, with the option, the invalid value and a valid one.
    pub fn check(&self, n: usize) -> Result<()> {
        let refuse = |argument: &str, message: String| Err(SystemError::argument(argument, message));
        if self.switch_threshold.is_nan() || self.switch_threshold < 1.0 {
            return refuse(
                "switch_threshold",
                format!(
                    "switch_threshold is {}; below 1 two choices would alternate forever; give 1.25, or infinity to \
                 disable switching",
                    self.switch_threshold
                ),
            );
        }
        if let Renew::Below(part) = self.renew {
            if !(0.0..=1.0).contains(&part) {
                return refuse(
                    "renew",
                    format!("renew is {part}, but a part of the quality when frozen lies in 0..1 (0: never)"),
                );
            }
        }
        if let Some(independent) = &self.independent {
            start::distinct(independent, n)?;
        }
        let Some(weights) = &self.weights else { return Ok(()) };
        if weights.len() != n {
            return refuse(
                "weights",
                format!("weights has {} numbers for {n} velocities; give one each", weights.len()),
            );
        }
        match weights.iter().position(|x| !(x.is_finite() && *x > 0.0)) {
            Some(i) => refuse(
                "weights",
                format!("weights[{i}] is {}; give a finite number above zero, 1 for no preference", weights[i]),
            ),
            None => Ok(()),
        }
    }
}

impl Default for FormulationOptions {
    fn default() -> Self {
        Self {
            correction: Correction::Partition,
            switch_threshold: 1.25,
            independent: None,
            weights: None,
            selection: Selection::Collective,
            window: None,
            baumgarte: None,
            renew: Renew::Below(0.5),
            tangent: None,
            compilation: Compilation::default(),
        }
    }
}
