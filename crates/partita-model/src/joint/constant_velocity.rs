//! Two shafts that meet in a point at any angle and rotate equally fast: three locked displacements and one condition,
//! that the child is not twisted about the axis. It always closes a loop: its bending cannot be described by rotations
//! about axes of a tree.

use super::{axis_of, frame_about, LockedSlides, Own, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;
use partita_math::spatial::Mat3;

pub(super) fn shape(joint: &Joint, carrier: &Mat3<f64>) -> Result<Shape, DescriptionError> {
    let axis = axis_of(joint, joint.axis, "an axis: that of the aligned shafts")?;
    Ok(Shape {
        motions: vec![],
        names: vec![],
        slides: LockedSlides::All,
        locks: vec![],
        frame: frame_about(axis, carrier),
        own: Some(Own::Twist),
    })
}
