//! Characteristic lengths of a drawing: of the mechanism, and of a typical body.

use crate::spec::{Body, Coupling, Measure, Spec};
use partita_math::spatial::{Mat3, Vec3};
use partita_math::tolerance;
use std::collections::HashMap;

/// Points of bodies at which couplings and drives act, in the drawing, each with its body.
fn held_points(spec: &Spec) -> Vec<(&str, Vec3<f64>)> {
    let bodies: HashMap<&str, &Body> = spec.bodies.iter().map(|b| (b.name.as_str(), b)).collect();
    let drawn = |name: &str, p: [f64; 3]| match bodies.get(name) {
        Some(b) => Vec3(b.position) + Mat3(b.orientation).apply(Vec3(p)),
        None => Vec3(p),
    };
    let mut found = Vec::new();
    for m in spec.drives.iter().map(|d| &d.measure).chain(spec.couplings.iter().flat_map(Coupling::terms)) {
        if let Measure::Distance { body1, point1, body2, point2 }
        | Measure::Along { body1, point1, body2, point2, .. } = m
        {
            found.extend([(body1, point1), (body2, point2)].map(|(b, p)| (b.as_str(), drawn(b, *p))));
        }
    }
    for c in &spec.couplings {
        if let Coupling::Roll { body, center, normal, radius, on, .. } = c {
            // the centre, and as the point of contact one a radius off it
            let centre = drawn(body, *center);
            let down = (drawn(on, *normal) - drawn(on, [0.0; 3])).unit().unwrap_or(Vec3::zero());
            found.extend([(body.as_str(), centre), (body.as_str(), centre - down.times(*radius))]);
        }
    }
    found
}

/// Distances of the points of a body below this are errors of its drawing. Scale: fraction of its radius of gyration.
/// Reason: five digits; no body of smaller extent is so heavy around it.
const NO_EXTENT: f64 = 1e-5;

/// Radius of gyration of a body about its centre of mass; 0 without mass.
fn gyration(b: &Body) -> f64 {
    let trace: f64 = (0..3).map(|i| b.inertia[i][i]).sum();
    if b.mass > 0.0 && trace > 0.0 {
        (0.5 * trace / b.mass).sqrt()
    } else {
        0.0
    }
}

/// Diameter of all joints, held points and centres of mass about their mean, the same along any axes; 1 for a mechanism
/// in one point, which distances do not extend that are the rounding of its points, or below [`NO_EXTENT`] of
/// the radius of gyration of its bodies.
pub(crate) fn typical_length(spec: &Spec) -> f64 {
    let mut points: Vec<Vec3<f64>> = spec.joints.iter().map(|j| Vec3(j.point)).collect();
    points.extend(held_points(spec).iter().map(|(_, p)| *p));
    points.extend(spec.bodies.iter().map(|b| Vec3(b.position) + Mat3(b.orientation).apply(Vec3(b.com))));
    let d = diameter(&points);
    let farthest = points.iter().fold(0.0, |m: f64, p| m.max(p.norm()));
    let largest = spec.bodies.iter().map(gyration).fold(0.0, f64::max);
    let error = (tolerance::SOLUTION_ROUNDING * farthest).max(NO_EXTENT * largest);
    if d > error && d.is_finite() {
        d
    } else {
        1.0
    }
}

/// Twice the largest distance from the mean.
pub(crate) fn diameter(points: &[Vec3<f64>]) -> f64 {
    let sum = points.iter().fold(Vec3::zero(), |s, p| s + *p);
    let middle = sum.times(1.0 / points.len().max(1) as f64);
    2.0 * points.iter().fold(0.0, |m: f64, p| m.max((*p - middle).norm()))
}

/// The median, over the bodies that have one, of the diameter of a body's joints, held points and centre of mass about
/// their mean. Bodies smaller than [`tolerance::EQUAL`] of the whole have none, nor those smaller than the drawing
/// tolerance of the largest, or than [`NO_EXTENT`] of their own radius of gyration: a shoe with its hinge on its guide is
/// as long as the error of either.
pub(crate) fn body_length(spec: &Spec) -> Option<f64> {
    let index: HashMap<&str, usize> = spec.bodies.iter().enumerate().map(|(i, b)| (b.name.as_str(), i)).collect();
    let com = |b: &Body| Vec3(b.position) + Mat3(b.orientation).apply(Vec3(b.com));
    let mut points: Vec<Vec<Vec3<f64>>> = spec.bodies.iter().map(|b| vec![com(b)]).collect();
    for j in &spec.joints {
        for (name, point) in [(&j.parent, j.point), (&j.child, j.child_point.unwrap_or(j.point))] {
            if let Some(&i) = index.get(name.as_str()) {
                points[i].push(Vec3(point));
            }
        }
    }
    for (name, point) in held_points(spec) {
        if let Some(&i) = index.get(name) {
            points[i].push(point);
        }
    }
    let least = tolerance::EQUAL * typical_length(spec);
    let each = points.iter().zip(&spec.bodies).map(|(x, b)| (diameter(x), least.max(NO_EXTENT * gyration(b))));
    let mut extents: Vec<f64> = each.filter(|(x, least)| x > least && x.is_finite()).map(|(x, _)| x).collect();
    extents.sort_by(f64::total_cmp);
    let errors = spec.drawing_tolerance * extents.last().copied().unwrap_or(0.0);
    extents.retain(|x| *x > errors);
    extents.get(extents.len() / 2).copied()
}
