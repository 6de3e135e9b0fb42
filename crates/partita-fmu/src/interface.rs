//! The interface to C: the functions of FMI 2.0 for co-simulation.
//!
//! Pointers are read in this module only. Every argument is checked for null before it is read; that arrays have the
//! stated length, and that an instance was made here and is not yet freed, is guaranteed by the environment (FMI 2.0.4,
//! section 2.1). A panic becomes an error.
#![allow(unsafe_code)]
#![allow(missing_docs)] // what the functions do is said in the standard

use crate::resources;
use crate::slave::{Slave, State};
use std::ffi::{c_char, c_double, c_int, c_uint, c_void, CStr, CString};
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::ptr;

type Boolean = c_int;
type Reference = c_uint;
type Logger = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

const OK: c_int = 0;
const WARNING: c_int = 1;
const DISCARD: c_int = 2;
const ERROR: c_int = 3;

/// fmi2CallbackFunctions.
#[repr(C)]
pub struct Callbacks {
    logger: Option<Logger>,
    allocate: *const c_void,
    free: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    Made,
    Initialising,
    Stepping,
    Ended,
}

impl Phase {
    const ALL: [Self; 4] = [Self::Made, Self::Initialising, Self::Stepping, Self::Ended];
}

/// An instance.
pub struct Component {
    name: CString,
    logger: Option<Logger>,
    environment: *mut c_void,
    talks: bool,
    phase: Phase,
    slave: Slave,
}

/// A requested state, with its phase.
pub struct Kept {
    state: State,
    phase: Phase,
}

/// Log a message to the environment; `%` would be read as a format specifier.
fn log(logger: Option<Logger>, environment: *mut c_void, name: &CStr, status: c_int, message: &str) {
    let Some(logger) = logger else { return };
    let clean = message.replace('\0', " ").replace('%', "%%");
    let category = if status == WARNING { c"logStatusWarning" } else { c"logStatusError" };
    if let Ok(text) = CString::new(clean) {
        // SAFETY: the environment has handed over this function for this; all texts end in a zero and outlive the call.
        unsafe { logger(environment, name.as_ptr(), status, category.as_ptr(), text.as_ptr()) }
    }
}

/// An error and its severity.
struct Failed(c_int, String);

impl From<String> for Failed {
    fn from(message: String) -> Self {
        Self(ERROR, message)
    }
}

/// Call an instance; an error or a panic is logged and becomes a status.
fn with(component: *mut Component, what: &str, f: impl FnOnce(&mut Component) -> Result<c_int, Failed>) -> c_int {
    // SAFETY: null, or an instance from `fmi2Instantiate` that was not freed; one call at a time (the environment's
    // promise).
    let Some(component) = (unsafe { component.as_mut() }) else { return ERROR };
    let done = catch_unwind(AssertUnwindSafe(|| f(component)));
    let Failed(status, message) = match done {
        Ok(Ok(status)) => return status,
        Ok(Err(failed)) => failed,
        Err(_) => {
            component.phase = Phase::Ended;
            Failed(ERROR, "an internal error; please report it with the model".into())
        }
    };
    log(component.logger, component.environment, &component.name, status, &format!("{what}: {message}"));
    status
}

fn in_phase(component: &Component, wanted: &[Phase]) -> Result<(), Failed> {
    match wanted.contains(&component.phase) {
        true => Ok(()),
        false => Err(Failed(ERROR, "it is not allowed in this state of the model".into())),
    }
}

/// A text; None for null or what is not UTF-8.
///
/// # Safety
/// Null, or a text that ends in a zero.
unsafe fn text<'a>(pointer: *const c_char) -> Option<&'a str> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: not null; the caller's promise.
    unsafe { CStr::from_ptr(pointer) }.to_str().ok()
}

/// This many items; None where there is no array for them.
///
/// # Safety
/// Null, or an array of that length that is not modified during the call.
unsafe fn items<'a, T>(pointer: *const T, count: usize) -> Option<&'a [T]> {
    match (count, pointer.is_null()) {
        (0, _) => Some(&[]),
        (_, true) => None,
        // SAFETY: not null; the caller's promise.
        (_, false) => Some(unsafe { std::slice::from_raw_parts(pointer, count) }),
    }
}

fn missing() -> Failed {
    Failed(ERROR, "an array is missing".into())
}

#[no_mangle]
pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[no_mangle]
pub extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

#[no_mangle]
pub extern "C" fn fmi2SetDebugLogging(
    component: *mut Component,
    on: Boolean,
    _categories: usize,
    _names: *const *const c_char,
) -> c_int {
    with(component, "fmi2SetDebugLogging", |c| {
        c.talks = on != 0;
        Ok(OK)
    })
}

