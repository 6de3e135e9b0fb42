//! Planar mechanisms of slender links, drawn link by link.

use partita_model::place::Coordinates;
use partita_model::spec::Spec;
use partita_model::value::NoFunctions;
use partita_model::Model;
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
