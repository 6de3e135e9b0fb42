//! Any subset of three translations and three rotations in a given frame.

use super::{parallel, LockedSlides, Motion, Shape};
use crate::error::DescriptionError;
use crate::spec::{Joint, JointKind};
use partita_math::spatial::{Mat3, Vec3};
use partita_math::tolerance;

const NAMES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// A joint given by its free directions in a frame.
pub(super) fn freeing(joint: &Joint, free: &[&str], frame: &Mat3<f64>) -> Result<Shape, DescriptionError> {
    let free = Some(free.iter().map(|f| f.to_string()).collect());
    shape(&Joint { kind: JointKind::Generic, free, frame: Some(frame.0), ..joint.clone() })
}

pub(super) fn shape(joint: &Joint) -> Result<Shape, DescriptionError> {
    let fail = |message: String| DescriptionError::new("joint", &joint.name, message);
    let given = joint.free.as_deref().unwrap_or(&[]);
    let mut free = [false; 6];
    for name in given {
        let i = NAMES
            .iter()
            .position(|n| n == name)
            .ok_or_else(|| fail(format!("\"{name}\" is not a direction; choose among {}", NAMES.join(", "))))?;
        if std::mem::replace(&mut free[i], true) {
            return Err(fail(format!("direction \"{name}\" is named twice")));
        }
    }
    let frame = Mat3(joint.frame.unwrap_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]));
    let product = frame.transpose().mul(&frame);
    let off = (0..9).fold(0.0, |m: f64, i| m.max((product.0[i / 3][i % 3] - f64::from(u8::from(i % 4 == 0))).abs()));
    let turned = frame.column(0).cross(frame.column(1)).dot(frame.column(2));
    if !(off < tolerance::EQUAL && turned > 0.0) {
        return Err(fail(format!(
            "frame is not a rotation (off by {off:.1e}, determinant {turned:.3}); orthogonalise it"
        )));
    }
    let e = [frame.column(0), frame.column(1), frame.column(2)];
    let mut motions = Vec::new();
    let mut names = Vec::new();
    let mut locked: Vec<Vec3<f64>> = Vec::new();
    for i in 0..3 {
        if free[i] {
            motions.push(Motion::Slide(e[i]));
            names.push(NAMES[i]);
        } else {
            locked.push(e[i]);
        }
    }
    let turns: Vec<usize> = (0..3).filter(|&i| free[3 + i]).collect();
    let locks = match turns.as_slice() {
        [] => parallel(&frame),
        [z] => vec![(e[(z + 1) % 3], e[*z]), (e[(z + 2) % 3], e[*z])],
        [a, b] => vec![(e[*a], e[*b])],
        _ => vec![],
    };
    if turns.len() == 3 {
        motions.push(Motion::Ball);
        names.push("ball");
    } else {
        for &i in &turns {
            motions.push(Motion::Turn(e[i]));
            names.push(NAMES[3 + i]);
        }
    }
    let slides = if locked.len() == 3 { LockedSlides::All } else { LockedSlides::Along(locked) };
    Ok(Shape { motions, names, slides, locks, frame, own: None })
}