/// # Safety
/// As specified by FMI 2.0.
#[no_mangle]
pub unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    guid: *const c_char,
    location: *const c_char,
    callbacks: *const Callbacks,
    _visible: Boolean,
    logging: Boolean,
) -> *mut Component {
    // SAFETY: null, or the environment's callbacks and texts.
    let (logger, environment) = match unsafe { callbacks.as_ref() } {
        Some(c) => (c.logger, c.environment),
        None => (None, ptr::null_mut()),
    };
    // SAFETY: as above.
    let (name, guid, location) = unsafe { (text(name), text(guid), text(location)) };
    let name = CString::new(name.unwrap_or("model")).unwrap_or_default();
    let made = catch_unwind(AssertUnwindSafe(|| {
        if kind != 1 {
            return Err("this FMU supports co-simulation only".to_string());
        }
        let location = location.ok_or("the location of the resources is missing")?;
        Slave::open(&resources::path(location)?, guid.unwrap_or_default())
    }));
    let message = match made {
        Ok(Ok(slave)) => {
            let talks = logging != 0;
            return Box::into_raw(Box::new(Component { name, logger, environment, talks, phase: Phase::Made, slave }));
        }
        Ok(Err(message)) => message,
        Err(_) => "an internal error; please report it with the model".into(),
    };
    log(logger, environment, &name, ERROR, &format!("fmi2Instantiate: {message}"));
    ptr::null_mut()
}

/// # Safety
/// An instance, which is not used afterwards.
#[no_mangle]
pub unsafe extern "C" fn fmi2FreeInstance(component: *mut Component) {
    if !component.is_null() {
        // SAFETY: from `Box::into_raw` in `fmi2Instantiate`, and freed once (the environment's promise).
        let owned = unsafe { Box::from_raw(component) };
        let _ = catch_unwind(AssertUnwindSafe(move || drop(owned)));
    }
}

#[no_mangle]
pub extern "C" fn fmi2SetupExperiment(
    component: *mut Component,
    tolerance_defined: Boolean,
    tolerance: c_double,
    start: c_double,
    _stop_defined: Boolean,
    _stop: c_double,
) -> c_int {
    with(component, "fmi2SetupExperiment", |c| {
        in_phase(c, &[Phase::Made])?;
        c.slave.begin(start, (tolerance_defined != 0).then_some(tolerance))?;
        Ok(OK)
    })
}

#[no_mangle]
pub extern "C" fn fmi2EnterInitializationMode(component: *mut Component) -> c_int {
    with(component, "fmi2EnterInitializationMode", |c| {
        in_phase(c, &[Phase::Made])?;
        c.phase = Phase::Initialising;
        Ok(OK)
    })
}

#[no_mangle]
pub extern "C" fn fmi2ExitInitializationMode(component: *mut Component) -> c_int {
    with(component, "fmi2ExitInitializationMode", |c| {
        in_phase(c, &[Phase::Initialising])?;
        c.slave.settle()?;
        c.phase = Phase::Stepping;
        Ok(OK)
    })
}

#[no_mangle]
pub extern "C" fn fmi2Terminate(component: *mut Component) -> c_int {
    with(component, "fmi2Terminate", |c| {
        in_phase(c, &[Phase::Stepping])?;
        c.phase = Phase::Ended;
        Ok(OK)
    })
}

#[no_mangle]
pub extern "C" fn fmi2Reset(component: *mut Component) -> c_int {
    with(component, "fmi2Reset", |c| {
        c.slave.reset()?;
        c.phase = Phase::Made;
        Ok(OK)
    })
}

/// # Safety
/// Arrays of `count` items.
#[no_mangle]
pub unsafe extern "C" fn fmi2GetReal(
    component: *mut Component,
    references: *const Reference,
    count: usize,
    values: *mut c_double,
) -> c_int {
    with(component, "fmi2GetReal", |c| {
        // SAFETY: the caller's promise.
        let references = unsafe { items(references, count) }.ok_or_else(missing)?;
        if count > 0 && values.is_null() {
            return Err(missing());
        }
        if c.phase == Phase::Initialising {
            c.slave.settle()?;
        }
        for (i, reference) in references.iter().enumerate() {
            let value = c.slave.get(*reference as usize)?;
            // SAFETY: i < count; the caller's promise.
            unsafe { values.add(i).write(value) };
        }
        Ok(OK)
    })
}

