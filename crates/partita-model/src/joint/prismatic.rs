//! One translation along an axis: two displacements and three rotations are locked.

use super::{axis_of, frame_about, parallel, LockedSlides, Motion, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;
use partita_math::spatial::Mat3;

pub(super) fn shape(joint: &Joint, carrier: &Mat3<f64>) -> Result<Shape, DescriptionError> {
    let z = axis_of(joint, joint.axis, "axis")?;
    let (x, y) = z.complement();
    Ok(Shape {
        motions: vec![Motion::Slide(z)],
        names: vec!["slide"],
        slides: LockedSlides::Along(vec![x, y]),
        locks: parallel(&Mat3::from_columns(x, y, z)),
        frame: frame_about(z, carrier),
        own: None,
    })
}
