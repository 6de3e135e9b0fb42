//! Effort in a joint that no velocity of the tree stands for: a wrench on the child, its opposite on the parent.

use super::{AppliedWrench, At, Effect, ForceApplication, Place};
use crate::value::Source;
use partita_math::spatial::Space;
use partita_system::SystemError;

/// Wrench of a unit effort, about the joint's point on the child.
#[derive(Clone, Copy, Debug)]
pub enum Unit<G: Space> {
    /// Moment: a part fixed in the parent's link axes and one in the child's.
    Moment(G::Ang, G::Ang),
    /// Force along an axis of the parent's link.
    Force(G::Vec),
}

/// A pair of wrenches in a joint.
#[derive(Clone, Debug)]
pub struct CutEffort<G: Space> {
    /// Name, for messages.
    pub name: String,
    /// Parent: the link's own reference point.
    pub parent: Place<G>,
    /// Child: the joint's point on it.
    pub child: Place<G>,
    /// Wrench on the child for a unit effort.
    pub unit: Unit<G>,
    /// Effort.
    pub value: Source<G::S>,
}

impl<G: Space> Unit<G> {
    /// Moment and force of a unit effort now, for the links of parent and child.
    fn now(&self, at: &At<G>, parent: usize, child: usize) -> (G::Ang, G::Vec) {
        let (xp, xc) = (&at.s.links[parent], &at.s.links[child]);
        match *self {
            Self::Moment(on_parent, on_child) => {
                let axis = G::rotate_ang(&xp.rot, on_parent) + G::rotate_ang(&xc.rot, on_child);
                (axis, G::Vec::default())
            }
            Self::Force(a) => (G::Ang::default(), G::rotate(&xp.rot, a)),
        }
    }

    /// How many unit efforts a push on the child is.
    pub(crate) fn effort(&self, at: &At<G>, parent: usize, on: &AppliedWrench<G>) -> G::S {
        let (axis, direction) = self.now(at, parent, on.link);
        let size = G::dot_ang(axis, axis) + G::dot(direction, direction);
        (G::dot_ang(axis, on.moment) + G::dot(direction, on.force)) / size
    }
}

impl<G: Space> CutEffort<G> {
    /// The effort that a push on the child is.
    pub(crate) fn effort(&self, at: &At<G>, on: &AppliedWrench<G>) -> G::S {
        self.unit.effort(at, self.parent.link, on)
    }

    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>, room: &mut Vec<f64>) -> Result<Effect<G>, SystemError> {
        let x = self.value.at(&at.instant, &self.name, room)?;
        let (parent, child) = (self.parent.link, self.child.link);
        let (xp, xc) = (&at.s.links[parent], &at.s.links[child]);
        let arm = at.arm(&self.child);
        // action equals reaction at the same point of space
        let back = at.tree.place(child, at.s) + arm - at.tree.place(parent, at.s);
        let (moment, force, rate) = match self.unit {
            Unit::Moment(on_parent, on_child) => {
                let axis = G::rotate_ang(&xp.rot, on_parent) + G::rotate_ang(&xc.rot, on_child);
                (G::scale_ang(axis, x), G::Vec::default(), G::dot_ang(axis, xc.w - xp.w))
            }
            Unit::Force(a) => {
                let d = G::rotate(&xp.rot, a);
                let rate = at.velocity(child, arm) - at.velocity(parent, back);
                (G::Ang::default(), G::scale(d, x), G::dot(d, rate))
            }
        };
        let push = |e: &Place<G>, arm, moment, force| AppliedWrench { node: e.node, link: e.link, arm, moment, force };
        Ok(Effect {
            application: ForceApplication::Between(
                push(&self.child, arm, moment, force),
                push(&self.parent, back, -moment, -force),
            ),
            potential: G::S::default(),
            power: x * rate,
        })
    }
}
