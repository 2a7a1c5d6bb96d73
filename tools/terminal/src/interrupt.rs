//! Ctrl-C and its relatives: the first asks the work to stop, the second ends the program at once.

use crate::failure::Failure;
use anyhow::Context;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};

static REQUESTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
/// The last signal that asked; 0 if none did.
static SIGNAL: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);
static AT_ONCE: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Takes over the signals.
pub fn install() -> Result<(), Failure> {
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        // In this order: the first signal finds the flag unset, passes the first handler and sets the flag.
        flag::register_conditional_shutdown(signal, status(signal), Arc::clone(&AT_ONCE))
            .and_then(|_| flag::register_conditional_shutdown(signal, status(signal), Arc::clone(&REQUESTED)))
            .and_then(|_| flag::register(signal, Arc::clone(&REQUESTED)))
            .and_then(|_| flag::register_usize(signal, Arc::clone(&SIGNAL), signal as usize))
            .context("cannot handle signals")?;
    }
    // Without a handler a file size limit kills; with one, writing fails and the error names the file.
    flag::register(SIGXFSZ, Arc::default()).context("cannot handle signals")?;
    Ok(())
}

/// The exit status by which shells tell that a signal ended a program: 130 of Ctrl-C.
fn status(signal: i32) -> i32 {
    128 + signal
}

/// The exit status of a command that ends because it was asked to stop; `None` if nobody asked.
pub fn exit_status() -> Option<u8> {
    let signal = i32::try_from(SIGNAL.load(Ordering::Relaxed)).ok().filter(|signal| *signal > 0)?;
    u8::try_from(status(signal)).ok()
}

/// Whether even the first signal ends the program at once: while it waits for input that may never come and has
/// nothing to lose.
pub fn end_at_once(yes: bool) {
    AT_ONCE.store(yes, Ordering::Relaxed);
}

/// True once the user asked to stop.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
