//! Spatial rotation about a point: three displacements are locked.

use super::{LockedSlides, Motion, Shape};
use partita_math::spatial::Mat3;

pub(super) fn shape() -> Shape {
    Shape {
        motions: vec![Motion::Ball],
        names: vec!["ball"],
        slides: LockedSlides::All,
        locks: vec![],
        frame: Mat3::identity(),
        own: None,
    }
}
