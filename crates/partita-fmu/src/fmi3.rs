//! The functions of FMI 3.0, for co-simulation.
//!
//! An array is one variable; its value reference is the number of its first value. A truth value is a byte here: as a
//! `bool`, any byte but 0 and 1 would be undefined behaviour.
#![allow(unsafe_code)]
#![allow(missing_docs)] // what the functions do is said in the standard

use crate::instance::{
    self, of_no_variable, operations, place, text, unsupported, with, Environment, Log, PlainLogger, OK,
};
pub use crate::instance::{Instance, Reference, StoredState};
use crate::slave::Slave;
use std::ffi::{c_char, c_double, c_int, c_void};
use std::path::Path;

type Boolean = u8;
type Binary = *const u8;
/// A function of the environment that is never called.
type Callback = *const c_void;

const ONLY: &str = "this FMU supports co-simulation only";

fn environment(own: *mut c_void, log: Option<PlainLogger>) -> Environment {
    Environment { log: log.map_or(Log::Nowhere, Log::Plain), own }
}

#[no_mangle]
pub extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

/// Warnings and errors are logged always; there is nothing else.
#[no_mangle]
pub extern "C" fn fmi3SetDebugLogging(
    instance: *mut Instance,
    _on: Boolean,
    _categories: usize,
    _names: *const *const c_char,
) -> c_int {
    with(instance, "fmi3SetDebugLogging", |_| Ok(OK))
}

/// # Safety
/// As specified by FMI.
#[no_mangle]
pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: Boolean,
    _logging: Boolean,
    events: Boolean,
    _early_return: Boolean,
    _intermediate: *const Reference,
    _intermediates: usize,
    own: *mut c_void,
    log: Option<PlainLogger>,
    _intermediate_update: Callback,
) -> *mut Instance {
    // SAFETY: null, or the environment's texts.
    let (token, resources) = unsafe { (text(token), text(resources)) };
    let open = || {
        if events != 0 {
            return Err("this FMU has no event mode".to_string());
        }
        let resources = resources.ok_or("the path of the resources is missing")?;
        Slave::open(Path::new(resources), token.unwrap_or_default())
    };
    // SAFETY: as above.
    unsafe { instance::make("fmi3InstantiateCoSimulation", environment(own, log), name, open) }
}

/// # Safety
/// As specified by FMI.
#[no_mangle]
pub unsafe extern "C" fn fmi3InstantiateModelExchange(
    name: *const c_char,
    _token: *const c_char,
    _resources: *const c_char,
    _visible: Boolean,
    _logging: Boolean,
    own: *mut c_void,
    log: Option<PlainLogger>,
) -> *mut Instance {
    // SAFETY: null, or the environment's text.
    unsafe { instance::make("fmi3InstantiateModelExchange", environment(own, log), name, || Err(ONLY.into())) }
}

/// # Safety
/// As specified by FMI.
#[no_mangle]
pub unsafe extern "C" fn fmi3InstantiateScheduledExecution(
    name: *const c_char,
    _token: *const c_char,
    _resources: *const c_char,
    _visible: Boolean,
    _logging: Boolean,
    own: *mut c_void,
    log: Option<PlainLogger>,
    _clock_update: Callback,
    _lock: Callback,
    _unlock: Callback,
) -> *mut Instance {
    // SAFETY: null, or the environment's text.
    unsafe { instance::make("fmi3InstantiateScheduledExecution", environment(own, log), name, || Err(ONLY.into())) }
}

/// # Safety
/// As specified by FMI.
#[no_mangle]
pub unsafe extern "C" fn fmi3FreeInstance(instance: *mut Instance) {
    // SAFETY: the caller's promise.
    unsafe { instance::free(instance) }
}

#[no_mangle]
pub extern "C" fn fmi3EnterInitializationMode(
    instance: *mut Instance,
    tolerance_defined: Boolean,
    tolerance: c_double,
    start: c_double,
    _stop_defined: Boolean,
    _stop: c_double,
) -> c_int {
    with(instance, "fmi3EnterInitializationMode", |it| {
        it.begin((tolerance_defined != 0).then_some(tolerance), start)?;
        it.enter()
    })
}

/// # Safety
/// As specified by FMI.
#[no_mangle]
pub unsafe extern "C" fn fmi3DoStep(
    instance: *mut Instance,
    t: c_double,
    step: c_double,
    _no_return: Boolean,
    events: *mut Boolean,
    terminate: *mut Boolean,
    early: *mut Boolean,
    reached: *mut c_double,
) -> c_int {
    with(instance, "fmi3DoStep", |it| {
        // SAFETY: the caller's promise.
        let (events, terminate, early, reached) =
            unsafe { (place(events)?, place(terminate)?, place(early)?, place(reached)?) };
        // a step is done to its end or not at all
        (*events, *terminate, *early) = (0, 0, 0);
        let done = it.step(t, step);
        *reached = it.time();
        done
    })
}

