//! No motion: everything is locked.

use super::{parallel, LockedSlides, Shape};
use partita_math::spatial::Mat3;

pub(super) fn shape(carrier: &Mat3<f64>) -> Shape {
    Shape {
        motions: vec![],
        names: vec![],
        slides: LockedSlides::All,
        locks: parallel(&Mat3::identity()),
        frame: *carrier,
        own: None,
    }
}
