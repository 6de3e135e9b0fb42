//! An instance as C sees it: what the functions of FMI 2.0 and of FMI 3.0 do, in one place for both.
//!
//! Pointers are read here, in `fmi2` and in `fmi3` only. Every argument is checked for null before it is read; that arrays
//! have the stated length, and that an instance was made here and is not yet freed, is guaranteed by the environment
//! (FMI 2.0.4, section 2.1; FMI 3.0, section 2.2). A panic becomes an error.
#![allow(unsafe_code)]

use crate::slave::{Slave, State};
use std::ffi::{c_char, c_double, c_int, c_uint, c_void, CStr, CString};
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::ptr;

/// A value reference.
pub type Reference = c_uint;
/// fmi2CallbackLogger.
pub type FormattingLogger = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);
/// fmi3LogMessageCallback.
pub type PlainLogger = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

/// The call was successful.
pub const OK: c_int = 0;
/// The same, with a remark.
pub const WARNING: c_int = 1;
/// It was not, and the instance is as before.
pub const DISCARD: c_int = 2;
/// The call failed.
pub const ERROR: c_int = 3;

/// Where messages go.
#[derive(Clone, Copy)]
pub enum Log {
    /// Nowhere.
    Nowhere,
    /// To a function that reads the message as a format.
    Formatting(FormattingLogger),
    /// To one that takes it as it is.
    Plain(PlainLogger),
}

/// What the environment hands over for messages.
#[derive(Clone, Copy)]
pub struct Environment {
    /// Its function.
    pub log: Log,
    /// The argument that it wants back.
    pub own: *mut c_void,
}

impl Environment {
    /// Log a message, in the category of its status.
    fn report(&self, name: &CStr, status: c_int, message: &str) {
        let category = match status {
            WARNING => c"logStatusWarning",
            DISCARD => c"logStatusDiscard",
            _ => c"logStatusError",
        };
        let text = |message: String| CString::new(message.replace('\0', " ")).unwrap_or_default();
        match self.log {
            Log::Nowhere => {}
            Log::Formatting(log) => {
                let text = text(message.replace('%', "%%"));
                // SAFETY: the environment has handed over this function for this; all texts end in a zero and outlive
                // the call, and no format specifier is left.
                unsafe { log(self.own, name.as_ptr(), status, category.as_ptr(), text.as_ptr()) }
            }
            Log::Plain(log) => {
                let text = text(message.to_string());
                // SAFETY: as above.
                unsafe { log(self.own, status, category.as_ptr(), text.as_ptr()) }
            }
        }
    }
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
pub struct Instance {
    name: CString,
    environment: Environment,
    phase: Phase,
    slave: Slave,
}

/// A requested state, with its phase.
pub struct StoredState {
    state: State,
    phase: Phase,
}

/// An error and its severity.
pub struct Failed(pub c_int, pub String);

impl From<String> for Failed {
    fn from(message: String) -> Self {
        Self(ERROR, message)
    }
}

/// A status, or what went wrong.
pub type Done = Result<c_int, Failed>;

/// A message in place of a result.
pub fn failed(message: &str) -> Failed {
    Failed(ERROR, message.into())
}

fn missing() -> Failed {
    failed("an argument is missing")
}

/// Call an instance; an error or a panic is logged and becomes a status.
pub fn with(instance: *mut Instance, what: &str, f: impl FnOnce(&mut Instance) -> Done) -> c_int {
    // SAFETY: null, or an instance from `make` that was not freed; one call at a time (the environment's promise).
    let Some(instance) = (unsafe { instance.as_mut() }) else { return ERROR };
    let done = catch_unwind(AssertUnwindSafe(|| f(instance)));
    let Failed(status, message) = match done {
        Ok(Ok(status)) => return status,
        Ok(Err(failed)) => failed,
        Err(_) => {
            instance.phase = Phase::Ended;
            failed(INTERNAL)
        }
    };
    instance.environment.report(&instance.name, status, &format!("{what}: {message}"));
    status
}

const INTERNAL: &str = "an internal error; please report it with the model";

/// A new instance; null where `open` makes none, for a reason that is logged.
///
/// # Safety
/// `name` is null or a text that ends in a zero.
pub unsafe fn make(
    what: &str,
    environment: Environment,
    name: *const c_char,
    open: impl FnOnce() -> Result<Slave, String>,
) -> *mut Instance {
    // SAFETY: the caller's promise.
    let name = CString::new(unsafe { text(name) }.unwrap_or("model")).unwrap_or_default();
    let message = match catch_unwind(AssertUnwindSafe(open)) {
        Ok(Ok(slave)) => return Box::into_raw(Box::new(Instance { name, environment, phase: Phase::Made, slave })),
        Ok(Err(message)) => message,
        Err(_) => INTERNAL.into(),
    };
    environment.report(&name, ERROR, &format!("{what}: {message}"));
    ptr::null_mut()
}

/// Free an instance.
///
/// # Safety
/// Null, or an instance, which is not used afterwards.
pub unsafe fn free(instance: *mut Instance) {
    if !instance.is_null() {
        // SAFETY: from `Box::into_raw` in `make`, and freed once (the environment's promise).
        let owned = unsafe { Box::from_raw(instance) };
        let _ = catch_unwind(AssertUnwindSafe(move || drop(owned)));
    }
}

/// A text; None for null or what is not UTF-8.
///
/// # Safety
/// Null, or a text that ends in a zero.
pub unsafe fn text<'a>(pointer: *const c_char) -> Option<&'a str> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: not null; the caller's promise.
    unsafe { CStr::from_ptr(pointer) }.to_str().ok()
}

