//! What a page asks and what it gets: by theory, not by what the core gave.

use partita_web::answers::answer;
use serde_json::{json, Value};

fn ask(question: &Value) -> Value {
    serde_json::from_str(&answer(&question.to_string())).unwrap()
}

/// A uniform rod of 1 kg and 1 m on a hinge in the ground, drawn level.
fn pendulum(extra: Value) -> Value {
    let mut mechanism = json!({
        "partita": 1, "name": "pendulum", "gravity": [0.0, -9.81, 0.0], "drawing_tolerance": 1e-4,
        "bodies": [{
            "name": "rod", "mass": 1.0, "com": [0.5, 0.0, 0.0],
            "inertia": [[0.0, 0.0, 0.0], [0.0, 1.0 / 12.0, 0.0], [0.0, 0.0, 1.0 / 12.0]],
            "position": [0.0, 0.0, 0.0], "orientation": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            "shape": { "kind": "rod", "length": 1.0 },
        }],
        "joints": [{
            "name": "A", "kind": "revolute", "parent": "ground", "child": "rod", "point": [0.0, 0.0, 0.0],
            "axis": [0.0, 0.0, 1.0], "cut": "auto",
        }],
        "couplings": [], "drives": [], "forces": [],
    });
    for (key, value) in extra.as_object().unwrap() {
        mechanism[key] = value.clone();
    }
    mechanism
}

#[test]
fn a_pendulum_is_examined_and_falls() {
    let found = ask(&json!({ "examine": { "mechanism": pendulum(json!({})) } }));
    assert_eq!(found["report"]["mobility"], 1);
    assert_eq!(found["report"]["redundancy"], "");
    assert_eq!(found["bodies"].as_array().unwrap().len(), 12);
    let run = ask(&json!({ "run": {
        "mechanism": pendulum(json!({})), "duration": 0.5, "outputs": 11, "rtol": 1e-12, "atol": 1e-13,
    } }));
    assert_eq!(run["success"], true, "{run}");
    assert_eq!(run["t"].as_array().unwrap().len(), 11);
    // let go level, a uniform rod weighs a quarter in its hinge, and its energy is kept
    assert!((run["force"][0][1].as_f64().unwrap() - 9.81 / 4.0).abs() < 1e-10);
    let (kinetic, potential) = (run["kinetic"][10].as_f64().unwrap(), run["potential"][10].as_f64().unwrap());
    assert!(kinetic > 1.0 && (kinetic + potential - run["potential"][0].as_f64().unwrap()).abs() < 1e-9);
    assert_eq!(run["determined"][0], json!([1.0, 1.0, 1.0, 1.0, 1.0, 1.0]));
}

#[test]
fn what_cannot_be_answered_is_said() {
    let apart = pendulum(json!({ "joints": [
        pendulum(json!({}))["joints"][0],
        {
            "name": "B", "kind": "revolute", "parent": "ground", "child": "rod", "point": [5.0, 0.0, 0.0],
            "axis": [0.0, 0.0, 1.0], "child_point": [1.0, 0.0, 0.0], "cut": "auto",
        },
    ] }));
    let found = ask(&json!({ "examine": { "mechanism": apart } }));
    assert_eq!(found["error"]["kind"], "open", "{found}");
    let wrong = pendulum(json!({ "bodies": [] }));
    let found = ask(&json!({ "examine": { "mechanism": wrong } }));
    assert_eq!(found["error"]["kind"], "refused");
    assert!(found["error"]["message"].as_str().unwrap().contains("no bodies"), "{found}");
    for nonsense in ["", "{}", "[1]", "{\"examine\": {}}", "{\"look\": 1}"] {
        let found: Value = serde_json::from_str(&answer(nonsense)).unwrap();
        assert_eq!(found["error"]["kind"], "refused", "{nonsense}");
    }
}
