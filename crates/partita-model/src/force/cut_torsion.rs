//! Spring and damper in a coordinate of a joint that closes a loop.

use super::{stored, At, Effect, Reading};
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;
use partita_system::SystemError;

/// Turns (rad) up to which a spring is known to be wound where whole turns are not: a little less than half a turn either
/// way, so that no step passes the place where the angle starts again unseen.
const WOUND: f64 = 3.0;

/// Drives a coordinate back to `angle` by `stiffness (x − angle) + damping x'`.
#[derive(Clone, Debug)]
pub struct CutTorsion<G: Space> {
    /// Name, for messages.
    pub name: String,
    /// The coordinate.
    pub along: Reading<G>,
    /// Stiffness.
    pub stiffness: G::S,
    /// Damping.
    pub damping: G::S,
    /// Free position.
    pub angle: G::S,
    /// Has it a damper?
    pub damped: bool,
}

impl<G: Space> CutTorsion<G> {
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>) -> Result<Effect<G>, SystemError> {
        let read = self.along.read(at);
        let stretch = read.value - self.angle;
        if self.along.wraps() {
            if let Some(by) = stretch.outside(-WOUND, WOUND) {
                return Err(SystemError::Wound { what: self.name.clone(), by });
            }
        }
        let effort = -(self.stiffness * stretch + self.damping * read.rate);
        Ok(Effect {
            acts: self.along.acts(&read, effort),
            potential: stored(self.stiffness, stretch),
            power: -(self.damping * read.rate * read.rate),
        })
    }
}