/// This many items.
///
/// # Safety
/// Null, or an array of that length that is not modified during the call.
unsafe fn items<'a, T>(pointer: *const T, count: usize) -> Result<&'a [T], Failed> {
    match (count, pointer.is_null()) {
        (0, _) => Ok(&[]),
        (_, true) => Err(missing()),
        // SAFETY: not null; the caller's promise.
        (_, false) => Ok(unsafe { std::slice::from_raw_parts(pointer, count) }),
    }
}

/// Where an answer is put.
///
/// # Safety
/// Null, or a place that nothing else uses during the call.
pub unsafe fn place<'a, T>(pointer: *mut T) -> Result<&'a mut T, Failed> {
    // SAFETY: the caller's promise.
    unsafe { pointer.as_mut() }.ok_or_else(missing)
}

/// What is kept at a place; `into` may hold a state from here already.
///
/// # Safety
/// `into` is null or points to null or to a state from here that is not yet freed.
unsafe fn put(into: *mut *mut StoredState, now: StoredState) -> Done {
    // SAFETY: the caller's promise.
    let slot = unsafe { place(into) }?;
    // SAFETY: as above.
    match unsafe { slot.as_mut() } {
        Some(old) => *old = now,
        None => *slot = Box::into_raw(Box::new(now)),
    }
    Ok(OK)
}

impl Instance {
    fn in_phase(&self, wanted: &[Phase]) -> Result<(), Failed> {
        match wanted.contains(&self.phase) {
            true => Ok(()),
            false => Err(failed("it is not allowed in this state of the model")),
        }
    }

    /// Set the start time and the tolerance, before the initialisation.
    pub fn begin(&mut self, tolerance: Option<c_double>, start: c_double) -> Done {
        self.in_phase(&[Phase::Made])?;
        self.slave.begin(start, tolerance)?;
        Ok(OK)
    }

    /// Enter the initialisation.
    pub fn enter(&mut self) -> Done {
        self.in_phase(&[Phase::Made])?;
        self.phase = Phase::Initialising;
        Ok(OK)
    }

    /// End it: from here on there are steps.
    pub fn exit(&mut self) -> Done {
        self.in_phase(&[Phase::Initialising])?;
        self.slave.settle()?;
        self.phase = Phase::Stepping;
        Ok(OK)
    }

    /// End the simulation.
    pub fn terminate(&mut self) -> Done {
        self.in_phase(&[Phase::Stepping])?;
        self.phase = Phase::Ended;
        Ok(OK)
    }

    /// Back to the state of a new instance.
    pub fn reset(&mut self) -> Done {
        self.slave.reset()?;
        self.phase = Phase::Made;
        Ok(OK)
    }

