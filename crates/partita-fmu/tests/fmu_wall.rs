//! The wall to C from its outer side: what is missing, wrong or out of turn ends in a status, never in a crash.
#![allow(unsafe_code)]

use partita_fmu::fmi2::*;
use partita_fmu::fmi3::*;
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
        r#"{{"fmu":2,"guid":"{GUID}","model":{{"partita":1,"name":"p","gravity":[0,0,0],"drawing_tolerance":1e-4,
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

fn instance(name: &str, text: &str, kind: i32, guid: &str) -> *mut Instance {
    let path = folder(name, text);
    let uri = format!("file://{}", path.display()).replace(' ', "%20");
    let [name, guid, uri] = [name, guid, &uri].map(|x| CString::new(x).unwrap());
    // SAFETY: texts that outlive the call; no callbacks.
    let made = unsafe { fmi2Instantiate(name.as_ptr(), kind, guid.as_ptr(), uri.as_ptr(), null(), 0, 0) };
    std::fs::remove_dir_all(path).unwrap();
    made
}

/// The same by FMI 3.0: the folder by its path.
fn instance_3(name: &str, text: &str, events: u8, token: &str) -> *mut Instance {
    let path = folder(name, text);
    let [name, token, place] = [name, token, &format!("{}/", path.display())].map(|x| CString::new(x).unwrap());
    let (name, token, place) = (name.as_ptr(), token.as_ptr(), place.as_ptr());
    // SAFETY: texts that outlive the call; no callbacks.
    let made = unsafe {
        fmi3InstantiateCoSimulation(name, token, place, 0, 0, events, 1, null(), 0, null_mut(), None, null())
    };
    std::fs::remove_dir_all(path).unwrap();
    made
}

const EFFORT: &str = r#"{"kind":"effort","start":0.0}"#;

