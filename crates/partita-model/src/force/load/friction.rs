//! Friction.

use super::{EffortArguments, Response, ScalarLaw};
use crate::force::resistance::Slide;
use crate::numbers::Fields;
use crate::spec;
use crate::value::Source;
use partita_math::scalar::Scalar;
use partita_system::SystemError;

/// Resists the rate: see `Slide` in `resistance.rs`.
#[derive(Clone, Debug)]
pub struct Friction<S> {
    /// Magnitude while it slides, and the static one, if it differs.
    pub levels: Vec<Source<S>>,
    /// The normal force, if it replaces given magnitudes.
    pub follows: Option<Bearing<S>>,
    /// Stick velocity.
    pub stick: S,
}

/// The sliding surfaces of a friction whose magnitude follows the reaction of the joint. With the axis a of the
/// coordinate, F and M the force and the moment of the joint about its point,
///
/// - across: `|F_a|` of the part of F across a; with a length L it is that of two short bearings at the ends, which
///   take the moment across a too, `|F_a/2 + M_a × a/L| + |F_a/2 − M_a × a/L|`;
/// - on a turn that times the radius, and `collar |F · a|`;
/// - on a slide that, and `|M · a| / radius`.
#[derive(Clone, Copy, Debug)]
pub struct Bearing<S> {
    /// Coefficient while it slides.
    pub coefficient: S,
    /// Static coefficient.
    pub held: S,
    /// Radius of a sliding rotation; for a translation, the arm that keeps it from rotating.
    pub radius: Option<S>,
    /// Length of the bearing along the axis.
    pub length: Option<S>,
    /// Radius at which the force along the axis of a rotation slides.
    pub collar: Option<S>,
    /// Constant normal force.
    pub preload: S,
    /// Its index among the reaction-dependent frictions.
    pub index: usize,
}

impl<S: Scalar> Friction<S> {
    pub(super) fn new(x: &spec::Friction, n: &Fields<S>) -> Self {
        let mut levels = vec![Source::new(&x.dynamic, n.field("dynamic").first())];
        levels.extend(x.held.as_ref().map(|v| Source::new(v, n.field("static").first())));
        let follows = x.follows.as_ref().map(|f| {
            let given = |what: Option<f64>, field| what.map(|_| n.number(field));
            let coefficient = n.number("coefficient");
            Bearing {
                coefficient,
                held: given(f.held, "static_coefficient").unwrap_or(coefficient),
                radius: given(f.radius, "radius"),
                length: given(f.length, "length"),
                collar: given(f.collar, "collar"),
                preload: n.number("preload"),
                index: 0,
            }
        });
        Self { levels, follows, stick: n.number("stick_velocity") }
    }

    /// The law of the speed between these magnitudes.
    #[inline(always)]
    pub(crate) fn law(&self, dynamic: S, held: S) -> Slide<S> {
        Slide { dynamic, held, stick: self.stick }
    }
}

impl<S: Scalar> ScalarLaw<S> for Friction<S> {
    fn respond(&self, asked: &EffortArguments<S>, plain: &mut Vec<f64>) -> Result<Response<S>, SystemError> {
        let (dynamic, held) = match &self.follows {
            Some(bearing) => {
                // zero before it is found
                let pressed = asked.normal_forces.get(bearing.index).copied().unwrap_or_default();
                (bearing.coefficient * pressed, bearing.held * pressed)
            }
            None => {
                let dynamic = self.levels[0].at(asked.instant, asked.name, plain)?;
                let held = match self.levels.get(1) {
                    Some(level) => level.at(asked.instant, asked.name, plain)?,
                    None => dynamic,
                };
                (dynamic, held)
            }
        };
        let effort = -(self.law(dynamic, held).per_speed(asked.rate * asked.rate) * asked.rate);
        Ok(Response { effort, potential: S::zero(), power: effort * asked.rate })
    }
    fn depends_on_value(&self) -> bool {
        false
    }
    fn sources(&self) -> &[Source<S>] {
        &self.levels
    }
}
