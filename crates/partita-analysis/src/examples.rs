//! Mechanisms whose mobility and redundancy are known.

use partita_math::spatial::{Mat3, Vec3};
use partita_model::spec::JointKind::{Prismatic, Revolute};
use partita_model::spec::{Body, Drive, Joint, JointKind, Level, Measure, Spec, Value, DRAWING_TOLERANCE, VERSION};
use partita_model::value::NoFunctions;
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use std::sync::Arc;

pub const Z: [f64; 3] = [0.0, 0.0, 1.0];

pub fn empty(name: &str) -> Spec {
    Spec {
        partita: VERSION,
        name: name.into(),
        gravity: [0.0, -9.81, 0.0],
        drawing_tolerance: DRAWING_TOLERANCE,
        bodies: vec![],
        joints: vec![],
        couplings: vec![],
        drives: vec![],
        forces: vec![],
        rotors: vec![],
        sights: vec![],
        parting: std::collections::BTreeMap::new(),
    }
}

pub fn body(name: &str, from: [f64; 3], to: [f64; 3]) -> Body {
    let e = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    Body {
        name: name.into(),
        mass: 1.0,
        com: [0, 1, 2].map(|i| 0.5 * (to[i] - from[i])),
        inertia: [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.08]],
        position: from,
        orientation: e,
        shape: None,
    }
}

pub fn joint(name: &str, kind: JointKind, parent: &str, child: &str, point: [f64; 3], axis: [f64; 3]) -> Joint {
    Joint { axis: Some(axis), ..Joint::new(name, kind, parent, child, point) }
}

pub fn drive(name: &str, joint: &str) -> Drive {
    let coefficients = vec![[0.0, 0.0, 1.0, 0.0]];
    let table = partita_model::spec::Table { breaks: vec![0.0, 1.0], coefficients };
    Drive::new(name, Measure::joint(joint, 0), Value::Table(table), Level::Position)
}

/// Rotate everything by the same generic rotation.
pub fn tilted(mut spec: Spec) -> Spec {
    let axis = Vec3([0.3, -0.5, 0.8]).unit().unwrap();
    let r = Mat3::about(axis, 1.1_f64.sin(), 1.1_f64.cos());
    let turn = |x: [f64; 3]| r.apply(Vec3(x)).0;
    for b in &mut spec.bodies {
        b.position = turn(b.position);
        b.orientation = r.mul(&Mat3(b.orientation)).0;
    }
    for j in &mut spec.joints {
        j.point = turn(j.point);
        j.axis = j.axis.map(turn);
    }
    spec
}

/// Benchmark 9, before it is tilted; kinds of the joints A, B, C, D.
pub fn four_bar(kinds: [JointKind; 4]) -> Spec {
    let (b, d) = ([60_f64.to_radians().cos(), 60_f64.to_radians().sin(), 0.0], [3.0, 0.0, 0.0]);
    // C at 3 from B and 2.5 from D
    let (dx, dy) = (d[0] - b[0], d[1] - b[1]);
    let far = dx.hypot(dy);
    let along = (far * far + 9.0 - 6.25) / (2.0 * far);
    let across = (9.0 - along * along).sqrt();
    let c = [b[0] + (along * dx - across * dy) / far, b[1] + (along * dy + across * dx) / far, 0.0];
    let mut spec = empty("four-bar");
    spec.bodies = vec![body("crank", [0.0; 3], b), body("coupler", b, c), body("rocker", d, c)];
    spec.joints = vec![
        joint("A", kinds[0], "ground", "crank", [0.0; 3], Z),
        joint("B", kinds[1], "crank", "coupler", b, Z),
        joint("C", kinds[2], "coupler", "rocker", c, Z),
        joint("D", kinds[3], "ground", "rocker", d, Z),
    ];
    spec
}

/// Benchmark 2: n loops, uprights at the given angle from the vertical.
pub fn chain(n: usize, angle: f64) -> Spec {
    let mut spec = empty("chain");
    let top = |i: usize| [i as f64 + angle.sin(), angle.cos(), 0.0];
    for i in 0..=n {
        let pin = [i as f64, 0.0, 0.0];
        spec.bodies.push(body(&format!("upright{i}"), pin, top(i)));
        spec.joints.push(joint(&format!("A{i}"), JointKind::Revolute, "ground", &format!("upright{i}"), pin, Z));
    }
    for i in 0..n {
        let coupler = format!("coupler{i}");
        spec.bodies.push(body(&coupler, top(i), top(i + 1)));
        let (left, right) = (format!("upright{i}"), format!("upright{}", i + 1));
        spec.joints.push(joint(&format!("B{i}"), JointKind::Revolute, &left, &coupler, top(i), Z));
        spec.joints.push(joint(&format!("C{i}"), JointKind::Revolute, &right, &coupler, top(i + 1), Z));
    }
    spec
}

/// A closed chain of revolutes through the points, the first and the last on the ground.
pub fn ring(points: &[[f64; 3]], axes: &[[f64; 3]]) -> Spec {
    let mut spec = empty("ring");
    let last = points.len() - 1;
    let name = |i: usize| if i == 0 || i > last { "ground".into() } else { format!("rod{i}") };
    for i in 1..=last {
        spec.bodies.push(body(&name(i), points[i - 1], points[i]));
    }
    for (i, (p, a)) in points.iter().zip(axes).enumerate() {
        spec.joints.push(joint(&format!("P{i}"), JointKind::Revolute, &name(i), &name(i + 1), *p, *a));
    }
    spec
}

/// Benchmark 4.
pub fn bricard() -> Spec {
    let points = [[0, 0, 0], [1, 0, 0], [1, -1, 0], [1, -1, 1], [0, -1, 1], [0, 0, 1]];
    let axes = [[0, 1, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 0]];
    ring(&points.map(|p| p.map(f64::from)), &axes.map(|a| a.map(f64::from)))
}

/// Four revolutes whose axes meet in the origin.
pub fn spherical_four_bar() -> Spec {
    let points = [[1.0, 0.0, 0.1], [0.7, 0.6, 0.5], [-0.2, 1.1, 0.6], [-0.3, 0.9, -0.4]];
    ring(&points, &points)
}

pub fn model(spec: Spec) -> Model {
    compiled(spec, Coordinates::Relative)
}

pub fn compiled(spec: Spec, coordinates: Coordinates) -> Model {
    Model::new(spec, Arc::new(NoFunctions), coordinates).unwrap()
}

/// A stretched slider-crank: the velocity of its slider is zero.
pub fn stretched_slider_crank() -> Spec {
    let mut spec = empty("slider-crank");
    let (b, c) = ([1.0, 0.0, 0.0], [3.0, 0.0, 0.0]);
    spec.bodies = vec![body("crank", [0.0; 3], b), body("rod", b, c), body("slider", c, [3.5, 0.0, 0.0])];
    spec.joints = vec![
        joint("A", Revolute, "ground", "crank", [0.0; 3], Z),
        joint("B", Revolute, "crank", "rod", b, Z),
        joint("S", Prismatic, "ground", "slider", c, [1.0, 0.0, 0.0]),
        joint("C", Revolute, "rod", "slider", c, Z),
    ];
    spec
}
