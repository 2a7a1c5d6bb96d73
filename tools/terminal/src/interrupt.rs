//! Ctrl-C and its relatives: the first asks the work to stop, the second ends the program at once.

use crate::failure::Failure;
use anyhow::Context;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::{flag, low_level};
use std::io::{self, IsTerminal, PipeReader, Read, Write};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};
use std::thread;

static REQUESTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
/// The last signal that asked; 0 if none did.
static SIGNAL: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);
static AT_ONCE: AtomicBool = AtomicBool::new(false);
/// Whether the program is about to end at once: a further signal does not wait for the line that says so, which nobody
/// may be reading.
static ENDING: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Takes over the signals for the program of this name.
pub fn install(name: &'static str) -> Result<(), Failure> {
    take_over(name).context("cannot handle signals")?;
    Ok(())
}

fn take_over(name: &'static str) -> io::Result<()> {
    let (received, sender) = io::pipe()?;
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        flag::register_conditional_shutdown(signal, status(signal), Arc::clone(&ENDING))?;
        flag::register(signal, Arc::clone(&REQUESTED))?;
        flag::register_usize(signal, Arc::clone(&SIGNAL), signal as usize)?;
        // Last: whoever reads the byte finds the flags set.
        low_level::pipe::register(signal, sender.try_clone()?)?;
    }
    thread::Builder::new().name("signals".to_owned()).spawn(move || wait(name, received))?;
    // Without a handler a file size limit kills; with one, writing fails and the error names the file.
    flag::register(SIGXFSZ, Arc::default())?;
    Ok(())
}

/// Waits for signals, a byte each, and ends the program at the second. A handler cannot do it: it must not print.
fn wait(name: &str, mut received: PipeReader) {
    let mut byte = [0];
    let mut signals = 0;
    while received.read_exact(&mut byte).is_ok() {
        signals += 1;
        if signals > 1 || AT_ONCE.load(Ordering::Relaxed) {
            ENDING.store(true, Ordering::Relaxed);
            let why = if signals > 1 {
                "stopped at once by a second signal; unfinished files are named .part: the same command goes on from \
                 them or writes them anew"
            } else {
                "interrupted"
            };
            let mut errors = io::stderr().lock();
            // Behind a progress bar and the terminal's ^C a line begins anew.
            let start = if errors.is_terminal() { "\n" } else { "" };
            // Nobody is left to tell if this fails.
            let _ = writeln!(errors, "{start}{name}: {why}");
            // Without clearing up behind threads that still work.
            low_level::exit(exit_status().map_or(1, i32::from));
        }
    }
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
