//! The functions of FMI 2.0 for co-simulation.
#![allow(unsafe_code)]
#![allow(missing_docs)] // what the functions do is said in the standard

use crate::instance::{
    self, failed, of_no_variable, operations, place, text, unsupported, with, Environment, Failed, FormattingLogger,
    Log, DISCARD, OK,
};
pub use crate::instance::{Instance, Reference, StoredState};
use crate::resources;
use crate::slave::Slave;
use std::ffi::{c_char, c_double, c_int, c_void};
use std::ptr;

type Boolean = c_int;

const CO_SIMULATION: c_int = 1;
const LAST_SUCCESSFUL_TIME: c_int = 2;

/// fmi2CallbackFunctions.
#[repr(C)]
pub struct Callbacks {
    logger: Option<FormattingLogger>,
    allocate: *const c_void,
    free: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

#[no_mangle]
pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[no_mangle]
pub extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// Warnings and errors are logged always; there is nothing else.
#[no_mangle]
pub extern "C" fn fmi2SetDebugLogging(
    instance: *mut Instance,
    _on: Boolean,
    _categories: usize,
    _names: *const *const c_char,
) -> c_int {
    with(instance, "fmi2SetDebugLogging", |_| Ok(OK))
}

/// # Safety
/// As specified by FMI.
#[no_mangle]
pub unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    guid: *const c_char,
    location: *const c_char,
    callbacks: *const Callbacks,
    _visible: Boolean,
    _logging: Boolean,
) -> *mut Instance {
    // SAFETY: null, or the environment's callbacks.
    let environment = match unsafe { callbacks.as_ref() } {
        Some(c) => Environment { log: c.logger.map_or(Log::Nowhere, Log::Formatting), own: c.environment },
        None => Environment { log: Log::Nowhere, own: ptr::null_mut() },
    };
    // SAFETY: null, or the environment's texts.
    let (guid, location) = unsafe { (text(guid), text(location)) };
    let open = || {
        if kind != CO_SIMULATION {
            return Err("this FMU supports co-simulation only".to_string());
        }
        let location = location.ok_or("the location of the resources is missing")?;
        Slave::open(&resources::path(location)?, guid.unwrap_or_default())
    };
    // SAFETY: as above.
    unsafe { instance::make("fmi2Instantiate", environment, name, open) }
}

/// # Safety
/// As specified by FMI.
#[no_mangle]
pub unsafe extern "C" fn fmi2FreeInstance(instance: *mut Instance) {
    // SAFETY: the caller's promise.
    unsafe { instance::free(instance) }
}

#[no_mangle]
pub extern "C" fn fmi2SetupExperiment(
    instance: *mut Instance,
    tolerance_defined: Boolean,
    tolerance: c_double,
    start: c_double,
    _stop_defined: Boolean,
    _stop: c_double,
) -> c_int {
    with(instance, "fmi2SetupExperiment", |it| it.begin((tolerance_defined != 0).then_some(tolerance), start))
}

/// # Safety
/// As specified by FMI.
#[no_mangle]
pub unsafe extern "C" fn fmi2GetReal(
    instance: *mut Instance,
    references: *const Reference,
    count: usize,
    values: *mut c_double,
) -> c_int {
    // SAFETY: the caller's promise.
    with(instance, "fmi2GetReal", |it| unsafe { it.get(references, count, values, count) })
}

/// # Safety
/// As specified by FMI.
#[no_mangle]
pub unsafe extern "C" fn fmi2SetReal(
    instance: *mut Instance,
    references: *const Reference,
    count: usize,
    values: *const c_double,
) -> c_int {
    // SAFETY: the caller's promise.
    with(instance, "fmi2SetReal", |it| unsafe { it.set(references, count, values, count) })
}

#[no_mangle]
pub extern "C" fn fmi2DoStep(instance: *mut Instance, t: c_double, step: c_double, _no_return: Boolean) -> c_int {
    with(instance, "fmi2DoStep", |it| it.step(t, step))
}

#[no_mangle]
pub extern "C" fn fmi2CancelStep(instance: *mut Instance) -> c_int {
    with(instance, "fmi2CancelStep", |_| Err(failed("steps complete before they return")))
}

/// # Safety
/// As specified by FMI.
#[no_mangle]
pub unsafe extern "C" fn fmi2GetRealStatus(instance: *mut Instance, kind: c_int, value: *mut c_double) -> c_int {
    with(instance, "fmi2GetRealStatus", |it| {
        // SAFETY: the caller's promise.
        let value = unsafe { place(value) }?;
        if kind != LAST_SUCCESSFUL_TIME {
            return Err(Failed(DISCARD, format!("there is no status {kind} of this type")));
        }
        *value = it.time();
        Ok(OK)
    })
}

operations! {
    fmi2EnterInitializationMode() = enter;
    fmi2ExitInitializationMode() = exit;
    fmi2Terminate() = terminate;
    fmi2Reset() = reset;
    fmi2SetRealInputDerivatives(
        references: *const Reference, count: usize, orders: *const c_int, values: *const c_double) = differentiate;
    fmi2GetFMUstate(kept: *mut *mut StoredState) = keep;
    fmi2SetFMUstate(kept: *mut StoredState) = restore;
    fmi2FreeFMUstate(kept: *mut *mut StoredState) = forget;
    fmi2SerializedFMUstateSize(kept: *mut StoredState, size: *mut usize) = size;
    fmi2SerializeFMUstate(kept: *mut StoredState, bytes: *mut u8, size: usize) = serialise;
    fmi2DeSerializeFMUstate(bytes: *const u8, size: usize, kept: *mut *mut StoredState) = deserialise;
}

of_no_variable! {
    fmi2GetInteger(values: *mut c_int);
    fmi2GetBoolean(values: *mut Boolean);
    fmi2GetString(values: *mut *const c_char);
    fmi2SetInteger(values: *const c_int);
    fmi2SetBoolean(values: *const Boolean);
    fmi2SetString(values: *const *const c_char);
}

unsupported! {
    fmi2GetDirectionalDerivative(
        unknowns: *const Reference, count: usize, knowns: *const Reference, known: usize, seed: *const c_double,
        result: *mut c_double);
    fmi2GetRealOutputDerivatives(
        references: *const Reference, count: usize, orders: *const c_int, values: *mut c_double);
    fmi2GetStatus(kind: c_int, value: *mut c_int);
    fmi2GetIntegerStatus(kind: c_int, value: *mut c_int);
    fmi2GetBooleanStatus(kind: c_int, value: *mut Boolean);
    fmi2GetStringStatus(kind: c_int, value: *mut *const c_char);
}
