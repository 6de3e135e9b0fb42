//! Effort along a velocity of the tree: a torque or a force in a joint.

use super::{At, Effect, ForceApplication};
use crate::value::Source;
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;
use partita_system::SystemError;

/// Effort along a tree velocity.
#[derive(Clone, Debug)]
pub struct Effort<S> {
    /// Name, for messages.
    pub name: String,
    /// Coordinate, if one integrates the velocity.
    pub q: Option<usize>,
    /// Velocity.
    pub v: usize,
    /// Effort.
    pub value: Source<S>,
}

impl<S: Scalar> Effort<S> {
    /// A constant effort along a coordinate has a potential.
    pub fn is_conservative(&self) -> bool {
        self.q.is_some() && matches!(self.value, Source::Constant(_))
    }

    #[inline(always)]
    pub(crate) fn wrench<G: Space<S = S>>(&self, at: &At<G>, room: &mut Vec<f64>) -> Result<Effect<G>, SystemError> {
        let x = self.value.at(&at.instant, &self.name, room)?;
        let (potential, power) = match (self.q, &self.value) {
            (Some(q), Source::Constant(_)) => (-(x * at.instant.q[q]), S::zero()),
            _ => (S::zero(), x * at.instant.v[self.v]),
        };
        Ok(Effect { application: ForceApplication::Along(self.v, x), potential, power })
    }
}
