//! Two translations in a plane and the rotation in it: one displacement and two rotations are locked.

use super::{axis_of, frame_about, LockedSlides, Motion, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;
use partita_math::spatial::Mat3;

pub(super) fn shape(joint: &Joint, carrier: &Mat3<f64>) -> Result<Shape, DescriptionError> {
    let z = axis_of(joint, joint.axis, "normal")?;
    let frame = frame_about(z, carrier);
    let (x, y) = (frame.column(0), frame.column(1));
    let across = z.complement();
    Ok(Shape {
        motions: vec![Motion::Slide(x), Motion::Slide(y), Motion::Turn(z)],
        names: vec!["x", "y", "turn"],
        slides: LockedSlides::Along(vec![z]),
        locks: vec![(across.0, z), (across.1, z)],
        frame,
        own: None,
    })
}
