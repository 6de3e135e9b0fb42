//! Tangent bases: `v = Dᵀ u + γ`, `v' = Dᵀ u' + δ`, `M_d u' = D (h − M δ)`.

pub mod all;
mod base;
pub mod basis;
pub mod blocks;
pub mod chooser;
pub mod frozen;
pub mod instant;
pub mod partition;
pub mod user;

pub use base::{Base, ChoiceSnapshot};

use crate::error::Result;
use crate::record::{Correction, History, Output, PartitionEvent, Sample, StepDecision};
use crate::reduction::{Reduction, Sides};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense::Matrix;
use std::sync::Arc;

/// Reason for a new choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Occasion {
    /// The tangent's own verdict at the end of a step.
    Decayed,
    /// The choice became poor inside the step, which is repeated from here.
    Spoilt,
    /// The position coordinates need it, for this reason.
    Positions(&'static str),
}

/// A tangent basis, evaluated.
///
/// Levels follow each other: the reduction's `position`, then [`tangent`](Self::tangent), [`spread`](Self::spread),
/// [`accelerate`](Self::accelerate). By default quantities are those of independent velocities, the reduction's
/// partition.
pub trait TangentLevels<'s, S: ConstrainedSystem + 's> {
    /// The common part of all tangents.
    fn base(&self) -> &Base<'s, S>;
    /// As `base`, mutable.
    fn base_mut(&mut self) -> &mut Base<'s, S>;
    /// Levels of the system at the point last evaluated (Φ, C, a, b, v) and the rows kept.
    fn reduction(&mut self) -> &mut Reduction<'s, S> {
        &mut self.base_mut().r
    }
    /// As `reduction`, read-only.
    fn seen(&self) -> &Reduction<'s, S> {
        &self.base().r
    }
    /// Number of tangent velocities.
    fn count(&self) -> usize {
        self.seen().k()
    }
    /// u for v: `u = S v`.
    fn select(&mut self, v: &[f64], u: &mut [f64]) {
        u.iter_mut().zip(&self.seen().planned.partition.independent).for_each(|(u, &i)| *u = v[i]);
    }
    /// D and γ at the position last evaluated; `factored` if the factors there are already computed.
    fn tangent(&mut self, t: f64, _q: &[f64], _factored: bool) -> Result<()> {
        self.reduction().tangent(t)
    }
    /// `v = Dᵀ u + γ`, stored in the reduction's `v`.                                                            (P2)
    fn spread(&mut self, u: &[f64]) {
        self.reduction().spread(u);
    }
    /// b, δ and u'.                                                                        (P3)
    fn accelerate(&mut self, t: f64, q: &[f64], _u: &[f64]) -> Result<()> {
        self.reduction().velocity(t, q)?;
        self.reduction().acceleration(t, q)
    }
    /// u' of the last evaluation.
    fn rates(&mut self, du: &mut [f64]) {
        du.copy_from_slice(&self.seen().at.vdot_independent);
    }
    /// `v' = Dᵀ u' + δ` of the last evaluation.
    fn full_acceleration(&self, out: &mut [f64]) {
        self.seen().full_acceleration(out);
    }
    /// dE/dt that is not the work of conservative forces, at the last evaluation.
    fn power(&mut self, t: f64, q: &[f64]) -> Result<f64> {
        self.reduction().power(t, q)
    }
}

