//! Compliant ends of a joint coordinate.

use super::resistance::Buffer;
use super::{At, Effect, Reading};
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;
use partita_system::SystemError;

/// Pushes a joint coordinate back when it passes an end.
#[derive(Clone, Debug)]
pub struct Stop<G: Space> {
    /// Name, for messages.
    pub name: String,
    /// The coordinate.
    pub along: Reading<G>,
    /// Where it begins to push forward.
    pub lower: Option<G::S>,
    /// Where it begins to push back.
    pub upper: Option<G::S>,
    /// Half way between the ends, and how far from there the coordinate is known.
    pub middle: (G::S, f64),
    /// Both ends.
    pub buffer: Buffer<G::S>,
}

impl<G: Space> Stop<G> {
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>) -> Result<Effect<G>, SystemError> {
        let read = self.along.read(at);
        self.along.known(&self.name, read.value - self.middle.0, self.middle.1)?;
        let (mut effort, mut potential, mut power) = (G::S::zero(), G::S::zero(), G::S::zero());
        if let Some(lower) = self.lower {
            let x = self.buffer.pressed(lower - read.value, -read.rate);
            effort += x.push;
            potential += x.potential;
            power += x.power;
        }
        if let Some(upper) = self.upper {
            let x = self.buffer.pressed(read.value - upper, read.rate);
            effort -= x.push;
            potential += x.potential;
            power += x.power;
        }
        Ok(Effect { application: self.along.application(&read, effort), potential, power })
    }
}
