//! Planarity of the loads of a planar mechanism.

use crate::joint::Motion;
use crate::spec::{Axes, Coupling, Force, Measure, Spec, Value, VectorValue};
use partita_math::spatial::{Mat3, Vec3};
use partita_math::tolerance;
use std::collections::HashMap;

/// Whether all reactions of a mechanism that moves in the plane with this `normal` (world, unit) lie in the plane for
/// every motion: masses, joints and forces lie in one plane up to round-off, and couplings and drives act along
/// coordinates.
pub(crate) fn loads_lie_in_plane(spec: &Spec, normal: [f64; 3]) -> bool {
    let along_coordinates = |m: &Measure| matches!(m, Measure::Joint { .. });
    let coupled = |c: &Coupling| !matches!(c, Coupling::Roll { .. }) && c.terms().iter().all(along_coordinates);
    spec.couplings.iter().all(coupled)
        && spec.drives.iter().all(|d| along_coordinates(&d.measure))
        && !loaded_across(spec, Vec3(normal))
        && lies_in_plane(spec, Vec3(normal), tolerance::PARALLEL)
}

/// Whether a friction needs reactions out of the plane with this `normal` (world, unit), which a planar model does not
/// have. `motion` returns how a coordinate of a joint moves.
///
/// A rotation is loaded by forces in the plane only, unless it has a collar or a length. So is a translation, provided
/// that no force pushes a body out of the plane and there is no arm for moments about its axis; one with a length,
/// which moments load, only if besides all masses, joints and forces lie in one plane.
pub(crate) fn needs_space(spec: &Spec, normal: [f64; 3], motion: impl Fn(&str, usize) -> Option<Motion>) -> bool {
    let leaves = || loaded_across(spec, Vec3(normal));
    spec.forces.iter().any(|f| match f {
        Force::Friction(x) => x.follows.as_ref().is_some_and(|follows| match motion(&x.joint, x.coordinate) {
            Some(Motion::Turn(_)) => follows.length.is_some() || follows.collar.is_some(),
            Some(Motion::Slide(_)) => {
                follows.radius.is_some()
                    || leaves()
                    || (follows.length.is_some() && !lies_in_plane(spec, Vec3(normal), tolerance::EQUAL))
            }
            Some(Motion::Ball) | None => false,
        }),
        _ => false,
    })
}

/// Whether masses, joints and forces lie in one plane to the fraction `level` of their characteristic displacement, so
/// that nothing rotates a body out of it.
fn lies_in_plane(spec: &Spec, normal: Vec3<f64>, level: f64) -> bool {
    let bodies: HashMap<&str, _> = spec.bodies.iter().map(|b| (b.name.as_str(), b)).collect();
    let height = |x: Vec3<f64>| (normal.dot(x), x.norm());
    // a point of a body, or of the ground
    let at = |body: &str, point: [f64; 3]| match bodies.get(body) {
        Some(b) => height(Vec3(b.position) + Mat3(b.orientation).apply(Vec3(point))),
        None => height(Vec3(point)),
    };
    let mut heights: Vec<(f64, f64)> = Vec::new();
    for j in &spec.joints {
        heights.extend(std::iter::once(j.point).chain(j.child_point).map(|x| height(Vec3(x))));
    }
    for f in &spec.forces {
        if let Force::Force(x) = f {
            heights.push(at(&x.body, x.point));
        }
        heights.extend(f.record().line().into_iter().flatten().map(|(body, point)| at(body, point)));
    }
    let mut straight = true;
    for b in &spec.bodies {
        if b.mass > 0.0 {
            heights.push(at(&b.name, b.com));
        }
        // products of inertia with the normal rotate a body out of the plane as it spins
        let own = Mat3(b.orientation).apply_transposed(normal);
        let spun = Mat3(b.inertia).apply(own);
        straight &= (spun - own.times(own.dot(spun))).norm() <= level * spun.norm();
    }
    let extent = heights.iter().fold(0.0f64, |m, x| m.max(x.1));
    let (low, high) = heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x.0), b.max(x.0)));
    straight && (heights.is_empty() || high - low <= level * extent)
}

/// Whether any load may act on a body out of the plane.
fn loaded_across(spec: &Spec, normal: Vec3<f64>) -> bool {
    let across = |x: Vec3<f64>| normal.dot(x).abs() > tolerance::PARALLEL * x.norm();
    let body = |name: &str| spec.bodies.iter().find(|b| b.name == name);
    let to_body = |name: &str| body(name).map_or(normal, |b| Mat3(b.orientation).apply_transposed(normal));
    let vector = |value: &VectorValue, normal: Vec3<f64>| match value {
        VectorValue::Whole(_) => true,
        VectorValue::Components(x) => {
            let parts = || x.iter().zip(normal.0).filter(|(_, n)| n.abs() > tolerance::PARALLEL);
            let constant = |(v, _): (&Value, f64)| if let Value::Constant(v) = v { Some(*v) } else { None };
            let size = parts().filter_map(constant).fold(0.0f64, |m, x| m.max(x.abs()));
            let sum: f64 = parts().filter_map(|(v, n)| constant((v, n)).map(|v| v * n)).sum();
            parts().any(|part| constant(part).is_none()) || sum.abs() > tolerance::PARALLEL * size
        }
    };
    let height = |name: &str, point: [f64; 3]| {
        let at = body(name).map_or(Vec3(point), |b| Vec3(b.position) + Mat3(b.orientation).apply(Vec3(point)));
        (normal.dot(at), at.norm())
    };
    // ends at different heights pull a body out of the plane
    let apart = |[one, two]: [(&str, [f64; 3]); 2]| {
        let ((a, x), (b, y)) = (height(one.0, one.1), height(two.0, two.1));
        (a - b).abs() > tolerance::EQUAL * x.max(y)
    };
    across(Vec3(spec.gravity))
        || spec.forces.iter().any(|f| match f {
            along if along.along().is_some() => false,
            Force::Weightless(_) => false,
            Force::Force(x) if x.axes == Axes::Body => vector(&x.value, to_body(&x.body)),
            Force::Force(x) => vector(&x.value, normal),
            Force::Gravity(x) => vector(&x.value, normal),
            other => other.record().line().is_none_or(apart),
        })
}
