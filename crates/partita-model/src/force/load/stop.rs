//! Compliant ends.

use super::{EffortArguments, Response, ScalarLaw};
use crate::force::resistance::Buffer;
use crate::numbers::Fields;
use crate::spec;
use partita_math::scalar::Scalar;
use partita_math::tolerance;
use partita_system::SystemError;
use std::f64::consts::PI;

/// Pushes a value back beyond an end.
#[derive(Clone, Debug)]
pub struct Stop<S> {
    /// Lower end, where it begins to push forward.
    pub lower: Option<S>,
    /// Upper end, where it begins to push back.
    pub upper: Option<S>,
    /// Both ends.
    pub buffer: Buffer<S>,
    /// Middle between the ends, and the half width of the range in which an angle is read.
    middle: (S, f64),
}

impl<S: Scalar> Stop<S> {
    pub(super) fn new(x: &spec::Stop, n: &Fields<S>) -> Self {
        let end = |given: Option<f64>, field| given.map(|_| n.number(field));
        let (lower, upper) = (end(x.lower, "lower"), end(x.upper, "upper"));
        let middle = match (lower, upper) {
            (Some(a), Some(b)) => (a + b).scale(0.5),
            (a, b) => a.or(b).unwrap_or_default(),
        };
        let half = x.lower.zip(x.upper).map_or(0.0, |(a, b)| 0.5 * (b - a));
        // beyond an end there is room for its compression
        let within = tolerance::HALF_TURN.max(0.5 * (half + PI));
        Self { lower, upper, buffer: Buffer::new(n, x.exponent, x.damping), middle: (middle, within) }
    }
}

impl<S: Scalar> ScalarLaw<S> for Stop<S> {
    fn respond(&self, asked: &EffortArguments<S>, _: &mut Vec<f64>) -> Result<Response<S>, SystemError> {
        let (mut effort, mut potential, mut power) = (S::zero(), S::zero(), S::zero());
        if let Some(lower) = self.lower {
            let x = self.buffer.pressed(lower - asked.x, -asked.rate);
            effort += x.push;
            potential += x.potential;
            power += x.power;
        }
        if let Some(upper) = self.upper {
            let x = self.buffer.pressed(asked.x - upper, asked.rate);
            effort -= x.push;
            potential += x.potential;
            power += x.power;
        }
        Ok(Response { effort, potential, power })
    }
    fn is_dissipative(&self) -> bool {
        self.buffer.damped
    }
    fn turns(&self) -> Option<(S, f64)> {
        Some(self.middle)
    }
}