#[test]
fn a_pendulum_is_turned() {
    let c = instance("turned", &resource(EFFORT), 1, GUID);
    assert!(!c.is_null());
    assert_eq!(fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0), 0);
    let mut shown = [0.0; 2];
    // SAFETY: arrays of the lengths that are reported; the instance is alive until it is freed.
    unsafe {
        assert_eq!(fmi2EnterInitializationMode(c), 0);
        assert_eq!(fmi2ExitInitializationMode(c), 0);
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

/// The same pendulum by FMI 3.0, its outputs as one array.
#[test]
fn a_pendulum_is_turned_by_fmi_3() {
    let text = resource(EFFORT).replace("\"outputs\":", "\"arrays\":[[1,2]],\"outputs\":");
    let c = instance_3("turned by 3", &text, 0, GUID);
    assert!(!c.is_null());
    assert_eq!(fmi3EnterInitializationMode(c, 0, 0.0, 0.0, 0, 0.0), 0);
    let mut shown = [0.0; 3];
    let (mut flags, mut reached) = ([7_u8; 3], 7.0);
    let [events, terminate, early] = &mut flags;
    // SAFETY: arrays of the lengths that are reported; the instance is alive until it is freed.
    unsafe {
        assert_eq!(fmi3ExitInitializationMode(c), 0);
        assert_eq!(fmi3SetFloat64(c, [0].as_ptr(), 1, [3.0].as_ptr(), 1), 0);
        for k in 0..10 {
            let t = f64::from(k) * 0.1;
            assert_eq!(fmi3DoStep(c, t, 0.1, 1, events, terminate, early, &mut reached), 0);
            assert_eq!((*events, *terminate, *early, reached), (0, 0, 0, t + 0.1));
        }
        // the array, and the time after it
        assert_eq!(fmi3GetFloat64(c, [1, 3].as_ptr(), 2, shown.as_mut_ptr(), 3), 0);
        assert!((shown[0] - 0.75).abs() < 1e-9 && (shown[1] - 2.25).abs() < 1e-9, "{shown:?}");
        assert_eq!(shown[2], reached);
        // of a size that does not fit, of the middle of the array, of nothing; the time is not set
        for memory in [0, 1, 3] {
            assert_eq!(fmi3GetFloat64(c, [1].as_ptr(), 1, shown.as_mut_ptr(), memory), ERROR);
        }
        assert_eq!(fmi3GetFloat64(c, [2].as_ptr(), 1, shown.as_mut_ptr(), 1), ERROR);
        assert_eq!(fmi3GetFloat64(c, [4].as_ptr(), 1, shown.as_mut_ptr(), 1), ERROR);
        assert_eq!(fmi3GetFloat64(c, [u32::MAX].as_ptr(), 1, shown.as_mut_ptr(), 1), ERROR);
        assert_eq!(fmi3GetFloat64(c, null(), 1, shown.as_mut_ptr(), 1), ERROR);
        assert_eq!(fmi3GetFloat64(c, [0].as_ptr(), 1, null_mut(), 1), ERROR);
        assert_eq!(fmi3SetFloat64(c, [3].as_ptr(), 1, [1.0].as_ptr(), 1), ERROR);
        assert_eq!(fmi3SetFloat64(c, [0].as_ptr(), 1, null(), 1), ERROR);
        assert_eq!(fmi3GetFloat64(c, null(), 0, null_mut(), 0), 0);
        assert_eq!(fmi3GetBinary(c, null(), 0, null_mut(), null_mut(), 0), 0);
        assert_eq!(fmi3GetBinary(c, [0].as_ptr(), 1, null_mut(), null_mut(), 1), ERROR);
        assert_eq!(fmi3GetFMUState(c, null_mut()), ERROR);
        assert_eq!(fmi3SetFMUState(c, null_mut()), ERROR);
        assert_eq!(fmi3FreeFMUState(c, null_mut()), ERROR);
        assert_eq!(fmi3SerializedFMUStateSize(c, null_mut(), null_mut()), ERROR);
        assert_eq!(fmi3SerializeFMUState(c, null_mut(), null_mut(), 0), ERROR);
        assert_eq!(fmi3DeserializeFMUState(c, null(), 3, null_mut()), ERROR);
        assert_eq!(fmi3DoStep(c, 1.0, 0.1, 1, null_mut(), terminate, early, &mut reached), ERROR);
        assert_eq!(fmi3DoStep(c, 1.0, 0.1, 1, events, terminate, early, null_mut()), ERROR);
        // neither has made a step
        assert_eq!(fmi3DoStep(c, 1.0, 0.1, 1, events, terminate, early, &mut reached), 0);
        assert_eq!(fmi3Terminate(c), 0);
        assert_eq!(fmi3DoStep(c, 1.1, 0.1, 1, events, terminate, early, &mut reached), ERROR);
        fmi3FreeInstance(c);
    }
}

#[test]
fn arrays_that_do_not_fit_are_refused() {
    for arrays in ["[[1,3]]", "[[1,0]]", "[[1,2],[2,1]]", "[[18446744073709551615,2]]"] {
        let text = resource(EFFORT).replace("\"outputs\":", &format!("\"arrays\":{arrays},\"outputs\":"));
        assert!(instance_3("arrays", &text, 0, GUID).is_null(), "{arrays}");
    }
}

#[test]
fn what_is_missing_is_an_error() {
    // SAFETY: null pointers are what is tried.
    unsafe {
        assert!(fmi2Instantiate(null(), 1, null(), null(), null(), 0, 0).is_null());
        fmi2FreeInstance(null_mut());
        assert_eq!(fmi2GetReal(null_mut(), null(), 0, null_mut()), ERROR);
        let nothing = null();
        let (none, environment) = (None, null_mut());
        assert!(fmi3InstantiateCoSimulation(
            nothing,
            nothing,
            nothing,
            0,
            0,
            0,
            0,
            null(),
            0,
            environment,
            none,
            null()
        )
        .is_null());
        assert!(fmi3InstantiateModelExchange(nothing, nothing, nothing, 0, 0, environment, none).is_null());
        assert!(fmi3InstantiateScheduledExecution(
            nothing,
            nothing,
            nothing,
            0,
            0,
            environment,
            none,
            null(),
            null(),
            null()
        )
        .is_null());
        fmi3FreeInstance(null_mut());
        assert_eq!(fmi3GetFloat64(null_mut(), null(), 0, null_mut(), 0), ERROR);
        assert_eq!(fmi3DoStep(null_mut(), 0.0, 1.0, 0, null_mut(), null_mut(), null_mut(), null_mut()), ERROR);
    }
    assert_eq!(
        fmi3UpdateDiscreteStates(null_mut(), null_mut(), null_mut(), null_mut(), null_mut(), null_mut(), null_mut()),
        ERROR
    );
    assert!(instance_3("events", &resource(EFFORT), 1, GUID).is_null());
    assert!(instance_3("token", &resource(EFFORT), 0, "{b}").is_null());
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
