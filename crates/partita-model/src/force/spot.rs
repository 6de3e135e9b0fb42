//! Points in space of elements fixed to links, also of a planar mechanism: offsets from the plane are constant.

use super::{AppliedWrench, At, AttachmentPoint, ForceApplication};
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Space, Vec3};

/// A point on a link, and its offset from the plane of a planar mechanism.
#[derive(Clone, Copy, Debug)]
pub struct Spot<G: Space> {
    /// In the space of the evaluations.
    pub attachment: AttachmentPoint<G>,
    /// The component that this space does not represent.
    pub out: Vec3<G::S>,
}

impl<G: Space> At<'_, G> {
    /// Position of a spot, mechanism axes.
    #[inline(always)]
    pub(super) fn spot(&self, p: &Spot<G>) -> Vec3<G::S> {
        G::vec_to(self.tree.reference_point(p.attachment.link, self.s) + self.arm(&p.attachment)) + p.out
    }

    /// Orientation of a link as a matrix.
    #[inline(always)]
    pub(super) fn axes(&self, link: usize) -> Mat3<G::S> {
        G::rot_to(&self.s.links[link].rot)
    }

    /// From a link's reference point to a point of space.
    #[inline(always)]
    fn arm_to(&self, link: usize, x: Vec3<G::S>) -> G::Vec {
        G::vec_in(x) - self.tree.reference_point(link, self.s)
    }

    /// Velocity of a link's material at a point of space.
    #[inline(always)]
    pub(super) fn moving(&self, link: usize, x: Vec3<G::S>) -> Vec3<G::S> {
        G::vec_to(self.velocity(link, self.arm_to(link, x)))
    }

    /// Angular velocity of a link.
    #[inline(always)]
    pub(super) fn spinning(&self, link: usize) -> Vec3<G::S> {
        G::ang_to(self.s.links[link].w)
    }

    /// A wrench at a point of space on a link.
    #[inline(always)]
    pub(super) fn wrench_at(
        &self,
        on: &AttachmentPoint<G>,
        x: Vec3<G::S>,
        moment: Vec3<G::S>,
        force: Vec3<G::S>,
    ) -> AppliedWrench<G> {
        AppliedWrench {
            node: on.node,
            link: on.link,
            arm: self.arm_to(on.link, x),
            moment: G::ang_in(moment),
            force: G::vec_in(force),
        }
    }

    /// A wrench at a point of space on one link, its opposite there on the other.
    #[inline(always)]
    pub(super) fn pair(
        &self,
        on: &AttachmentPoint<G>,
        other: &AttachmentPoint<G>,
        x: Vec3<G::S>,
        moment: Vec3<G::S>,
        force: Vec3<G::S>,
    ) -> ForceApplication<G> {
        ForceApplication::Between(self.wrench_at(on, x, moment, force), self.wrench_at(other, x, -moment, -force))
    }
}

impl<G: Space<S = f64>> At<'_, G> {
    /// Largest speed that a link's material at a point of space can have while the rates of the link stay as they are:
    /// its reference point may move as fast as both motions allow now, and the point about it. Two points that move alike
    /// at both ends of a step may be far faster apart from each other in it.
    pub(super) fn fastest(&self, link: usize, x: Vec3<f64>) -> f64 {
        let arm = G::vec_to(self.arm_to(link, x));
        self.moving(link, x).norm() + 2.0 * self.spinning(link).norm() * arm.norm()
    }
}

/// No moment.
#[inline(always)]
pub(super) fn none<S: Scalar>() -> Vec3<S> {
    Vec3::zero()
}
