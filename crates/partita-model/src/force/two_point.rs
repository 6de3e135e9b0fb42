//! Loads along the line between two points: one law of their distance for each.
//!
//! ```text
//! distance, its rate ──► law ──► pull, potential, power          corners of the law ──► guards
//! ```

use super::resistance::{Buffer, Pressed};
use super::spot::{self, Spot};
use super::{At, Effect, ForceApplication};
use crate::numbers::Fields;
use crate::spec::{self, Force};
use partita_math::scalar::{Cases, Scalar};
use partita_math::spatial::{Space, Vec3};
use partita_system::watched::Reading;

/// A distance at which the pull begins to change otherwise.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    /// The distance (m).
    pub length: f64,
    /// Whether more acts where the points are farther apart, or nearer.
    pub farther: bool,
    /// Power of what begins there.
    pub exponent: f64,
}

/// The contract of a law between two points.
pub(crate) trait TwoPointLaw<S: Scalar> {
    /// Pull of the points towards each other at a distance and its rate, with its energies.
    fn pull(&self, distance: S, speed: S) -> Pressed<S>;
    /// Whether it does non-conservative work.
    fn is_dissipative(&self) -> bool;
}

/// Pulls where the points are farther apart than the length.
#[derive(Clone, Copy, Debug)]
pub struct Rope<S> {
    /// Length without tension (m).
    pub length: S,
    /// Tension over the stretch.
    pub buffer: Buffer<S>,
}

impl<S: Scalar> TwoPointLaw<S> for Rope<S> {
    #[inline(always)]
    fn pull(&self, distance: S, speed: S) -> Pressed<S> {
        self.buffer.pressed(distance - self.length, speed)
    }
    fn is_dissipative(&self) -> bool {
        self.buffer.damped
    }
}

/// Gas in a tube pushes the points apart: with the column `c = 1 − (length − distance)/column` the force is `force /
/// c^exponent`. Stops, if it has any, act beyond its length and its stroke.
#[derive(Clone, Copy, Debug)]
pub struct GasStrut<S> {
    /// Force at its full length (N).
    pub force: S,
    /// Full length (m).
    pub length: S,
    /// From there to full compression (m).
    pub stroke: S,
    /// Length of the column of gas at its full length (m).
    pub column: S,
    /// [N s/m].
    pub damping: S,
    /// Whether it has a damper.
    pub damped: bool,
    /// Exponent of the change of state, above 1.
    pub exponent: f64,
    /// Both stops.
    pub ends: Option<Buffer<S>>,
}

impl<S: Scalar> GasStrut<S> {
    fn new(x: &spec::GasStrut, n: &Fields<S>) -> Self {
        let (stroke, progression) = (n.number("stroke"), n.number("progression"));
        // of the column this part is left at full compression, where the force has grown by the progression
        let left = progression / progression.power(1.0 + 1.0 / x.exponent);
        Self {
            force: n.number("force"),
            length: n.number("length"),
            stroke,
            column: stroke / (S::one() - left),
            damping: n.number("damping"),
            damped: x.damping != 0.0,
            exponent: x.exponent,
            ends: x.end_stiffness.map(|_| Buffer {
                stiffness: n.number("end_stiffness"),
                damping: S::zero(),
                exponent: 1.0,
                damped: false,
            }),
        }
    }
}

impl<S: Scalar> TwoPointLaw<S> for GasStrut<S> {
    fn pull(&self, distance: S, speed: S) -> Pressed<S> {
        // an empty column would need an infinite force, and no step reaches it
        let column = (S::one() - (self.length - distance) / self.column).max(S::zero());
        let (push, drag) = (self.force / column.power(self.exponent), self.damping * speed);
        let stored = (push * self.column * column).scale(1.0 / (self.exponent - 1.0));
        let mut all = Pressed { push: drag - push, potential: stored, power: -(drag * speed) };
        if let Some(end) = &self.ends {
            let out = end.pressed(distance - self.length, speed);
            let within = end.pressed(self.length - self.stroke - distance, -speed);
            all.push += out.push - within.push;
            all.potential += out.potential + within.potential;
        }
        all
    }
    fn is_dissipative(&self) -> bool {
        self.damped
    }
}

