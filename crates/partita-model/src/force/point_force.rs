//! Force at a point of a body.

use super::{AppliedWrench, At, AttachmentPoint, Effect, ForceApplication};
use crate::value::VectorSource;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Space};
use partita_system::SystemError;

/// A force in world or in body axes.
#[derive(Clone, Debug)]
pub struct PointForce<G: Space> {
    /// Name, for messages.
    pub name: String,
    /// Where it acts.
    pub on: AttachmentPoint<G>,
    /// Components.
    pub value: VectorSource<G::S>,
    /// Axes of the components: those of the body, as its link carries them, if the force rotates with it, else the
    /// world's.
    pub axes: Mat3<G::S>,
    /// Whether it rotates with the body.
    pub turns: bool,
}

impl<G: Space> PointForce<G> {
    /// A constant force in world axes has a potential.
    pub fn is_conservative(&self) -> bool {
        !self.turns && self.value.is_constant()
    }

    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>, memory: &mut Vec<f64>) -> Result<Effect<G>, SystemError> {
        let x = self.axes.apply(self.value.at(&at.instant, &self.name, memory)?);
        let link = self.on.link;
        let state = &at.s.links[link];
        let force = G::vec_in(if self.turns { G::rot_to(&state.rot).apply(x) } else { x });
        let arm = at.arm(&self.on);
        let (potential, power) = if self.is_conservative() {
            (-G::dot(force, at.tree.reference_point(link, at.s) + arm), G::S::zero())
        } else {
            (G::S::zero(), G::dot(force, at.velocity(link, arm)))
        };
        let push = AppliedWrench { node: self.on.node, link, arm, moment: G::Ang::default(), force };
        Ok(Effect { application: ForceApplication::On(push), potential, power })
    }
}
