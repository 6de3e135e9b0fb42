//! One rotation about an axis: three displacements and two rotations are locked.

use super::{axis_of, frame_about, LockedSlides, Motion, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;

pub(super) fn shape(joint: &Joint) -> Result<Shape, DescriptionError> {
    let z = axis_of(joint, joint.axis, "axis")?;
    let frame = frame_about(z);
    Ok(Shape {
        motions: vec![Motion::Turn(z)],
        names: vec!["turn"],
        slides: LockedSlides::All,
        locks: vec![(frame.column(0), z), (frame.column(1), z)],
        frame,
        own: None,
    })
}