/// The laws.
#[derive(Clone, Copy, Debug)]
pub enum Line<S> {
    /// A rope.
    Rope(Rope<S>),
    /// A gas strut.
    GasStrut(GasStrut<S>),
}

impl<S: Scalar> Line<S> {
    /// Of a force between two points.
    pub(super) fn new(force: &Force, n: &Fields<S>) -> Option<Self> {
        Some(match force {
            Force::Rope(x) => {
                Self::Rope(Rope { length: n.number("length"), buffer: Buffer::new(n, x.exponent, x.damping) })
            }
            Force::GasStrut(x) => Self::GasStrut(GasStrut::new(x, n)),
            _ => return None,
        })
    }

    fn as_law(&self) -> &dyn TwoPointLaw<S> {
        match self {
            Self::Rope(x) => x,
            Self::GasStrut(x) => x,
        }
    }

    /// Its kind in words.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Rope(_) => "rope",
            Self::GasStrut(_) => "gas strut",
        }
    }
}

impl Line<f64> {
    /// Where its slope jumps.
    pub(crate) fn corners(&self) -> [Option<Corner>; 2] {
        let corner = |length, farther, exponent| Some(Corner { length, farther, exponent });
        match self {
            // one that does not stretch is held by a row
            Self::Rope(x) if x.buffer.stiffness == 0.0 => [None; 2],
            Self::Rope(x) => [corner(x.length, true, x.buffer.exponent), None],
            Self::GasStrut(x) if x.ends.is_some() => {
                [corner(x.length, true, 1.0), corner(x.length - x.stroke, false, 1.0)]
            }
            Self::GasStrut(_) => [None; 2],
        }
    }
}

/// Two points that pull each other.
#[derive(Clone, Debug)]
pub struct TwoPoint<G: Space> {
    /// One end.
    pub a: Spot<G>,
    /// Other end.
    pub b: Spot<G>,
    /// The law.
    pub law: Line<G::S>,
}

impl<G: Space<S = f64>> TwoPoint<G> {
    /// Distance of the ends.
    pub(crate) fn distance(&self, at: &At<G>) -> f64 {
        (at.spot(&self.b) - at.spot(&self.a)).norm()
    }

    /// Of a corner at the length L `(L² − d²) / 2L` with the distance d of the ends, or its opposite, positive where what
    /// begins there does not act; its rate, how far it is from there, and the largest speed at which that changes.
    pub(crate) fn gap(&self, at: &At<G>, corner: &Corner) -> Reading {
        let (a, b) = (at.spot(&self.a), at.spot(&self.b));
        let (apart, length) = (b - a, corner.length);
        let moving = at.moving(self.b.attachment.link, b) - at.moving(self.a.attachment.link, a);
        let gap = (length * length - apart.dot(apart)) / (2.0 * length);
        let rate = -apart.dot(moving) / length;
        let speed = at.fastest(self.b.attachment.link, b) + at.fastest(self.a.attachment.link, a);
        let sign = if corner.farther { 1.0 } else { -1.0 };
        Reading { x: sign * gap, rate: sign * rate, apart: (length - apart.norm()).abs(), speed, terms: 0.0 }
    }
}

impl<G: Space> TwoPoint<G> {
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>) -> Effect<G> {
        let (one, two) = (&self.a.attachment, &self.b.attachment);
        let (a, b) = (at.spot(&self.a), at.spot(&self.b));
        let apart = b - a;
        let distance = apart.norm();
        let along = Vec3(apart.0.map(|x| x.over_or_zero(distance)));
        let speed = along.dot(at.moving(two.link, b) - at.moving(one.link, a));
        let pulled = self.law.as_law().pull(distance, speed);
        let force = along.times(pulled.push);
        let application = ForceApplication::Between(
            at.wrench_at(one, a, spot::none(), force),
            at.wrench_at(two, b, spot::none(), -force),
        );
        Effect { application, potential: pulled.potential, power: pulled.power }
    }

    /// Whether it does non-conservative work.
    pub fn is_dissipative(&self) -> bool {
        self.law.as_law().is_dissipative()
    }
}
