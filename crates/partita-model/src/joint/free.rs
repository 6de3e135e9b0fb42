//! All six: nothing is locked.

use super::{LockedSlides, Motion, Shape};
use partita_math::spatial::{Mat3, Vec3};

pub(super) fn shape() -> Shape {
    let e = |i: usize| Vec3::from_f64([0, 1, 2].map(|j| f64::from(u8::from(i == j))));
    Shape {
        motions: vec![Motion::Slide(e(0)), Motion::Slide(e(1)), Motion::Slide(e(2)), Motion::Ball],
        names: vec!["x", "y", "z", "ball"],
        slides: LockedSlides::Along(vec![]),
        locks: vec![],
        frame: Mat3::identity(),
        own: None,
    }
}