/// # Safety
/// Arrays of `count` items.
#[no_mangle]
pub unsafe extern "C" fn fmi2SetReal(
    component: *mut Component,
    references: *const Reference,
    count: usize,
    values: *const c_double,
) -> c_int {
    with(component, "fmi2SetReal", |c| {
        in_phase(c, &[Phase::Made, Phase::Initialising, Phase::Stepping])?;
        // SAFETY: the caller's promise.
        let (references, values) = unsafe { (items(references, count), items(values, count)) };
        let (references, values) = (references.ok_or_else(missing)?, values.ok_or_else(missing)?);
        for (reference, value) in references.iter().zip(values) {
            if c.slave.is_parameter(*reference as usize) {
                in_phase(c, &[Phase::Made, Phase::Initialising])?;
            }
            c.slave.set(*reference as usize, *value)?;
        }
        Ok(OK)
    })
}

#[no_mangle]
pub extern "C" fn fmi2DoStep(component: *mut Component, t: c_double, step: c_double, _no_return: Boolean) -> c_int {
    with(component, "fmi2DoStep", |c| {
        in_phase(c, &[Phase::Stepping])?;
        let stepped = c.slave.step(t, step).map_err(|message| Failed(DISCARD, message))?;
        match stepped.doubts.first() {
            Some(doubt) => Err(Failed(WARNING, format!("the step to t = {} is suspect: {doubt}", t + step))),
            None => Ok(OK),
        }
    })
}

#[no_mangle]
pub extern "C" fn fmi2CancelStep(component: *mut Component) -> c_int {
    with(component, "fmi2CancelStep", |_| Err(Failed(ERROR, "steps complete before they return".into())))
}

/// # Safety
/// `kept` points to null or to a state of this instance.
#[no_mangle]
pub unsafe extern "C" fn fmi2GetFMUstate(component: *mut Component, kept: *mut *mut Kept) -> c_int {
    with(component, "fmi2GetFMUstate", |c| {
        // SAFETY: the caller's promise.
        let slot = unsafe { kept.as_mut() }.ok_or_else(missing)?;
        let now = Kept { state: c.slave.state().clone(), phase: c.phase };
        // SAFETY: null, or from here and not yet freed.
        match unsafe { slot.as_mut() } {
            Some(old) => *old = now,
            None => *slot = Box::into_raw(Box::new(now)),
        }
        Ok(OK)
    })
}

/// # Safety
/// A state of this instance.
#[no_mangle]
pub unsafe extern "C" fn fmi2SetFMUstate(component: *mut Component, kept: *mut Kept) -> c_int {
    with(component, "fmi2SetFMUstate", |c| {
        // SAFETY: null, or from `fmi2GetFMUstate` and not yet freed.
        let kept = unsafe { kept.as_ref() }.ok_or_else(missing)?;
        c.slave.restore(kept.state.clone())?;
        c.phase = kept.phase;
        Ok(OK)
    })
}

/// # Safety
/// `kept` points to null or to a state of this instance, which is not used afterwards.
#[no_mangle]
pub unsafe extern "C" fn fmi2FreeFMUstate(component: *mut Component, kept: *mut *mut Kept) -> c_int {
    with(component, "fmi2FreeFMUstate", |_| {
        // SAFETY: the caller's promise.
        let slot = unsafe { kept.as_mut() }.ok_or_else(missing)?;
        if !slot.is_null() {
            // SAFETY: from `Box::into_raw` in `fmi2GetFMUstate`.
            drop(unsafe { Box::from_raw(*slot) });
            *slot = ptr::null_mut();
        }
        Ok(OK)
    })
}

/// # Safety
/// A state of this instance; `size` is null or points to a number.
#[no_mangle]
pub unsafe extern "C" fn fmi2SerializedFMUstateSize(
    component: *mut Component,
    kept: *mut Kept,
    size: *mut usize,
) -> c_int {
    with(component, "fmi2SerializedFMUstateSize", |c| {
        // SAFETY: null, or from `fmi2GetFMUstate` and not yet freed; null, or the caller's promise.
        let (kept, size) = unsafe { (kept.as_ref(), size.as_mut()) };
        let (kept, size) = (kept.ok_or_else(missing)?, size.ok_or_else(missing)?);
        *size = c.slave.bytes_of(&kept.state, kept.phase as u8).len();
        Ok(OK)
    })
}

