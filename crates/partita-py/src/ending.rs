//! Threads that are in the core while the interpreter ends.
//!
//! A thread that asks for the interpreter after its end is ended by Python through the frames of the core, which aborts
//! the process. So threads without it come in by [`entered`] and [`released`] alone, which make them stay where they are
//! from [`ending`] on; it waits for those that are inside.

use pyo3::prelude::*;
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};
use std::sync::OnceLock;
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

/// Longest wait for functions of the user that run when the program ends.
const PATIENCE: Duration = Duration::from_secs(5);
const PULSE: Duration = Duration::from_millis(1);

static ENDING: AtomicBool = AtomicBool::new(false);
/// Threads that have come in and have, or wait for, the interpreter.
static INSIDE: AtomicUsize = AtomicUsize::new(0);
static LAST: OnceLock<ThreadId> = OnceLock::new();

thread_local! {
    /// Whether this thread works without the interpreter.
    static OUTSIDE: Cell<bool> = const { Cell::new(false) };
    /// Whether it is among `INSIDE`.
    static COUNTED: Cell<bool> = const { Cell::new(false) };
}

fn stay() -> ! {
    loop {
        thread::park();
    }
}

/// This thread wants the interpreter.
fn come_in() {
    INSIDE.fetch_add(1, SeqCst);
    if ENDING.load(SeqCst) {
        INSIDE.fetch_sub(1, SeqCst);
        stay();
    }
    OUTSIDE.set(false);
    COUNTED.set(true);
}

/// This thread is not counted any more.
fn uncounted() {
    if COUNTED.replace(false) {
        INSIDE.fetch_sub(1, SeqCst);
    }
}

/// A thread of the core's own, which begins without the interpreter.
pub fn begin_outside() {
    OUTSIDE.set(true);
}

struct Outside;

impl Drop for Outside {
    fn drop(&mut self) {
        come_in();
    }
}

/// Work without the interpreter, which this thread has; the last thread of a program keeps it.
pub fn released<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> T {
    if ENDING.load(SeqCst) {
        if is_last() {
            return work();
        }
        py.detach(|| -> () { stay() });
    }
    let counted = COUNTED.get();
    uncounted();
    let found = py.detach(|| {
        OUTSIDE.set(true);
        let _outside = Outside;
        work()
    });
    if !counted {
        uncounted();
    }
    found
}

struct Inside(bool);

impl Drop for Inside {
    fn drop(&mut self) {
        if self.0 {
            uncounted();
            OUTSIDE.set(true);
        }
    }
}

/// Work with the interpreter, by a thread that may not have it.
pub fn entered<T>(work: impl FnOnce(Python<'_>) -> T) -> T {
    let outside = OUTSIDE.get();
    if outside {
        come_in();
    }
    let _inside = Inside(outside);
    match Python::try_attach(work) {
        Some(found) => found,
        None => stay(),
    }
}

/// Whether this is the thread that ends the program, which has the interpreter and keeps it.
pub fn is_last() -> bool {
    ENDING.load(SeqCst) && LAST.get() == Some(&thread::current().id())
}

/// Called when the program ends, before the interpreter does: nobody comes in any more, and those inside finish.
#[pyfunction]
pub fn ending(py: Python<'_>) {
    let _ = LAST.set(thread::current().id());
    ENDING.store(true, SeqCst);
    py.detach(|| {
        let began = Instant::now();
        while INSIDE.load(SeqCst) > 0 && began.elapsed() < PATIENCE {
            thread::sleep(PULSE);
        }
    });
}

/// In a forked process the other threads are gone.
#[pyfunction]
pub fn forked() {
    INSIDE.store(0, SeqCst);
    COUNTED.set(false);
}

/// Have both called by the interpreter.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = m.py();
    py.import("atexit")?.call_method1("register", (wrap_pyfunction!(ending, m)?,))?;
    let os = py.import("os")?;
    if os.hasattr("register_at_fork")? {
        let what = pyo3::types::PyDict::new(py);
        what.set_item("after_in_child", wrap_pyfunction!(forked, m)?)?;
        os.call_method("register_at_fork", (), Some(&what))?;
    }
    Ok(())
}
