//! A pin in a slot: a translation along the slot, fixed on the parent, then a rotation about the pin, fixed on the
//! child.

use super::{at_right_angle, axis_of, generic, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;
use partita_math::spatial::Mat3;

pub(super) fn shape(joint: &Joint) -> Result<Shape, DescriptionError> {
    let slot = axis_of(joint, joint.axis, "axis1: the direction of the slot")?;
    let pin = axis_of(joint, joint.axis2, "axis2: the axis of the pin")?;
    at_right_angle(joint, slot, pin)?;
    let across = pin.cross(slot);
    let across = across.times(1.0 / across.norm());
    generic::freeing(joint, &["x", "rz"], &Mat3::from_columns(slot, across, slot.cross(across)))
}
