//! A gas spring: a closed column of gas that changes its state polytropically.

use super::{EffortArguments, Response, ScalarLaw};
use crate::numbers::Fields;
use crate::spec;
use partita_math::scalar::Scalar;
use partita_math::tolerance;
use partita_system::SystemError;

/// With the column `c = 1 + x/length` of its length as drawn the effort is `force / c^exponent`; a negative force pushes back
/// with `c = 1 − x/length`.
#[derive(Clone, Copy, Debug)]
pub struct GasSpring<S> {
    /// Effort as drawn.
    pub force: S,
    /// Length of the column as drawn, with the sign of the force.
    pub length: S,
    /// Exponent of the change of state, above 1.
    pub exponent: f64,
}

impl<S: Scalar> GasSpring<S> {
    pub(super) fn new(x: &spec::GasSpring, n: &Fields<S>) -> Self {
        let (force, length) = (n.number("force"), n.number("length"));
        Self { force, length: force.where_positive(length, -length), exponent: x.exponent }
    }
}

impl<S: Scalar> ScalarLaw<S> for GasSpring<S> {
    fn respond(&self, asked: &EffortArguments<S>, _: &mut Vec<f64>) -> Result<Response<S>, SystemError> {
        // an empty column would need an infinite effort, and no step reaches it
        let column = (S::one() + asked.x / self.length).max(S::zero());
        let effort = self.force / column.power(self.exponent);
        let potential = (effort * self.length * column).scale(1.0 / (self.exponent - 1.0));
        Ok(Response { effort, potential, power: S::zero() })
    }
    fn is_dissipative(&self) -> bool {
        false
    }
    fn turns(&self) -> Option<(S, f64)> {
        Some((S::zero(), tolerance::HALF_TURN))
    }
}
