//! Spatial rotation about a point: three displacements are locked.

use super::{LockedSlides, Motion, Shape};
use partita_math::spatial::Mat3;

pub(super) fn shape(carrier: &Mat3<f64>) -> Shape {
    Shape {
        motions: vec![Motion::Ball],
        names: vec!["ball"],
        slides: LockedSlides::All,
        locks: vec![],
        frame: *carrier,
        own: None,
    }
}
