//! A rope between two points: it pulls where it is taut, and is slack otherwise.

use super::resistance::Buffer;
use super::spot::{self, Spot};
use super::{At, Effect, ForceApplication};
use partita_math::scalar::Cases;
use partita_math::spatial::{Space, Vec3};

/// Pulls two points towards each other where they are farther apart than the length.
#[derive(Clone, Debug)]
pub struct Rope<G: Space> {
    /// One end.
    pub a: Spot<G>,
    /// Other end.
    pub b: Spot<G>,
    /// Length without tension (m).
    pub length: G::S,
    /// Tension over the stretch.
    pub buffer: Buffer<G::S>,
}

impl<G: Space<S = f64>> Rope<G> {
    /// `(L² − d²) / 2L` with the distance d of the ends and the length L, positive where it is slack; its rate, how far
    /// it is from becoming taut or slack, and the speed of one end as the other sees it.
    pub(crate) fn gap(&self, at: &At<G>) -> [f64; 4] {
        let (a, b) = (at.spot(&self.a), at.spot(&self.b));
        let apart = b - a;
        let moving = at.moving(self.b.attachment.link, b) - at.moving(self.a.attachment.link, a);
        let gap = (self.length * self.length - apart.dot(apart)) / (2.0 * self.length);
        let fastest = at.fastest(self.b.attachment.link, b) + at.fastest(self.a.attachment.link, a);
        [gap, -apart.dot(moving) / self.length, self.length - apart.norm(), fastest]
    }
}

impl<G: Space> Rope<G> {
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>) -> Effect<G> {
        let (one, two) = (&self.a.attachment, &self.b.attachment);
        let (a, b) = (at.spot(&self.a), at.spot(&self.b));
        let apart = b - a;
        let distance = apart.norm();
        let along = Vec3(apart.0.map(|x| x.over_or_zero(distance)));
        let speed = along.dot(at.moving(two.link, b) - at.moving(one.link, a));
        let pulled = self.buffer.pressed(distance - self.length, speed);
        let force = along.times(pulled.push);
        let application = ForceApplication::Between(
            at.wrench_at(one, a, spot::none(), force),
            at.wrench_at(two, b, spot::none(), -force),
        );
        Effect { application, potential: pulled.potential, power: pulled.power }
    }
}
