//! Coordinates of a joint from the relative pose of its two sides (for joints that close loops).

use super::Motion;
use partita_math::spatial::{Mat3, Quaternion, Vec3};

/// Signed angle about `axis` from `a` to `b`.
fn angle_about(axis: Vec3<f64>, a: Vec3<f64>, b: Vec3<f64>) -> f64 {
    let (a, b) = (a - axis.times(axis.dot(a)), b - axis.times(axis.dot(b)));
    axis.dot(a.cross(b)).atan2(a.dot(b))
}

/// Coordinates from the rotation `r` of the child and the displacement `p` of its point, both relative to the parent,
/// in the axes of the drawing. Rotations are in (−π, π].
pub fn position_of(motions: &[Motion], r: &Mat3<f64>, p: Vec3<f64>, out: &mut Vec<f64>) {
    let turns: Vec<Vec3<f64>> =
        motions.iter().filter_map(|m| if let Motion::Turn(a) = m { Some(*a) } else { None }).collect();
    // r = R(a1, θ1) R(a2, θ2): θ1 takes a2 to r a2, θ2 is the remainder
    let (mut rest, mut angles) = (*r, Vec::new());
    for (i, &a) in turns.iter().enumerate() {
        let probe = match turns.get(i + 1) {
            Some(&next) => next,
            None => a.complement().0,
        };
        let angle = angle_about(a, probe, rest.apply(probe));
        angles.push(angle);
        rest = Mat3::about(a, (-angle).sin(), angle.cos()).mul(&rest);
    }
    let mut angles = angles.into_iter();
    for m in motions {
        match m {
            Motion::Slide(a) => out.push(a.dot(p)),
            Motion::Turn(_) => out.extend(angles.next()),
            Motion::Ball => out.extend(Quaternion::from_matrix(r).0),
        }
    }
}

/// Rates from the relative angular velocity `w` and the displacement rate `v` (parent axes of the drawing) at the
/// rotation `r`.
pub fn rate_of(motions: &[Motion], r: &Mat3<f64>, position: &[f64], w: Vec3<f64>, v: Vec3<f64>, out: &mut Vec<f64>) {
    // the present axis of each rotation
    let mut axes: Vec<Vec3<f64>> = Vec::new();
    let mut so_far = Mat3::identity();
    for (m, &q) in motions.iter().zip(position) {
        if let Motion::Turn(a) = m {
            axes.push(so_far.apply(*a));
            so_far = so_far.mul(&Mat3::about(*a, q.sin(), q.cos()));
        }
    }
    let rates: Vec<f64> = match axes.as_slice() {
        [a] => vec![a.dot(w)],
        [a, b] => {
            // least squares in the plane of the two axes
            let c = a.dot(*b);
            let (x, y, d) = (a.dot(w), b.dot(w), 1.0 - c * c);
            vec![(x - c * y) / d, (y - c * x) / d]
        }
        _ => vec![],
    };
    let mut rates = rates.into_iter();
    for m in motions {
        match m {
            Motion::Slide(a) => out.push(a.dot(v)),
            Motion::Turn(_) => out.extend(rates.next()),
            Motion::Ball => out.extend(r.apply_transposed(w).0),
        }
    }
}
