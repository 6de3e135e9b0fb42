//! Effort by a curve over a measurement: gas force over crank angle.

use super::{EffortArguments, Response, ScalarLaw};
use crate::spec::Table;
use crate::value::{self, Abscissa};
use partita_math::scalar::Scalar;
use partita_math::tolerance;
use partita_system::SystemError;
use std::f64::consts::TAU;

/// An effort that is a curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// The curve.
    pub curve: Table,
    /// Whether it is periodic.
    pub periodic: bool,
}

impl<S: Scalar> ScalarLaw<S> for Curve {
    fn respond(&self, asked: &EffortArguments<S>, _: &mut Vec<f64>) -> Result<Response<S>, SystemError> {
        let abscissa = if self.periodic { Abscissa::Periodic } else { Abscissa::Known };
        let [effort, _, _] = value::curve_at(&self.curve, abscissa, asked.x, asked.name)?;
        Ok(Response { effort, potential: S::zero(), power: effort * asked.rate })
    }
    fn turns(&self) -> Option<(S, f64)> {
        (!(self.periodic && each_turn(&self.curve))).then_some((S::zero(), tolerance::HALF_TURN))
    }
}

/// Whether a periodic curve repeats after a whole turn.
fn each_turn(curve: &Table) -> bool {
    let (Some(first), Some(last)) = (curve.breaks.first(), curve.breaks.last()) else { return true };
    let times = TAU / (last - first);
    times.round() >= 1.0 && (times - times.round()).abs() <= tolerance::EQUAL * times
}