    /// Advance from t by `step`; on failure the step is discarded.
    pub fn step(&mut self, t: c_double, step: c_double) -> Done {
        self.in_phase(&[Phase::Stepping])?;
        let stepped = self.slave.step(t, step).map_err(|message| Failed(DISCARD, message))?;
        match stepped.doubts.first() {
            Some(doubt) => Err(Failed(WARNING, format!("the step to t = {} is suspect: {doubt}", t + step))),
            None => Ok(OK),
        }
    }

    /// The time that was reached.
    pub fn time(&self) -> c_double {
        self.slave.state().t
    }

    /// Numbers of all values of these variables, in order; `memory` values are read or written.
    fn slots(&self, references: &[Reference], memory: usize) -> Result<Vec<usize>, Failed> {
        let mut slots = Vec::with_capacity(memory);
        for reference in references {
            slots.extend(self.slave.slots(*reference as usize)?);
        }
        match slots.len() == memory {
            true => Ok(slots),
            false => Err(Failed(ERROR, format!("these variables have {} values, not {memory}", slots.len()))),
        }
    }

    /// Values of variables.
    ///
    /// # Safety
    /// Arrays of `count` and of `memory` items.
    pub unsafe fn get(
        &mut self,
        references: *const Reference,
        count: usize,
        values: *mut c_double,
        memory: usize,
    ) -> Done {
        // SAFETY: the caller's promise.
        let references = unsafe { items(references, count) }?;
        let slots = self.slots(references, memory)?;
        if memory > 0 && values.is_null() {
            return Err(missing());
        }
        if self.phase == Phase::Initialising {
            self.slave.settle()?;
        }
        for (i, slot) in slots.into_iter().enumerate() {
            let value = self.slave.get(slot)?;
            // SAFETY: i < room; the caller's promise.
            unsafe { values.add(i).write(value) };
        }
        Ok(OK)
    }

    /// Set inputs and parameters.
    ///
    /// # Safety
    /// Arrays of `count` and of `memory` items.
    pub unsafe fn set(
        &mut self,
        references: *const Reference,
        count: usize,
        values: *const c_double,
        memory: usize,
    ) -> Done {
        self.in_phase(&[Phase::Made, Phase::Initialising, Phase::Stepping])?;
        // SAFETY: the caller's promise.
        let (references, values) = unsafe { (items(references, count)?, items(values, memory)?) };
        for (slot, value) in self.slots(references, memory)?.into_iter().zip(values) {
            if self.slave.is_parameter(slot) {
                self.in_phase(&[Phase::Made, Phase::Initialising])?;
            }
            self.slave.set(slot, *value)?;
        }
        Ok(OK)
    }

    /// Set derivatives of inputs, of orders from 1.
    ///
    /// # Safety
    /// Arrays of `count` items.
    pub unsafe fn differentiate(
        &mut self,
        references: *const Reference,
        count: usize,
        orders: *const c_int,
        values: *const c_double,
    ) -> Done {
        self.in_phase(&[Phase::Made, Phase::Initialising, Phase::Stepping])?;
        // SAFETY: the caller's promise.
        let (references, orders, values) =
            unsafe { (items(references, count)?, items(orders, count)?, items(values, count)?) };
        for ((reference, order), value) in references.iter().zip(orders).zip(values) {
            let order = usize::try_from(*order).map_err(|_| failed("an order of a derivative is negative"))?;
            self.slave.differentiate(*reference as usize, order, *value)?;
        }
        Ok(OK)
    }

    /// Keep the state.
    ///
    /// # Safety
    /// `into` is null or points to null or to a state of this instance.
    pub unsafe fn keep(&mut self, into: *mut *mut StoredState) -> Done {
        let now = StoredState { state: self.slave.state().clone(), phase: self.phase };
        // SAFETY: the caller's promise.
        unsafe { put(into, now) }
    }

    /// Return to a state that was kept.
    ///
    /// # Safety
    /// Null, or a state of this instance.
    pub unsafe fn restore(&mut self, kept: *mut StoredState) -> Done {
        // SAFETY: the caller's promise.
        let kept = unsafe { place(kept) }?;
        self.slave.restore(kept.state.clone())?;
        self.phase = kept.phase;
        Ok(OK)
    }

