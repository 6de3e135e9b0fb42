//! Tangent bases: `v = Dᵀ u + γ`, `v' = Dᵀ u' + δ`, `M_d u' = D (h − M δ)`.

pub mod basis;
pub mod blocks;
pub mod chooser;
mod dense;
pub mod frozen;
mod inputs;
pub mod instant;
pub mod partition;
mod solver;
pub mod user;

use crate::partition::criterion::Quality;
use crate::record::Verdict;
use crate::record::{Correction, FormulationCounters, Journal, PartitionEvent};
use crate::reduction::Reduction;
use crate::system::{ConstrainedSystem, SystemError};

/// Why a new choice is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Occasion {
    /// The tangent's own verdict at the end of a step.
    Decayed,
    /// The choice went bad inside the step, which is repeated from here.
    Spoilt,
    /// The position coordinates need it, for this reason.
    Positions(&'static str),
}

/// A tangent basis in use.
///
/// Levels follow each other: the reduction's `position`, then [`tangent`](Self::tangent), [`spread`](Self::spread),
/// [`accelerate`](Self::accelerate). What a basis is chosen by, and when it is to be chosen anew, is its own.
pub trait Tangent<'s, S: ConstrainedSystem + 's> {
    /// Levels of the system at the point last evaluated (Φ, C, a, b, v) and the rows kept.
    fn reduction(&mut self) -> &mut Reduction<'s, S>;
    /// The same, to look at.
    fn seen(&self) -> &Reduction<'s, S>;
    /// The first choice, at the closed (t, q).
    fn start(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<(), SystemError>;
    /// A choice at a position that was passed already, to go on from there.
    fn resume(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<(), SystemError> {
        self.start(t, q, v)
    }
    /// u for v: `u = S v`.
    fn select(&mut self, v: &[f64], u: &mut [f64]) -> Result<(), SystemError>;
    /// D and γ at the position last evaluated; `factored` where whoever found the position has left the factors there.
    fn tangent(&mut self, t: f64, q: &[f64], factored: bool) -> Result<(), SystemError>;
    /// `v = Dᵀ u + γ`, left in the reduction's `v`.                                        (P2)
    fn spread(&mut self, u: &[f64]);
    /// b, δ and u'.                                                                        (P3)
    fn accelerate(&mut self, t: f64, q: &[f64], u: &[f64]) -> Result<(), SystemError>;
    /// u' of the last evaluation.
    fn rates(&self, du: &mut [f64]);
    /// `v' = Dᵀ u' + δ` of the last evaluation.
    fn full_acceleration(&self, out: &mut [f64]);
    /// γ of the last evaluation.
    fn offset(&self) -> &[f64];
    /// One correction of q at the position last evaluated; true if it moved.               (33, 34)
    fn correct(&mut self, t: f64, q: &mut [f64], rule: Correction) -> Result<bool, SystemError>;
    /// How good the choice still is at the end of a step, the point last evaluated. Changes nothing an evaluation depends on.
    fn judge(&mut self, _t: f64, _q: &[f64]) -> Verdict {
        Verdict::Keep
    }
    /// Does [`accept`](Self::accept) want to see the end of the step that was judged?
    fn attends(&self) -> bool {
        false
    }
    /// The step that was judged is taken; (t, q) is the point last evaluated if this tangent attends.
    fn accept(&mut self, _t: f64, _q: &[f64]) -> Result<(), SystemError> {
        Ok(())
    }
    /// A new choice at (t, q), the point last evaluated with velocities v; true if there is one.
    fn renew(&mut self, _t: f64, _q: &mut [f64], _v: &[f64], _why: Occasion) -> Result<bool, SystemError> {
        Ok(false)
    }
    /// Distance from a singular position at the last evaluation, falling linearly to zero towards one, and the number of the
    /// plan it was measured with. `None`: the basis does not suffer there.
    fn margin(&mut self) -> Option<(f64, u64)> {
        None
    }
    /// The largest gain an exchange of coordinates promises at the last evaluation.         (P6)
    fn gain(&mut self) -> f64 {
        0.0
    }
    /// Tell a choice that stays from a mechanism that is singular.
    fn blame(&self, _t: f64, _q: &[f64], e: SystemError) -> SystemError {
        e
    }
    /// Independent velocities of the choice of `within`, or of the one in use; none where the basis is no choice of them.
    fn independent<'a>(&'a self, _within: Option<&'a PartitionEvent>) -> Option<&'a [usize]> {
        None
    }
    /// σ and √μ of the basis of `within`, or of the one in use, at the instant r was last evaluated at; none where they are
    /// those of the independent velocities.
    fn quality(
        &mut self,
        _r: &mut Reduction<'s, S>,
        _t: f64,
        _q: &[f64],
        _within: Option<&PartitionEvent>,
    ) -> Result<Option<Quality>, SystemError> {
        Ok(None)
    }
    /// Choices so far.
    fn events(&self) -> &[PartitionEvent];
    /// What belongs to the journal of a run.
    fn report(&self, journal: &mut Journal);
}

/// Rows kept by a reduction, ascending.
fn kept_rows<S: ConstrainedSystem>(r: &Reduction<S>) -> Vec<usize> {
    let mut rows = r.partition.rows.clone();
    rows.sort_unstable();
    rows
}

/// Counts of a reduction.
fn counted<S: ConstrainedSystem>(r: &Reduction<S>) -> FormulationCounters {
    FormulationCounters { factorisations: r.factorisations, plans: r.plans, ..FormulationCounters::default() }
}
