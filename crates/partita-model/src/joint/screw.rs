//! A rotation about an axis and the coupled advance along it: a cylindrical joint with a condition of its own.

use super::{cylindrical, Own, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;
use partita_math::spatial::Mat3;

pub(super) fn shape(joint: &Joint, carrier: &Mat3<f64>) -> Result<Shape, DescriptionError> {
    let fail = |message: String| Err(DescriptionError::new("joint", &joint.name, message));
    match joint.pitch {
        None => fail("a screw needs a pitch: its advance (m) per turn".into()),
        Some(pitch) if !pitch.is_finite() || pitch == 0.0 => {
            fail(format!("pitch = {pitch} m: a screw must advance; use a revolute joint instead"))
        }
        Some(pitch) => {
            let own = Some(Own::Advance(pitch / std::f64::consts::TAU));
            Ok(Shape { own, ..cylindrical::shape(joint, carrier)? })
        }
    }
}
