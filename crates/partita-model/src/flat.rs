//! Whether what presses a friction lies in the plane of a mechanism that moves in one.

use crate::joint::Motion;
use crate::spec::{Axes, Force, Spec, Value, VectorValue};
use partita_math::spatial::{Mat3, Vec3};

/// Parts below this are the round-off of a drawing.
const IN_PLANE: f64 = 1e-12;
/// Heights closer than this part of the reach are one, as for joints that are to fit in a plane.
const LEVEL: f64 = 1e-9;

/// Does a friction need what a mechanism that moves across `normal` (world, unit) has no rows for? `motion` tells how a
/// coordinate of a joint moves.
///
/// A turn is pressed in the plane, unless it has a collar or a length. A slide is, as long as nothing pushes any body out of the
/// plane, and it has no arm to be turned about its axis by; one with a length, which moments press, if all masses, joints and
/// forces lie in one plane besides.
pub(crate) fn needs_space(spec: &Spec, normal: [f64; 3], motion: impl Fn(&str, usize) -> Option<Motion>) -> bool {
    let leaves = || pushed_across(spec, Vec3(normal));
    spec.forces.iter().any(|f| match f {
        Force::Friction(x) => x.follows.as_ref().is_some_and(|follows| match motion(&x.joint, x.coordinate) {
            Some(Motion::Turn(_)) => follows.length.is_some() || follows.collar.is_some(),
            Some(Motion::Slide(_)) => {
                follows.radius.is_some() || leaves() || (follows.length.is_some() && !lies_flat(spec, Vec3(normal)))
            }
            Some(Motion::Ball) | None => false,
        }),
        _ => false,
    })
}

/// Do masses, joints and forces lie in one plane, so that nothing turns a body out of it?
fn lies_flat(spec: &Spec, normal: Vec3<f64>) -> bool {
    let mut heights: Vec<(f64, f64)> =
        spec.joints.iter().map(|j| (normal.dot(Vec3(j.point)), Vec3(j.point).norm())).collect();
    let mut straight = true;
    for b in &spec.bodies {
        let rot = Mat3(b.orientation);
        let at = |point: [f64; 3]| {
            let x = Vec3(b.position) + rot.apply(Vec3(point));
            (normal.dot(x), x.norm())
        };
        if b.mass > 0.0 {
            heights.push(at(b.com));
        }
        heights.extend(spec.forces.iter().filter_map(|f| match f {
            Force::Force { body, point, .. } if *body == b.name => Some(at(*point)),
            _ => None,
        }));
        // products of inertia with the normal turn a body out of the plane as it spins
        let own = rot.apply_transposed(normal);
        let spun = Mat3(b.inertia).apply(own);
        straight &= (spun - own.times(own.dot(spun))).norm() <= LEVEL * spun.norm();
    }
    let reach = heights.iter().fold(0.0f64, |m, x| m.max(x.1));
    let (low, high) = heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x.0), b.max(x.0)));
    straight && (heights.is_empty() || high - low <= LEVEL * reach)
}

/// May anything push a body across the plane?
fn pushed_across(spec: &Spec, normal: Vec3<f64>) -> bool {
    let across = |x: Vec3<f64>| normal.dot(x).abs() > IN_PLANE * x.norm();
    let body = |name: &str| spec.bodies.iter().find(|b| b.name == name);
    let to_body = |name: &str| body(name).map_or(normal, |b| Mat3(b.orientation).apply_transposed(normal));
    let vector = |value: &VectorValue, normal: Vec3<f64>| match value {
        VectorValue::Whole(_) => true,
        VectorValue::Components(x) => {
            let parts = || x.iter().zip(normal.0).filter(|(_, n)| n.abs() > IN_PLANE);
            let constant = |(v, _): (&Value, f64)| if let Value::Constant(v) = v { Some(*v) } else { None };
            let size = parts().filter_map(constant).fold(0.0f64, |m, x| m.max(x.abs()));
            let sum: f64 = parts().filter_map(|(v, n)| constant((v, n)).map(|v| v * n)).sum();
            parts().any(|part| constant(part).is_none()) || sum.abs() > IN_PLANE * size
        }
    };
    let height = |name: &str, point: [f64; 3]| {
        let at = body(name).map_or(Vec3(point), |b| Vec3(b.position) + Mat3(b.orientation).apply(Vec3(point)));
        (normal.dot(at), at.norm())
    };
    across(Vec3(spec.gravity))
        || spec.forces.iter().any(|f| match f {
            Force::TorsionSpring { .. } | Force::Torque { .. } | Force::Friction(_) | Force::Stop(_) => false,
            Force::Weightless(_) => false,
            Force::Force { value, axes: Axes::Body, body, .. } => vector(value, to_body(body)),
            Force::Force { value, .. } => vector(value, normal),
            Force::Gravity(x) => vector(&x.value, normal),
            Force::Spring { body1, point1, body2, point2, .. } => {
                let ((a, x), (b, y)) = (height(body1, *point1), height(body2, *point2));
                (a - b).abs() > LEVEL * x.max(y)
            }
            Force::Bushing(_) | Force::Contact(_) | Force::Tyre(_) | Force::Law(_) => true,
        })
}
