//! Friction in a joint coordinate.

use super::resistance::Slide;
use super::{At, Effect, Reading, Room};
use crate::value::Source;
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;
use partita_system::SystemError;

/// Resists the rate of a joint coordinate: see `Slide` in `resistance.rs`.
#[derive(Clone, Debug)]
pub struct Friction<G: Space> {
    /// Name, for messages.
    pub name: String,
    /// The coordinate.
    pub along: Reading<G>,
    /// Level while it slides, and that which must be overcome, if there is another.
    pub levels: Vec<Source<G::S>>,
    /// What presses instead of given levels.
    pub follows: Option<Bearing<G::S>>,
    /// Speed at which that is reached.
    pub stick: G::S,
}

/// What slides where the level follows the reaction of the joint. With the axis a of the coordinate, F and M the force
/// and the moment of the joint about its point,
///
/// - across: `|F_a|` of the part of F across a; with a length L it is that of two short bearings at the ends, which
///   take the moment across a too, `|F_a/2 + M_a × a/L| + |F_a/2 − M_a × a/L|`;
/// - on a turn that times the radius, and `collar |F · a|`;
/// - on a slide that, and `|M · a| / radius`.
#[derive(Clone, Copy, Debug)]
pub struct Bearing<S> {
    /// Coefficient while it slides.
    pub coefficient: S,
    /// Coefficient to be overcome.
    pub held: S,
    /// Where a turn slides; on a slide, the arm that holds it from turning.
    pub radius: Option<S>,
    /// Of the bearing along the axis.
    pub length: Option<S>,
    /// Where the force along the axis of a turn slides.
    pub collar: Option<S>,
    /// Constant normal force.
    pub preload: S,
    /// Its place among those that follow reactions.
    pub place: usize,
}

impl<G: Space> Friction<G> {
    /// The law of the speed between these levels.
    #[inline(always)]
    pub(crate) fn law(&self, dynamic: G::S, held: G::S) -> Slide<G::S> {
        Slide { dynamic, held, stick: self.stick }
    }

    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>, room: &mut Room<G>) -> Result<Effect<G>, SystemError> {
        let (dynamic, held) = match &self.follows {
            Some(bearing) => {
                // nothing before it is found
                let pressed = room.normal_forces.get(bearing.place).copied().unwrap_or_default();
                (bearing.coefficient * pressed, bearing.held * pressed)
            }
            None => {
                let dynamic = self.levels[0].at(&at.instant, &self.name, &mut room.plain)?;
                let held = match self.levels.get(1) {
                    Some(level) => level.at(&at.instant, &self.name, &mut room.plain)?,
                    None => dynamic,
                };
                (dynamic, held)
            }
        };
        let read = self.along.read(at);
        let effort = -(self.law(dynamic, held).per_speed(read.rate * read.rate) * read.rate);
        Ok(Effect {
            application: self.along.application(&read, effort),
            potential: G::S::zero(),
            power: effort * read.rate,
        })
    }
}
