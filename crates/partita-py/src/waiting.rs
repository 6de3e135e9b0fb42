//! Long work on another thread, so that Ctrl-C takes effect while it runs.

use crate::ending::{begin_outside, is_last, released};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::panic::{catch_unwind, resume_unwind, AssertUnwindSafe};
use std::sync::mpsc::{channel, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

/// Interval between checks for signals.
const PULSE: Duration = Duration::from_millis(50);

/// After this time a message tells what takes so long.
const SILENT: Duration = Duration::from_secs(3);

/// As [`heard`], for the compilation of a mechanism: after some seconds a message on the logger "partita" tells about it.
pub fn patiently<T: Send + 'static>(
    py: Python<'_>,
    long: bool,
    name: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    heard_with(py, long, work, &mut || {
        let message = format!(
            "compiling \"{name}\" takes more than {} s: it is examined along its motions which loops of the drawing close \
             within its tolerance (drawing_tolerance=); Ctrl-C stops it",
            SILENT.as_secs()
        );
        py.import("logging")?.call_method1("getLogger", ("partita",))?.call_method1("warning", ("%s", message))?;
        Ok(())
    })
}

/// Run `work` on another thread and return its result, while this thread handles signals: an exception raised by a
/// signal handler (Ctrl-C) is returned at once, and the work, which owns its data, runs to its end unobserved.
///
/// `long` states whether it may take long; short work is done here, since a thread has its cost too.
pub fn heard<T: Send + 'static>(py: Python<'_>, long: bool, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    heard_with(py, long, work, &mut || Ok(()))
}

/// As [`heard`]; `slow` is called once where it takes long.
fn heard_with<T: Send + 'static>(
    py: Python<'_>,
    long: bool,
    work: impl FnOnce() -> T + Send + 'static,
    slow: &mut dyn FnMut() -> PyResult<()>,
) -> PyResult<T> {
    if !long || is_last() {
        return Ok(released(py, work));
    }
    let (send, mut receive) = channel();
    let run = move || {
        begin_outside();
        // no receiver exists after a signal
        let _ = send.send(catch_unwind(AssertUnwindSafe(work)));
    };
    thread::Builder::new().name("partita".into()).spawn(run)?;
    let (began, mut silent) = (Instant::now(), true);
    loop {
        let answer;
        (answer, receive) = released(py, move || (receive.recv_timeout(PULSE), receive));
        match answer {
            Ok(Ok(found)) => return Ok(found),
            Ok(Err(panic)) => resume_unwind(panic),
            Err(RecvTimeoutError::Timeout) => {
                py.check_signals()?;
                if silent && began.elapsed() > SILENT {
                    silent = false;
                    slow()?;
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("the work ended without a result"))
            }
        }
    }
}
