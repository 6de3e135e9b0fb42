//! Spring and damper in a coordinate of a joint that closes a loop.

use super::reading::KNOWN;
use super::{stored, At, Effect, Reading};
use partita_math::spatial::Space;
use partita_system::SystemError;

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
        self.along.known(&self.name, stretch, KNOWN)?;
        let effort = -(self.stiffness * stretch + self.damping * read.rate);
        Ok(Effect {
            application: self.along.application(&read, effort),
            potential: stored(self.stiffness, stretch),
            power: -(self.damping * read.rate * read.rate),
        })
    }
}
