//! Two rotations, the first about an axis fixed on the parent, the second about one fixed on the child: three
//! displacements and the angle between the axes are locked.

use super::{axis_of, LockedSlides, Motion, Shape};
use crate::error::DescriptionError;
use crate::spec::Joint;
use partita_math::spatial::Mat3;
use partita_math::tolerance;

pub(super) fn shape(joint: &Joint) -> Result<Shape, DescriptionError> {
    let a = axis_of(joint, joint.axis, "axis1")?;
    let b = axis_of(joint, joint.axis2, "axis2")?;
    let z = a.cross(b);
    let Some(z) = z.unit().filter(|_| z.norm() > tolerance::AXES_CROSS) else {
        let message = format!("axis1 and axis2 are parallel ({:?}, {:?}); they must be at an angle", a.0, b.0);
        return Err(DescriptionError::new("joint", &joint.name, message));
    };
    Ok(Shape {
        motions: vec![Motion::Turn(a), Motion::Turn(b)],
        names: vec!["turn1", "turn2"],
        slides: LockedSlides::All,
        locks: vec![(a, b)],
        frame: Mat3::from_columns(a, z.cross(a), z),
        own: None,
    })
}
