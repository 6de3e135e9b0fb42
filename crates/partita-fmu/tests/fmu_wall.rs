//! The wall to C from its outer side: what is missing, wrong or out of turn ends in a status, never in a crash.
#![allow(unsafe_code)]

use partita_fmu::interface::*;
use partita_fmu::resources;
use std::ffi::CString;
use std::path::PathBuf;
use std::ptr::{null, null_mut};

const ERROR: i32 = 3;
const GUID: &str = "{a}";

/// A pendulum of length 1 m on a hinge that an effort turns, without gravity: its angle is u t^2 / 2 / (m l^2).
fn resource(inputs: &str) -> String {
    let body = r#"{"name":"bob","mass":2.0,"com":[1.0,0.0,0.0],"inertia":[[0,0,0],[0,0,0],[0,0,0]],"position":[0,0,0],
        "orientation":[[1,0,0],[0,1,0],[0,0,1]],"shape":{"kind":"auto"}}"#;
    let joint =
        r#"{"name":"A","kind":"revolute","parent":"ground","child":"bob","point":[0,0,0],"axis":[0,0,1],"cut":"auto"}"#;
    let torque = r#"{"kind":"torque","name":"u","joint":"A","coordinate":0,"value":{"function":0}}"#;
    let options = r#"{"t0":0.0,"t_end":1.0,"rtol":1e-10,"atol":1e-12,"method":"dop853","formulation":"projective",
        "correction":"partition","switch_threshold":1.25,"max_steps":100000,"selection":"collective","renew":0.5}"#;
    format!(
        r#"{{"fmu":1,"guid":"{GUID}","model":{{"partita":1,"name":"p","gravity":[0,0,0],"drawing_tolerance":1e-4,
        "bodies":[{body}],"joints":[{joint}],"couplings":[],"drives":[],"forces":[{torque}]}},"options":{options},
        "start":{{"t":0.0,"q":[0.0],"v":[0.0]}},"inputs":[{inputs}],
        "outputs":[{{"what":"position","joint":"A","component":0}},{{"what":"kinetic"}}]}}"#
    )
}

fn folder(name: &str, text: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("partita fmu {} {name}", std::process::id()));
    std::fs::create_dir_all(&path).unwrap();
    std::fs::write(path.join("model.json"), text).unwrap();
    path
}

fn instance(name: &str, text: &str, kind: i32, guid: &str) -> *mut Component {
    let path = folder(name, text);
    let uri = format!("file://{}", path.display()).replace(' ', "%20");
    let [name, guid, uri] = [name, guid, &uri].map(|x| CString::new(x).unwrap());
    // SAFETY: texts that outlive the call; no callbacks.
    let made = unsafe { fmi2Instantiate(name.as_ptr(), kind, guid.as_ptr(), uri.as_ptr(), null(), 0, 0) };
    std::fs::remove_dir_all(path).unwrap();
    made
}

const EFFORT: &str = r#"{"kind":"effort","start":0.0}"#;

#[test]
fn a_pendulum_is_turned() {
    let c = instance("turned", &resource(EFFORT), 1, GUID);
    assert!(!c.is_null());
    assert_eq!(fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0), 0);
    assert_eq!(fmi2EnterInitializationMode(c), 0);
    assert_eq!(fmi2ExitInitializationMode(c), 0);
    let mut shown = [0.0; 2];
    // SAFETY: arrays of the lengths that are reported; the instance is alive until it is freed.
    unsafe {
        assert_eq!(fmi2SetReal(c, [0].as_ptr(), 1, [3.0].as_ptr()), 0);
        for k in 0..10 {
            assert_eq!(fmi2DoStep(c, f64::from(k) * 0.1, 0.1, 1), 0);
        }
        assert_eq!(fmi2GetReal(c, [1, 2].as_ptr(), 2, shown.as_mut_ptr()), 0);
        // u t^2 / (2 m l^2) and (u t)^2 / (2 m l^2)
        assert!((shown[0] - 0.75).abs() < 1e-9 && (shown[1] - 2.25).abs() < 1e-9, "{shown:?}");
        assert_eq!(fmi2GetReal(c, null(), 1, shown.as_mut_ptr()), ERROR);
        assert_eq!(fmi2GetReal(c, [1].as_ptr(), 1, null_mut()), ERROR);
        assert_eq!(fmi2SetReal(c, [0].as_ptr(), 1, null()), ERROR);
        assert_eq!(fmi2GetFMUstate(c, null_mut()), ERROR);
        assert_eq!(fmi2SetFMUstate(c, null_mut()), ERROR);
        assert_eq!(fmi2SerializedFMUstateSize(c, null_mut(), null_mut()), ERROR);
        assert_eq!(fmi2SerializeFMUstate(c, null_mut(), null_mut(), 0), ERROR);
        assert_eq!(fmi2DeSerializeFMUstate(c, null(), 3, null_mut()), ERROR);
        fmi2FreeInstance(c);
    }
}

#[test]
fn what_is_missing_is_an_error() {
    // SAFETY: null pointers are what is tried.
    unsafe {
        assert!(fmi2Instantiate(null(), 1, null(), null(), null(), 0, 0).is_null());
        fmi2FreeInstance(null_mut());
        assert_eq!(fmi2GetReal(null_mut(), null(), 0, null_mut()), ERROR);
    }
    assert_eq!(fmi2DoStep(null_mut(), 0.0, 1.0, 0), ERROR);
    assert!(instance("switch_threshold", &resource(EFFORT), 0, GUID).is_null());
    assert!(instance("guid", &resource(EFFORT), 1, "{b}").is_null());
    assert!(instance("empty", "", 1, GUID).is_null());
    // a function that no input stands for
    assert!(instance("inputs", &resource(""), 1, GUID).is_null());
}

#[test]
fn uris_are_paths() {
    for (uri, wanted) in [
        ("file:///tmp/a%20b/%C3%A9", "/tmp/a b/é"),
        ("file://localhost/tmp/x", "/tmp/x"),
        ("file:/tmp/x", "/tmp/x"),
        ("/tmp/x", "/tmp/x"),
    ] {
        assert_eq!(resources::path(uri), Ok(PathBuf::from(wanted)));
    }
    for uri in ["http://example.org/x", "file:///tmp/%", "file:///tmp/%zz", "file:///%ff"] {
        assert!(resources::path(uri).is_err(), "{uri}");
    }
}
