//! Friction in a joint coordinate.

use super::resistance::Slide;
use super::{At, Effect, Reading};
use crate::value::Source;
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;
use partita_system::SystemError;

/// Resists the rate of a joint coordinate: see [`Slide`](super::resistance).
#[derive(Clone, Debug)]
pub struct Friction<G: Space> {
    /// Name, for messages.
    pub name: String,
    /// The coordinate.
    pub along: Reading<G>,
    /// Level while it slides, and that which must be overcome, if there is another.
    pub levels: Vec<Source<G::S>>,
    /// Speed at which that is reached.
    pub stick: G::S,
}

impl<G: Space> Friction<G> {
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>, room: &mut Vec<f64>) -> Result<Effect<G>, SystemError> {
        let dynamic = self.levels[0].at(&at.instant, &self.name, room)?;
        let held = match self.levels.get(1) {
            Some(level) => level.at(&at.instant, &self.name, room)?,
            None => dynamic,
        };
        let read = self.along.read(at);
        let law = Slide { dynamic, held, stick: self.stick };
        let effort = -(law.per_speed(read.rate * read.rate) * read.rate);
        Ok(Effect { acts: self.along.acts(&read, effort), potential: G::S::zero(), power: effort * read.rate })
    }
}
