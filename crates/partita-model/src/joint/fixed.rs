//! No motion: everything is locked.

use super::{parallel, LockedSlides, Shape};
use partita_math::spatial::Mat3;

pub(super) fn shape() -> Shape {
    let frame = Mat3::identity();
    Shape { motions: vec![], names: vec![], slides: LockedSlides::All, locks: parallel(&frame), frame, own: None }
}