    /// Free a state.
    ///
    /// # Safety
    /// `kept` is null or points to null or to a state of this instance, which is not used afterwards.
    pub unsafe fn forget(&mut self, kept: *mut *mut StoredState) -> Done {
        // SAFETY: the caller's promise.
        let slot = unsafe { place(kept) }?;
        if !slot.is_null() {
            // SAFETY: from `Box::into_raw` in `put`.
            drop(unsafe { Box::from_raw(*slot) });
            *slot = ptr::null_mut();
        }
        Ok(OK)
    }

    /// How many bytes a state has.
    ///
    /// # Safety
    /// Null or a state of this instance; null or a place.
    pub unsafe fn size(&mut self, kept: *mut StoredState, size: *mut usize) -> Done {
        // SAFETY: the caller's promise.
        let (kept, size) = unsafe { (place(kept)?, place(size)?) };
        *size = self.slave.bytes_of(&kept.state, kept.phase as u8).len();
        Ok(OK)
    }

    /// A state as bytes.
    ///
    /// # Safety
    /// Null or a state of this instance, and an array of `memory` bytes.
    pub unsafe fn serialise(&mut self, kept: *mut StoredState, bytes: *mut u8, memory: usize) -> Done {
        // SAFETY: the caller's promise.
        let kept = unsafe { place(kept) }?;
        let found = self.slave.bytes_of(&kept.state, kept.phase as u8);
        if bytes.is_null() {
            return Err(missing());
        }
        if found.len() > memory {
            return Err(Failed(
                ERROR,
                format!("the state has {} bytes, but there is memory for {memory}", found.len()),
            ));
        }
        // SAFETY: not null, and as long as what is written; the caller's promise.
        unsafe { ptr::copy_nonoverlapping(found.as_ptr(), bytes, found.len()) };
        Ok(OK)
    }

    /// The state in bytes.
    ///
    /// # Safety
    /// An array of `count` bytes; `into` is null or points to null or to a state of this instance.
    pub unsafe fn deserialise(&mut self, bytes: *const u8, count: usize, into: *mut *mut StoredState) -> Done {
        // SAFETY: the caller's promise.
        let bytes = unsafe { items(bytes, count) }?;
        let (state, phase) = self.slave.state_of(bytes)?;
        let phase = Phase::ALL.get(usize::from(phase)).copied().ok_or_else(|| failed("it has an unknown phase"))?;
        // SAFETY: as above.
        unsafe { put(into, StoredState { state, phase }) }
    }
}

/// Functions of the interface that are an operation of an instance, with the same arguments.
macro_rules! operations {
    ($($name:ident($($argument:ident: $kind:ty),*) = $operation:ident;)*) => {$(
        /// # Safety
        /// As specified by FMI.
        #[no_mangle]
        #[allow(unused_unsafe)] // those that read no pointer are safe
        pub unsafe extern "C" fn $name(instance: *mut $crate::instance::Instance, $($argument: $kind),*) -> ::std::ffi::c_int {
            // SAFETY: the caller's promise.
            $crate::instance::with(instance, stringify!($name), |it| unsafe { it.$operation($($argument),*) })
        }
    )*};
}

/// Functions that these FMUs do not support, as their descriptions state.
macro_rules! unsupported {
    ($($name:ident($($argument:ident: $kind:ty),*);)*) => {$(
        #[no_mangle]
        pub extern "C" fn $name(instance: *mut $crate::instance::Instance, $($argument: $kind),*) -> ::std::ffi::c_int {
            $(let _ = $argument;)*
            $crate::instance::with(instance, stringify!($name), |_| Err($crate::instance::failed("this FMU does not support it")))
        }
    )*};
}

/// Functions for types that no variable has: reading or writing no variable at all is allowed.
macro_rules! of_no_variable {
    ($($name:ident($($argument:ident: $kind:ty),*);)*) => {$(
        #[no_mangle]
        pub extern "C" fn $name(
            instance: *mut $crate::instance::Instance, _references: *const $crate::instance::Reference, count: usize, $($argument: $kind),*
        ) -> ::std::ffi::c_int {
            $(let _ = $argument;)*
            $crate::instance::with(instance, stringify!($name), |_| match count {
                0 => Ok($crate::instance::OK),
                _ => Err($crate::instance::failed("all variables of this FMU are real numbers of 64 bits")),
            })
        }
    )*};
}

pub(crate) use {of_no_variable, operations, unsupported};