operations! {
    fmi3ExitInitializationMode() = exit;
    fmi3Terminate() = terminate;
    fmi3Reset() = reset;
    fmi3GetFloat64(references: *const Reference, count: usize, values: *mut c_double, memory: usize) = get;
    fmi3SetFloat64(references: *const Reference, count: usize, values: *const c_double, memory: usize) = set;
    fmi3GetFMUState(kept: *mut *mut StoredState) = keep;
    fmi3SetFMUState(kept: *mut StoredState) = restore;
    fmi3FreeFMUState(kept: *mut *mut StoredState) = forget;
    fmi3SerializedFMUStateSize(kept: *mut StoredState, size: *mut usize) = size;
    fmi3SerializeFMUState(kept: *mut StoredState, bytes: *mut u8, size: usize) = serialise;
    fmi3DeserializeFMUState(bytes: *const u8, size: usize, kept: *mut *mut StoredState) = deserialise;
}

of_no_variable! {
    fmi3GetFloat32(values: *mut f32, memory: usize);
    fmi3GetInt8(values: *mut i8, memory: usize);
    fmi3GetUInt8(values: *mut u8, memory: usize);
    fmi3GetInt16(values: *mut i16, memory: usize);
    fmi3GetUInt16(values: *mut u16, memory: usize);
    fmi3GetInt32(values: *mut i32, memory: usize);
    fmi3GetUInt32(values: *mut u32, memory: usize);
    fmi3GetInt64(values: *mut i64, memory: usize);
    fmi3GetUInt64(values: *mut u64, memory: usize);
    fmi3GetBoolean(values: *mut Boolean, memory: usize);
    fmi3GetString(values: *mut *const c_char, memory: usize);
    fmi3GetBinary(sizes: *mut usize, values: *mut Binary, memory: usize);
    fmi3GetClock(values: *mut Boolean);
    fmi3SetFloat32(values: *const f32, memory: usize);
    fmi3SetInt8(values: *const i8, memory: usize);
    fmi3SetUInt8(values: *const u8, memory: usize);
    fmi3SetInt16(values: *const i16, memory: usize);
    fmi3SetUInt16(values: *const u16, memory: usize);
    fmi3SetInt32(values: *const i32, memory: usize);
    fmi3SetUInt32(values: *const u32, memory: usize);
    fmi3SetInt64(values: *const i64, memory: usize);
    fmi3SetUInt64(values: *const u64, memory: usize);
    fmi3SetBoolean(values: *const Boolean, memory: usize);
    fmi3SetString(values: *const *const c_char, memory: usize);
    fmi3SetBinary(sizes: *const usize, values: *const Binary, memory: usize);
    fmi3SetClock(values: *const Boolean);
}

unsupported! {
    fmi3EnterEventMode();
    fmi3EnterStepMode();
    fmi3EnterConfigurationMode();
    fmi3ExitConfigurationMode();
    fmi3GetNumberOfVariableDependencies(reference: Reference, count: *mut usize);
    fmi3GetVariableDependencies(
        dependent: Reference, elements: *mut usize, independents: *mut Reference, others: *mut usize,
        kinds: *mut c_int, count: usize);
    fmi3GetDirectionalDerivative(
        unknowns: *const Reference, count: usize, knowns: *const Reference, known: usize, seed: *const c_double,
        seeds: usize, result: *mut c_double, results: usize);
    fmi3GetAdjointDerivative(
        unknowns: *const Reference, count: usize, knowns: *const Reference, known: usize, seed: *const c_double,
        seeds: usize, result: *mut c_double, results: usize);
    fmi3GetOutputDerivatives(
        references: *const Reference, count: usize, orders: *const i32, values: *mut c_double, memory: usize);
    fmi3GetIntervalDecimal(
        references: *const Reference, count: usize, intervals: *mut c_double, qualifiers: *mut c_int);
    fmi3GetIntervalFraction(
        references: *const Reference, count: usize, counters: *mut u64, resolutions: *mut u64,
        qualifiers: *mut c_int);
    fmi3GetShiftDecimal(references: *const Reference, count: usize, shifts: *mut c_double);
    fmi3GetShiftFraction(references: *const Reference, count: usize, counters: *mut u64, resolutions: *mut u64);
    fmi3SetIntervalDecimal(references: *const Reference, count: usize, intervals: *const c_double);
    fmi3SetIntervalFraction(
        references: *const Reference, count: usize, counters: *const u64, resolutions: *const u64);
    fmi3SetShiftDecimal(references: *const Reference, count: usize, shifts: *const c_double);
    fmi3SetShiftFraction(references: *const Reference, count: usize, counters: *const u64, resolutions: *const u64);
    fmi3EvaluateDiscreteStates();
    fmi3UpdateDiscreteStates(
        again: *mut Boolean, terminate: *mut Boolean, nominals: *mut Boolean, values: *mut Boolean,
        timed: *mut Boolean, next: *mut c_double);
    fmi3EnterContinuousTimeMode();
    fmi3CompletedIntegratorStep(no_return: Boolean, events: *mut Boolean, terminate: *mut Boolean);
    fmi3SetTime(t: c_double);
    fmi3SetContinuousStates(states: *const c_double, count: usize);
    fmi3GetContinuousStateDerivatives(derivatives: *mut c_double, count: usize);
    fmi3GetEventIndicators(indicators: *mut c_double, count: usize);
    fmi3GetContinuousStates(states: *mut c_double, count: usize);
    fmi3GetNominalsOfContinuousStates(nominals: *mut c_double, count: usize);
    fmi3GetNumberOfEventIndicators(count: *mut usize);
    fmi3GetNumberOfContinuousStates(count: *mut usize);
    fmi3ActivateModelPartition(clock: Reference, t: c_double);
}
