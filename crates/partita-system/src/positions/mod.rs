//! Position coordinates: the part of the state that represents q, and how q is found from it.

pub mod all;
pub mod chart;
mod continuity;
pub mod independent;
pub mod inverse_kinematics;
pub mod newton;
mod state_coordinates;
pub mod turns;

use crate::error::Result;
use crate::record::History;
use crate::record::StepDecision;
use crate::system::{ConstrainedSystem, SystemError};
use crate::tangent::Tangent;

/// Position coordinates in use with the tangent T.
pub trait Positions<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>>: PositionSteps<'s, S, T> {
    /// Whether the loops are closed at every evaluation.
    const CLOSED: bool;
    /// Number of leading components of y.
    fn width(&self) -> usize;
    /// Start from the closed q and write y; the tangent was started there.
    fn start(&mut self, tangent: &mut T, t: f64, q: &[f64], y: &mut [f64]);
    /// Find q for y, with the position level of the tangent's reduction there; `crossing`: a singular position is being
    /// crossed. True if the tangent's factors belong to it too.
    fn locate(&mut self, tangent: &mut T, t: f64, y: &[f64], crossing: bool) -> Result<bool>;
    /// q, as last found.
    fn q(&self) -> &[f64];
    /// Rates of the leading components at the last evaluation, with tangent velocities u.
    fn rates(&mut self, tangent: &mut T, u: &[f64], dy: &mut [f64]);
    /// As `locate`, closed to round-off.
    fn output(&mut self, tangent: &mut T, t: f64, y: &[f64]) -> Result<bool>;
    /// The tangent has chosen anew at q: write y for it.
    fn rewrite(&mut self, _tangent: &mut T, _q: &[f64], _y: &mut [f64]) {}
    /// Whether the leading components of y are q itself.
    fn has_all(&self) -> bool {
        false
    }
    /// Natural sizes of the leading components, from those of q.
    fn sizes(&self, _of_q: &[f64], out: &mut [f64]) {
        out.fill(1.0);
    }
}

/// Position coordinates at the ends of steps. Only [`accept`](Self::accept) and later calls move the starting point
/// from which positions are found.
pub trait PositionSteps<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>> {
    /// Correct closure errors of y at the end of a step; true if y changed.
    fn settle(&mut self, tangent: &mut T, t: f64, y: &mut [f64]) -> Result<bool>;
    /// Whether [`settle`](Self::settle) found q for this y, with the position level of the tangent's reduction there.
    fn is_found(&self) -> bool {
        false
    }
    /// Whether the step that ends at the point last evaluated is continuous.
    fn judge(&mut self, _tangent: &mut T, _t: f64, _margin: Option<f64>) -> StepDecision {
        StepDecision::Keep
    }
    /// For a step that the tangent accepts: true where the positions need another choice, and why.
    fn wants_change(&self) -> Option<&'static str> {
        None
    }
    /// Whether no step from here is possible.
    fn is_stuck(&mut self) -> bool {
        false
    }
    /// The step that was judged is accepted.
    fn accept(&mut self, _tangent: &mut T, _t: f64, _margin: Option<f64>) {}
    /// The message if the step has been repeated too often.
    fn failure(&mut self, _tangent: &mut T, _t: f64) -> Option<SystemError> {
        None
    }
    /// Remove whole turns from angles that have grown (see [`turns`]) and add them to `turns` (nq); true if y changed.
    fn wrap(&mut self, tangent: &T, y: &mut [f64], turns: &mut [i32]) -> bool;
    /// Contribution to the history of a run.
    fn report(&self, _history: &mut History) {}
}

/// Refuse constraints that have no positions, with the name of the formulation that needs them.
pub(crate) fn needs_positions<S: ConstrainedSystem>(system: &S, name: &str, use_: &str) -> Result<()> {
    let size = system.size();
    if size.rows <= size.holonomic {
        return Ok(());
    }
    Err(SystemError::argument("formulation", format!(
        "\"{name}\" {use_}, which needs constraints that hold for positions; {} of the {} rows ({}, ...) hold for velocities only \
         (nonholonomic); use \"projective\"",
        size.rows - size.holonomic,
        size.rows,
        system.structure().rows[size.holonomic].description
    )))
}