/// # Safety
/// A state of this instance, and an array of `size` bytes.
#[no_mangle]
pub unsafe extern "C" fn fmi2SerializeFMUstate(
    component: *mut Component,
    kept: *mut Kept,
    bytes: *mut c_char,
    size: usize,
) -> c_int {
    with(component, "fmi2SerializeFMUstate", |c| {
        // SAFETY: null, or from `fmi2GetFMUstate` and not yet freed.
        let kept = unsafe { kept.as_ref() }.ok_or_else(missing)?;
        let found = c.slave.bytes_of(&kept.state, kept.phase as u8);
        if bytes.is_null() {
            return Err(missing());
        }
        if found.len() > size {
            return Err(Failed(ERROR, format!("the state has {} bytes, but there is room for {size}", found.len())));
        }
        // SAFETY: not null, and as long as what is written; the caller's promise.
        unsafe { ptr::copy_nonoverlapping(found.as_ptr().cast::<c_char>(), bytes, found.len()) };
        Ok(OK)
    })
}

/// # Safety
/// An array of `size` bytes; `kept` points to null or to a state of this instance.
#[no_mangle]
pub unsafe extern "C" fn fmi2DeSerializeFMUstate(
    component: *mut Component,
    bytes: *const c_char,
    size: usize,
    kept: *mut *mut Kept,
) -> c_int {
    with(component, "fmi2DeSerializeFMUstate", |c| {
        // SAFETY: the caller's promise.
        let bytes = unsafe { items(bytes.cast::<u8>(), size) }.ok_or_else(missing)?;
        // SAFETY: the caller's promise.
        let slot = unsafe { kept.as_mut() }.ok_or_else(missing)?;
        let (state, phase) = c.slave.state_of(bytes)?;
        let phase = Phase::ALL.get(usize::from(phase)).copied().ok_or_else(|| "it has an unknown phase".to_string())?;
        let now = Kept { state, phase };
        // SAFETY: null, or from here and not yet freed.
        match unsafe { slot.as_mut() } {
            Some(old) => *old = now,
            None => *slot = Box::into_raw(Box::new(now)),
        }
        Ok(OK)
    })
}

/// # Safety
/// `value` is null or points to a number.
#[no_mangle]
pub unsafe extern "C" fn fmi2GetRealStatus(component: *mut Component, kind: c_int, value: *mut c_double) -> c_int {
    with(component, "fmi2GetRealStatus", |c| {
        // SAFETY: the caller's promise.
        let slot = unsafe { value.as_mut() }.ok_or_else(missing)?;
        match kind {
            // fmi2LastSuccessfulTime
            2 => {
                *slot = c.slave.state().t;
                Ok(OK)
            }
            _ => Err(Failed(DISCARD, format!("there is no status {kind} of this type"))),
        }
    })
}

/// Functions that this FMU does not support, as its description states, or whose variable type it does not have.
macro_rules! nothing {
    ($($name:ident($($argument:ident: $kind:ty),*);)*) => {$(
        #[no_mangle]
        pub extern "C" fn $name(component: *mut Component, $($argument: $kind),*) -> c_int {
            $(let _ = $argument;)*
            with(component, stringify!($name), |_| Err(Failed(ERROR, "this FMU does not support it".into())))
        }
    )*};
}

/// Reading or writing no variable at all is allowed.
macro_rules! none_of {
    ($($name:ident: $kind:ty;)*) => {$(
        #[no_mangle]
        pub extern "C" fn $name(component: *mut Component, _: *const Reference, count: usize, _: $kind) -> c_int {
            with(component, stringify!($name), |_| match count {
                0 => Ok(OK),
                _ => Err(Failed(ERROR, "all variables of this FMU are real".into())),
            })
        }
    )*};
}

none_of! {
    fmi2GetInteger: *mut c_int;
    fmi2GetBoolean: *mut Boolean;
    fmi2GetString: *mut *const c_char;
    fmi2SetInteger: *const c_int;
    fmi2SetBoolean: *const Boolean;
    fmi2SetString: *const *const c_char;
}

nothing! {
    fmi2GetDirectionalDerivative(
        unknowns: *const Reference, count: usize, knowns: *const Reference, known: usize, seed: *const c_double,
        result: *mut c_double);
    fmi2SetRealInputDerivatives(
        references: *const Reference, count: usize, orders: *const c_int, values: *const c_double);
    fmi2GetRealOutputDerivatives(
        references: *const Reference, count: usize, orders: *const c_int, values: *mut c_double);
    fmi2GetStatus(kind: c_int, value: *mut c_int);
    fmi2GetIntegerStatus(kind: c_int, value: *mut c_int);
    fmi2GetBooleanStatus(kind: c_int, value: *mut Boolean);
    fmi2GetStringStatus(kind: c_int, value: *mut *const c_char);
}
