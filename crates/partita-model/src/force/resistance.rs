//! Laws that several elements share: compression and sliding resistance.

use crate::numbers::Fields;
use partita_math::scalar::Scalar;

/// Repulsion at a depth: `stiffness · depth^exponent · (1 + damping · speed)`, never less than 0, the speed counted
/// inward. It never pulls, and is continuous at the first touch (Hunt and Crossley 1975).
#[derive(Clone, Copy, Debug)]
pub struct Buffer<S> {
    /// Force at a unit of depth.
    pub stiffness: S,
    /// Growth with the speed inward.
    pub damping: S,
    /// Power of the depth, at least 1.
    pub exponent: f64,
    /// Whether it has damping.
    pub damped: bool,
}

/// Result of a buffer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pressed<S> {
    /// Its force.
    pub push: S,
    /// Its stored energy.
    pub potential: S,
    /// Power of the damping.
    pub power: S,
}

impl<S: Scalar> Buffer<S> {
    pub(super) fn new(n: &Fields<S>, exponent: f64, damping: f64) -> Self {
        Self { stiffness: n.number("stiffness"), damping: n.number("damping"), exponent, damped: damping != 0.0 }
    }

    #[inline(always)]
    pub(crate) fn pressed(&self, depth: S, speed: S) -> Pressed<S> {
        let depth = depth.max(S::zero());
        let elastic = self.stiffness * depth.power(self.exponent);
        let push = elastic * (S::one() + self.damping * speed).max(S::zero());
        let potential = (elastic * depth).scale(1.0 / (self.exponent + 1.0));
        Pressed { push, potential, power: -((push - elastic) * speed) }
    }
}

/// Smooth Coulomb friction: with `u` the speed over the stick velocity the resistance is
/// `dynamic · 4u/√(1 + 16u²) + (held − dynamic) · u/(¾ + ¼u²)²`.
///
/// The second part, largest (1) and level at `u = 1`, is that of Brown and McPhee (2016); a root, which every scalar
/// has, replaces their `tanh 4u`. At the stick velocity the resistance is `held − 0.03 dynamic`, at ten times that
/// speed `dynamic` to 0.4 per cent of the difference.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slide<S> {
    pub dynamic: S,
    pub held: S,
    pub stick: S,
}

impl<S: Scalar> Slide<S> {
    /// Resistance over speed, smooth everywhere, as a function of the squared speed.
    #[inline(always)]
    pub fn per_speed(&self, square: S) -> S {
        let stick2 = self.stick * self.stick;
        let run = self.dynamic.scale(4.0) / (stick2 + square.scale(16.0)).sqrt();
        let bump = S::from_f64(0.75) + (square / stick2).scale(0.25);
        run + (self.held - self.dynamic) / (self.stick * bump * bump)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_is_held_at_the_stick_velocity_and_dynamic_beyond() {
        let law = Slide { dynamic: 2.0, held: 3.0, stick: 0.01 };
        let at = |v: f64| v * law.per_speed(v * v);
        assert!((at(0.01) - (3.0 - 2.0 * (1.0 - 4.0 / 17.0_f64.sqrt()))).abs() < 1e-14);
        assert!((at(1.0) - 2.0).abs() < 1e-4 && (at(-1.0) + 2.0).abs() < 1e-4);
        // level where it is largest: of the second part the slope is 0 there
        let bump = |v: f64| at(v) - v * Slide { held: 2.0, ..law }.per_speed(v * v);
        assert!((bump(0.01) - 1.0).abs() < 1e-14 && ((bump(0.0101) - bump(0.0099)) / 0.0002).abs() < 1e-2 / 0.01);
        assert_eq!(at(0.0), 0.0);
    }

    #[test]
    fn a_buffer_never_pulls() {
        let law = Buffer { stiffness: 5.0, damping: 2.0, exponent: 1.5, damped: true };
        assert_eq!(law.pressed(0.04, -0.6).push, 0.0);
        assert_eq!(law.pressed(-0.04, 3.0).push, 0.0);
        let x = law.pressed(0.04, 0.25);
        assert!((x.push - 5.0 * 0.008 * 1.5).abs() < 1e-15 && (x.potential - 5.0 * 0.008 * 0.04 / 2.5).abs() < 1e-16);
        assert!((x.power + 5.0 * 0.008 * 0.5 * 0.25).abs() < 1e-15);
    }
}
