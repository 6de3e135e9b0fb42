//! Spring and damper in a coordinate of the tree.

use super::{stored, At, Effect, ForceApplication};
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;

/// Drives a coordinate back to `angle` by `stiffness (q − angle) + damping v`.
#[derive(Clone, Copy, Debug)]
pub struct Torsion<S> {
    /// Coordinate.
    pub q: usize,
    /// Its velocity.
    pub v: usize,
    /// Stiffness.
    pub stiffness: S,
    /// Damping.
    pub damping: S,
    /// Free position.
    pub angle: S,
    /// Has it a damper?
    pub damped: bool,
}

impl<S: Scalar> Torsion<S> {
    #[inline(always)]
    pub(crate) fn wrench<G: Space<S = S>>(&self, at: &At<G>) -> Effect<G> {
        let (stretch, speed) = (at.instant.q[self.q] - self.angle, at.instant.v[self.v]);
        Effect {
            application: ForceApplication::Along(self.v, -(self.stiffness * stretch + self.damping * speed)),
            potential: stored(self.stiffness, stretch),
            power: -(self.damping * speed * speed),
        }
    }
}
