//! Long work on another thread, so that Ctrl-C takes effect while it runs.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::panic::{catch_unwind, resume_unwind, AssertUnwindSafe};
use std::sync::mpsc::{channel, RecvTimeoutError};
use std::thread;
use std::time::Duration;

/// Interval between checks for signals.
const PULSE: Duration = Duration::from_millis(50);

/// Run `work` on another thread and return its result, while this thread handles signals: an exception raised by a
/// signal handler (Ctrl-C) is returned at once, and the work, which owns its data, runs to its end unobserved.
///
/// `long` states whether it may take long; short work is done here, since a thread has its cost too.
pub fn heard<T: Send + 'static>(py: Python<'_>, long: bool, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    if !long {
        return Ok(py.detach(work));
    }
    let (send, mut receive) = channel();
    let run = move || {
        // no receiver exists after a signal
        let _ = send.send(catch_unwind(AssertUnwindSafe(work)));
    };
    thread::Builder::new().name("partita".into()).spawn(run)?;
    loop {
        let answer;
        (answer, receive) = py.detach(move || (receive.recv_timeout(PULSE), receive));
        match answer {
            Ok(Ok(found)) => return Ok(found),
            Ok(Err(panic)) => resume_unwind(panic),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("the work ended without a result"))
            }
        }
    }
}
