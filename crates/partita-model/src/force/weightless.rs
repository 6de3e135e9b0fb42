//! No gravity on a body: its weight is cancelled.

use super::{AppliedWrench, At, AttachmentPoint, Effect, ForceApplication};
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;

/// Cancels the weight of a body, for any gravity.
#[derive(Clone, Copy, Debug)]
pub struct Weightless<G: Space> {
    /// Centre of mass.
    pub on: AttachmentPoint<G>,
    /// Mass.
    pub mass: G::S,
}

impl<G: Space> Weightless<G> {
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>) -> Effect<G> {
        let arm = at.arm(&self.on);
        let force = -G::scale(at.tree.gravity, self.mass);
        let potential = -G::dot(force, at.tree.reference_point(self.on.link, at.s) + arm);
        let push = AppliedWrench { node: self.on.node, link: self.on.link, arm, moment: G::Ang::default(), force };
        Effect { application: ForceApplication::On(push), potential, power: G::S::zero() }
    }
}
