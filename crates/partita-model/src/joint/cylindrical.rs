//! A translation and a rotation along one axis: two displacements and two rotations are locked.

use super::{axis_of, frame_about, LockedSlides, Motion, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;

pub(super) fn shape(joint: &Joint) -> Result<Shape, DescriptionError> {
    let z = axis_of(joint, joint.axis, "axis")?;
    let frame = frame_about(z);
    Ok(Shape {
        motions: vec![Motion::Slide(z), Motion::Turn(z)],
        names: vec!["slide", "turn"],
        slides: LockedSlides::Along(vec![frame.column(0), frame.column(1)]),
        locks: vec![(frame.column(0), z), (frame.column(1), z)],
        frame,
        own: None,
    })
}