/// Criteria by which a basis is chosen, and chosen again.
pub trait TangentChoice<'s, S: ConstrainedSystem + 's>: TangentLevels<'s, S> {
    /// Natural size of u_j; other bases than independent velocities are measured by the mass metric already.
    fn natural_size(&self, j: usize) -> f64 {
        self.independent(None).map_or(1.0, |i| self.seen().system.structure().displacement(i[j]))
    }
    /// The first choice, at the closed (t, q).
    fn start(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<()>;
    /// A choice at an earlier position, from which the integration continues.
    fn resume(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<()> {
        self.start(t, q, v)
    }
    /// How good the choice still is at the end of a step, the point last evaluated. Changes nothing an evaluation
    /// depends on.
    fn judge(&mut self, t: f64, _q: &[f64]) -> StepDecision {
        self.base_mut().look_at_factors(t);
        StepDecision::Keep
    }
    /// Whether [`accept`](Self::accept) needs the end of the step that was judged.
    fn attends(&self) -> bool {
        self.base().fading
    }
    /// The step that was judged is accepted; (t, q) is the point last evaluated if this tangent attends.
    fn accept(&mut self, t: f64, q: &[f64]) -> Result<()> {
        self.base_mut().accept(t, q, false);
        Ok(())
    }
    /// A new choice at (t, q), the point last evaluated with velocities v; true if there is one.
    fn renew(&mut self, _t: f64, _q: &mut [f64], _v: &[f64], _why: Occasion) -> Result<bool> {
        Ok(false)
    }
    /// Distinguish a poor choice of coordinates from a singular configuration.
    fn blame(&self, _t: f64, _q: &[f64], e: SystemError) -> SystemError {
        e
    }
    /// Independent velocities of the choice of `within`, or of the one in use; none where the basis is not such a
    /// choice.
    fn independent<'a>(&'a self, _within: Option<&'a PartitionEvent>) -> Option<&'a [usize]> {
        None
    }
    /// S in use, where it is renewed without an event.
    fn unlisted_basis(&self) -> Option<Arc<Matrix>> {
        None
    }
    /// Report of the basis of `at` or `within`, or of the one in use, in `out` instead of independent velocities; r was
    /// evaluated there, none where the position is singular.
    fn describe(
        &mut self,
        _r: Option<&mut Reduction<'s, S>>,
        _at: &Output,
        _within: Option<&PartitionEvent>,
        _out: &mut Sample,
    ) -> Result<()> {
        Ok(())
    }
    /// Contribution to the history of a run besides that of all tangents.
    fn report(&self, history: &mut History);
}

/// Choices that are taken again, to evaluate steps that were taken with them.
pub trait TangentReplay<'s, S: ConstrainedSystem + 's>: TangentLevels<'s, S> {
    /// Number of the choice in use and of what else evaluations depend on; `None` where it cannot be restored.
    fn version(&self) -> Option<u64> {
        None
    }
    /// The choice in use.
    fn snapshot(&self) -> ChoiceSnapshot {
        ChoiceSnapshot { reduction: self.seen().snapshot(), basis: None }
    }
    /// Take this choice.
    fn restore(&mut self, from: &ChoiceSnapshot) {
        self.reduction().restore(&from.reduction);
    }
}

/// Treatment of closure errors at the end of a step, and the distance from a singular position.
pub trait TangentClosing<'s, S: ConstrainedSystem + 's> {
    /// The displacement of one correction at the position last evaluated, in velocities, for "kantorovich" with the
    /// factors of an earlier evaluation; false where it would change only round-off.                    (33, 34)
    fn correction(&mut self, t: f64, q: &[f64], rule: Correction, dv: &mut [f64]) -> Result<bool>;
    /// Correct the error of S4 in u at the closed (t, q); true if u changed. There is none where v is computed, not
    /// integrated.
    fn settle(&mut self, _t: f64, _q: &[f64], _u: &mut [f64]) -> Result<bool> {
        Ok(false)
    }
    /// Distance from a singular position at the last evaluation, falling linearly to zero towards one, and the number
    /// of the plan it was measured with. `None`: the basis does not suffer there.
    fn margin(&mut self) -> Option<(f64, u64)> {
        None
    }
    /// Side of the singular positions of C_D, and of the dead points of the basis, at the last evaluation.
    fn sides(&self, sides: &mut Sides);
    /// The choice to which they belong, as in [`Sides::choice`].
    fn choice_of_sides(&self) -> (u64, u64);
    /// Whether all velocities are states, from which the residual of S4 is removed after a step.
    fn integrates_velocities(&self) -> bool {
        false
    }
    /// Distance from a singular position at the last evaluation, as given by [`margin`](Self::margin), where
    /// constraints are not closed and the step length does not depend on it.
    fn distance_of_drift(&mut self) -> Option<f64> {
        None
    }
}

/// A tangent basis in use: all of it.
pub trait Tangent<'s, S: ConstrainedSystem + 's>:
    TangentLevels<'s, S> + TangentChoice<'s, S> + TangentClosing<'s, S> + TangentReplay<'s, S>
{
}

impl<'s, S: ConstrainedSystem + 's, T> Tangent<'s, S> for T where
    T: TangentLevels<'s, S> + TangentChoice<'s, S> + TangentClosing<'s, S> + TangentReplay<'s, S>
{
}
