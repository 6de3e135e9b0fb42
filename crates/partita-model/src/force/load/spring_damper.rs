//! Spring and damper.

use super::{EffortArguments, Response, ScalarLaw};
use crate::force::stored;
use crate::numbers::Fields;
use partita_math::scalar::Scalar;
use partita_math::tolerance;
use partita_system::SystemError;

/// Drives a value back to `free` by `stiffness (x − free) + damping x'`.
#[derive(Clone, Copy, Debug)]
pub struct SpringDamper<S> {
    /// Stiffness.
    pub stiffness: S,
    /// Damping.
    pub damping: S,
    /// Free position.
    pub free: S,
    /// Whether it has a damper.
    pub damped: bool,
}

impl<S: Scalar> SpringDamper<S> {
    pub(super) fn new(n: &Fields<S>, damped: bool) -> Self {
        Self { stiffness: n.number("stiffness"), damping: n.number("damping"), free: n.number("angle"), damped }
    }
}

impl<S: Scalar> ScalarLaw<S> for SpringDamper<S> {
    #[inline(always)]
    fn respond(&self, asked: &EffortArguments<S>, _: &mut Vec<f64>) -> Result<Response<S>, SystemError> {
        let (stretch, speed) = (asked.x - self.free, asked.rate);
        Ok(Response {
            effort: -(self.stiffness * stretch + self.damping * speed),
            potential: stored(self.stiffness, stretch),
            power: -(self.damping * speed * speed),
        })
    }
    fn is_dissipative(&self) -> bool {
        self.damped
    }
    fn turns(&self) -> Option<(S, f64)> {
        Some((self.free, tolerance::HALF_TURN))
    }
}
