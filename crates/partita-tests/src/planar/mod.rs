//! Planar mechanisms of slender links, drawn link by link.

use partita_model::spec::Spec;
use partita_model::value::NoFunctions;
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::record::Output;
use partita_system::reduction::largest;
use serde_json::{json, Value};
use std::sync::Arc;

/// A uniform slender link of 1 kg between two points.
pub fn link(name: &str, from: [f64; 2], to: [f64; 2]) -> Value {
    let length = (to[0] - from[0]).hypot(to[1] - from[1]);
    let (c, s) = ((to[0] - from[0]) / length, (to[1] - from[1]) / length);
    let j = length * length / 12.0;
    json!({ "name": name, "mass": 1.0, "com": [0.5 * length, 0.0, 0.0], "position": [from[0], from[1], 0.0],
            "inertia": [[0.0, 0.0, 0.0], [0.0, j, 0.0], [0.0, 0.0, j]],
            "orientation": [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]] })
}

/// A revolute joint across the plane.
pub fn pin(name: &str, parent: &str, child: &str, at: [f64; 2]) -> Value {
    json!({ "name": name, "kind": "revolute", "parent": parent, "child": child, "point": [at[0], at[1], 0.0],
            "axis": [0.0, 0.0, 1.0] })
}

/// In relative coordinates.
pub fn model(bodies: &[Value], joints: &[Value], gravity: [f64; 3]) -> Model {
    let spec: Spec = serde_json::from_value(json!({
        "partita": 1, "name": "planar", "gravity": gravity, "bodies": bodies, "joints": joints
    }))
    .unwrap();
    Model::new(spec, Arc::new(NoFunctions), Coordinates::Relative).unwrap()
}

/// `loops` equal four-bars side by side, all links of 1 m, uprights upright.
#[allow(dead_code, reason = "each test file uses the part it needs")]
pub fn chain(loops: usize) -> Model {
    let (mut bodies, mut joints) = (Vec::new(), Vec::new());
    for i in 0..=loops {
        let x = i as f64;
        bodies.push(link(&format!("u{i}"), [x, 0.0], [x, 1.0]));
        joints.push(pin(&format!("P{i}"), "ground", &format!("u{i}"), [x, 0.0]));
    }
    for i in 1..=loops {
        let x = i as f64;
        bodies.push(link(&format!("c{i}"), [x - 1.0, 1.0], [x, 1.0]));
        joints.push(pin(&format!("L{i}"), &format!("u{}", i - 1), &format!("c{i}"), [x - 1.0, 1.0]));
        joints.push(pin(&format!("R{i}"), &format!("c{i}"), &format!("u{i}"), [x, 1.0]));
    }
    model(&bodies, &joints, [0.0, -9.81, 0.0])
}

/// ((N+1)/3 + N) phi'' = ((N+1)/2 + N) g sin phi with phi'(0) = rate, by fine steps of the classical method of order
/// four.
#[allow(dead_code, reason = "each test file uses the part it needs")]
pub fn upright_angle(loops: usize, rate: f64, times: &[f64]) -> Vec<f64> {
    let n = loops as f64;
    let k = ((n + 1.0) / 2.0 + n) * 9.81 / ((n + 1.0) / 3.0 + n);
    let f = |p: f64| k * p.sin();
    let (mut p, mut w, mut t) = (0.0, rate, 0.0);
    let mut angles = Vec::new();
    for &end in times {
        // steps of 1e-4 s: an error of 1e-14, ten thousand times amplified
        let steps = (10_000.0 * (end - t)).ceil() as u32;
        let h = (end - t) / f64::from(steps);
        for _ in 0..steps {
            let k1 = (w, f(p));
            let k2 = (w + 0.5 * h * k1.1, f(p + 0.5 * h * k1.0));
            let k3 = (w + 0.5 * h * k2.1, f(p + 0.5 * h * k2.0));
            let k4 = (w + h * k3.1, f(p + h * k3.0));
            p += h / 6.0 * (k1.0 + 2.0 * k2.0 + 2.0 * k3.0 + k4.0);
            w += h / 6.0 * (k1.1 + 2.0 * k2.1 + 2.0 * k3.1 + k4.1);
        }
        t = end;
        angles.push(p);
    }
    angles
}

/// Largest |Φ| at an output; NaN counts as infinite.
#[allow(dead_code, reason = "each test file uses the part it needs")]
pub fn closure_error(model: &Model, s: &Output) -> f64 {
    let size = model.size();
    let (mut phi, mut c, mut a) = (vec![0.0; size.holonomic], vec![0.0; model.pattern().nnz()], vec![0.0; size.rows]);
    model.position(s.t, &s.q, &mut model.scratch(), &mut phi, &mut c, &mut a).unwrap();
    largest(phi)
}
