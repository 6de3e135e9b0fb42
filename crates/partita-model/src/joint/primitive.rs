//! Single conditions: a point on a line or in a plane, axes parallel or at a right angle, all axes parallel.

use super::generic::freeing;
use super::{at_right_angle, axis_of, frame_about, LockedSlides, Motion, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;
use partita_math::spatial::Mat3;

pub(super) fn point_on_line(joint: &Joint, carrier: &Mat3<f64>) -> Result<Shape, DescriptionError> {
    let axis = axis_of(joint, joint.axis, "an axis: the direction of the line")?;
    freeing(joint, &["z", "rx", "ry", "rz"], &frame_about(axis, carrier))
}

pub(super) fn point_on_plane(joint: &Joint, carrier: &Mat3<f64>) -> Result<Shape, DescriptionError> {
    let normal = axis_of(joint, joint.axis, "a normal")?;
    freeing(joint, &["x", "y", "rx", "ry", "rz"], &frame_about(normal, carrier))
}

pub(super) fn parallel(joint: &Joint, carrier: &Mat3<f64>) -> Result<Shape, DescriptionError> {
    let axis = axis_of(joint, joint.axis, "an axis")?;
    freeing(joint, &["x", "y", "z", "rz"], &frame_about(axis, carrier))
}

pub(super) fn perpendicular(joint: &Joint, carrier: &Mat3<f64>) -> Result<Shape, DescriptionError> {
    let first = axis_of(joint, joint.axis, "an axis on the parent")?;
    let second = axis_of(joint, joint.axis2, "an axis on the child")?;
    at_right_angle(joint, first, second)?;
    let frame = frame_about(first, carrier);
    let [x, y, z] = [0, 1, 2].map(|i| frame.column(i));
    Ok(Shape {
        motions: [x, y, z].map(Motion::Slide).into_iter().chain([first, second].map(Motion::Turn)).collect(),
        names: vec!["x", "y", "z", "turn1", "turn2"],
        slides: LockedSlides::Along(vec![]),
        locks: vec![(first, second)],
        frame,
        own: None,
    })
}

pub(super) fn orientation(joint: &Joint) -> Result<Shape, DescriptionError> {
    let frame = joint.frame.map_or_else(Mat3::identity, Mat3);
    freeing(joint, &["x", "y", "z"], &frame)
}
