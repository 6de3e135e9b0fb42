//! A translation and a rotation along one axis: two displacements and two rotations are locked.

use super::{axis_of, frame_about, LockedSlides, Motion, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;
use partita_math::spatial::Mat3;

pub(super) fn shape(joint: &Joint, carrier: &Mat3<f64>) -> Result<Shape, DescriptionError> {
    let z = axis_of(joint, joint.axis, "axis")?;
    let (x, y) = z.complement();
    Ok(Shape {
        motions: vec![Motion::Slide(z), Motion::Turn(z)],
        names: vec!["slide", "turn"],
        slides: LockedSlides::Along(vec![x, y]),
        locks: vec![(x, z), (y, z)],
        frame: frame_about(z, carrier),
        own: None,
    })
}
