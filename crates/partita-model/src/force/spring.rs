//! Spring and damper between two points.

use super::{stored, AppliedWrench, At, AttachmentPoint, Effect, ForceApplication};
use partita_math::scalar::{Cases, Scalar};
use partita_math::spatial::Space;

/// Pulls two points towards each other by `stiffness (length − free) + damping · rate`.
#[derive(Clone, Copy, Debug)]
pub struct Spring<G: Space> {
    /// One end.
    pub a: AttachmentPoint<G>,
    /// Other end.
    pub b: AttachmentPoint<G>,
    /// From the origin of a's branch to that of b's. An end on the ground is its own origin.
    pub offset: G::Vec,
    /// Positions of ends on the ground, else 0.
    pub grounded: [G::Vec; 2],
    /// Constant distance out of the plane, squared.
    pub out_of_plane2: G::S,
    /// [N/m].
    pub stiffness: G::S,
    /// [N s/m].
    pub damping: G::S,
    /// Free length (m).
    pub length: G::S,
    /// Whether it has a damper.
    pub damped: bool,
}

impl<G: Space> Spring<G> {
    /// A spring of zero length has no direction.
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>) -> Effect<G> {
        let (ra, rb) = (at.arm(&self.a), at.arm(&self.b));
        let (xa, xb) = (&at.s.links[self.a.link], &at.s.links[self.b.link]);
        let gap = xb.centre + rb - xa.centre - ra + self.offset;
        let rate = xb.u + G::cross(xb.w, rb) - xa.u - G::cross(xa.w, ra);
        let length = (G::dot(gap, gap) + self.out_of_plane2).sqrt();
        let speed = G::dot(gap, rate).over_or_zero(length);
        let stretch = length - self.length;
        let tension = stretch * self.stiffness + speed * self.damping;
        let pull = G::scale(gap, tension.over_or_zero(length));
        let end = |e: &AttachmentPoint<G>, arm, force| AppliedWrench {
            node: e.node,
            link: e.link,
            arm,
            moment: G::Ang::default(),
            force,
        };
        Effect {
            application: ForceApplication::Between(
                end(&self.a, ra + self.grounded[0], pull),
                end(&self.b, rb + self.grounded[1], -pull),
            ),
            potential: stored(self.stiffness, stretch),
            power: -(self.damping * speed * speed),
        }
    }
}
