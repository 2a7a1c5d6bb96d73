//! Work beside the interpreter: signals, progress, errors.

use brickfield_engine::{Error, ErrorKind, Progress, Result};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Between two looks at signals and progress.
const PAUSE: Duration = Duration::from_millis(50);

/// What the work says of itself.
#[derive(Default)]
struct State {
    phase: Mutex<(String, Option<u64>)>,
    done: AtomicU64,
    is_cancelled: AtomicBool,
}

impl Progress for State {
    fn phase(&self, name: &str, total: Option<u64>, _unit: &str) {
        *self.phase.lock().expect("no thread panics") = (name.to_owned(), total);
        self.done.store(0, Ordering::Relaxed);
    }

    fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }
}

impl State {
    /// Calls `progress(phase, done, total)`.
    fn tell(&self, py: Python<'_>, progress: &Py<PyAny>) -> PyResult<()> {
        let (phase, total) = self.phase.lock().expect("no thread panics").clone();
        if !phase.is_empty() {
            progress.call1(py, (phase, self.done.load(Ordering::Relaxed), total))?;
        }
        Ok(())
    }
}

/// Does work on a thread of its own, while this one answers signals and reports progress. An exception of either stops the
/// work, is waited for, and raised.
///
/// # Errors
/// What the work gives; `KeyboardInterrupt`; what `progress` raises.
pub fn run<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&dyn Progress) -> Result<T> + Send,
) -> PyResult<T> {
    let (state, mut raised) = (State::default(), None);
    let result = std::thread::scope(|scope| {
        let (done, waits) = channel();
        // Threads may not share a receiver as it is, and one may be another without the interpreter's lock.
        let waits = Mutex::new(waits);
        let state = &state;
        let worker = scope.spawn(move || {
            let result = work(state);
            // The other end waits for it.
            let _ = done.send(());
            result
        });
        let wait = || waits.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(PAUSE);
        while py.detach(wait) == Err(RecvTimeoutError::Timeout) {
            let said = py
                .check_signals()
                .and_then(|()| progress.map_or(Ok(()), |progress| state.tell(py, progress)));
            if let Err(error) = said {
                state.is_cancelled.store(true, Ordering::Relaxed);
                raised.get_or_insert(error);
            }
        }
        py.detach(|| worker.join())
    });
    if let Some(error) = raised {
        return Err(error);
    }
    match result {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) if error.kind() == ErrorKind::Interrupted => Err(PyKeyboardInterrupt::new_err(())),
        Ok(Err(error)) => Err(failed(py, &error)),
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

/// The exception of an error of the engine: `brickfield.Error`, with `kind` and `path`.
pub fn failed(py: Python<'_>, error: &Error) -> PyErr {
    let kind = format!("{:?}", error.kind()).to_lowercase();
    let path = match error {
        Error::Io { path, .. } | Error::Input { path, .. } | Error::Store { path, .. } => {
            Some(path.display().to_string())
        }
        _ => None,
    };
    let make = || -> PyResult<PyErr> {
        let class = py.import("brickfield")?.getattr("Error")?;
        Ok(PyErr::from_value(class.call1((error.to_string(), kind, path))?))
    };
    make().unwrap_or_else(|error| error)
}
