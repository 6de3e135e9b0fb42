//! An effort that is a number, a table in time or a function.

use super::{EffortArguments, Response, ScalarLaw};
use crate::value::Source;
use partita_math::scalar::Scalar;
use partita_system::SystemError;

/// An effort.
#[derive(Clone, Debug)]
pub struct Effort<S> {
    /// Effort.
    pub value: Source<S>,
    /// Whether it acts along a coordinate of the state. Then a constant effort has a potential.
    pub in_state: bool,
}

impl<S: Scalar> ScalarLaw<S> for Effort<S> {
    #[inline(always)]
    fn respond(&self, asked: &EffortArguments<S>, plain: &mut Vec<f64>) -> Result<Response<S>, SystemError> {
        let effort = self.value.at(asked.instant, asked.name, plain)?;
        let (potential, power) = match (self.in_state, &self.value) {
            (true, Source::Constant(_)) => (-(effort * asked.x), S::zero()),
            _ => (S::zero(), effort * asked.rate),
        };
        Ok(Response { effort, potential, power })
    }
    fn is_dissipative(&self) -> bool {
        !self.in_state || !matches!(self.value, Source::Constant(_))
    }
    fn depends_on_value(&self) -> bool {
        self.in_state
    }
    fn sources(&self) -> &[Source<S>] {
        std::slice::from_ref(&self.value)
    }
}
