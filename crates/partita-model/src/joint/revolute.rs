//! One rotation about an axis: three displacements and two rotations are locked.

use super::{axis_of, frame_about, LockedSlides, Motion, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;
use partita_math::spatial::Mat3;

pub(super) fn shape(joint: &Joint, carrier: &Mat3<f64>) -> Result<Shape, DescriptionError> {
    let z = axis_of(joint, joint.axis, "axis")?;
    let (x, y) = z.complement();
    Ok(Shape {
        motions: vec![Motion::Turn(z)],
        names: vec!["turn"],
        slides: LockedSlides::All,
        locks: vec![(x, z), (y, z)],
        frame: frame_about(z, carrier),
        own: None,
    })
}
