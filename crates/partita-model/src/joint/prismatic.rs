//! One translation along an axis: two displacements and three rotations are locked.

use super::{axis_of, frame_about, parallel, LockedSlides, Motion, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;

pub(super) fn shape(joint: &Joint) -> Result<Shape, DescriptionError> {
    let z = axis_of(joint, joint.axis, "axis")?;
    let frame = frame_about(z);
    Ok(Shape {
        motions: vec![Motion::Slide(z)],
        names: vec!["slide"],
        slides: LockedSlides::Along(vec![frame.column(0), frame.column(1)]),
        locks: parallel(&frame),
        frame,
        own: None,
    })
}
