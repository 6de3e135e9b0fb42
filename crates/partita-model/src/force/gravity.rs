//! Time-dependent gravity: one acceleration for all bodies.

use super::{AppliedWrench, At, AttachmentPoint, Effect, ForceApplication, ForceScratch};
use crate::value::VectorSource;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Space};
use partita_system::SystemError;

/// Pulls at the centre of mass of each body.
#[derive(Clone, Debug)]
pub struct Gravity<G: Space> {
    /// Name, for messages.
    pub name: String,
    /// Acceleration, world axes.
    pub value: VectorSource<G::S>,
    /// Mechanism axes from world axes.
    pub axes: Mat3<G::S>,
    /// Centres of mass, and masses.
    pub on: Vec<(AttachmentPoint<G>, G::S)>,
}

impl<G: Space> Gravity<G> {
    pub(crate) fn wrench(&self, at: &At<G>, memory: &mut ForceScratch<G>) -> Result<Effect<G>, SystemError> {
        let value = self.value.at(&at.instant, &self.name, &mut memory.plain)?;
        let gravity = G::vec_in(self.axes.apply(value));
        memory.wrenches.clear();
        let mut power = G::S::zero();
        for (p, mass) in &self.on {
            let (arm, force) = (at.arm(p), G::scale(gravity, *mass));
            power += G::dot(force, at.velocity(p.link, arm));
            memory.wrenches.push(AppliedWrench { node: p.node, link: p.link, arm, moment: G::Ang::default(), force });
        }
        Ok(Effect { application: ForceApplication::Listed, potential: G::S::zero(), power })
    }
}
