//! Work beside the interpreter: other threads of Python run meanwhile, and a KeyboardInterrupt ends it.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use cvg_cli::service::{STACK_BYTES, prepared};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// How often it is looked for a signal.
const PATIENCE: Duration = Duration::from_millis(50);

/// What the worker says.
enum Said<T> {
    Progress(String),
    Done(T),
    Failed(String),
}

/// Why the worker stopped without an answer.
struct Interrupted;

/// Does `work` on a thread of its own. The process is prepared with the first work and not with the import: a worker of Dask
/// imports what its client did, and only then hears how many threads it may have. `work` is given a function to say what it is doing, and ends there where it is no longer
/// wanted: a signal's exception comes back within [`PATIENCE`], the thread at its next word.
pub(crate) fn aside<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&dyn Fn(&str)) -> T + Send + 'static,
) -> PyResult<T> {
    let (say, mut heard) = channel::<Said<T>>();
    let unwanted = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&unwanted);
    let thread = std::thread::Builder::new().name("cvg".into()).stack_size(STACK_BYTES).spawn(move || {
        let words = say.clone();
        let at_work = move || {
            let progress = move |what: &str| {
                if seen.load(Ordering::Relaxed) {
                    // no panic: nothing is printed, and all that was begun is given back
                    resume_unwind(Box::new(Interrupted));
                }
                let _ = words.send(Said::Progress(what.to_owned()));
            };
            work(&progress)
        };
        let _ = match catch_unwind(AssertUnwindSafe(|| prepared(at_work))) {
            Ok(Ok(done)) => say.send(Said::Done(done)),
            Ok(Err(failure)) => say.send(Said::Failed(failure.to_string())),
            // interrupted, or a fault of our own, which the end of the channel tells
            Err(_) => Ok(()),
        };
    })?;
    let answer = loop {
        let (said, back) = py.detach(move || next(heard));
        heard = back;
        let step = match said {
            Ok(Said::Done(done)) => break Ok(done),
            Ok(Said::Failed(why)) => break Err(PyRuntimeError::new_err(why)),
            Ok(Said::Progress(what)) => progress.map_or(Ok(()), |p| p.call1((what,)).map(|_| ())),
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => {
                break Err(PyRuntimeError::new_err("cvg failed within; please report it"));
            }
        };
        if let Err(error) = step.and_then(|()| py.check_signals()) {
            unwanted.store(true, Ordering::Relaxed);
            return Err(error);
        }
    };
    let _ = py.detach(|| thread.join());
    answer
}

fn next<T>(heard: Receiver<T>) -> (Result<T, RecvTimeoutError>, Receiver<T>) {
    (heard.recv_timeout(PATIENCE), heard)
}
