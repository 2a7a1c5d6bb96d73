//! The ways in which a command ends without success.

use crate::options::error_with_options;
use brickfield_engine::Error;
use std::io;

/// Why a command did not succeed; decides the exit status.
pub enum Failure {
    /// Exit status 1, one line on standard error.
    Run(anyhow::Error),
    /// Exit status 128 and the signal's number, 130 of Ctrl-C, and one line on standard error: the user asked to stop.
    Interrupted(String),
    /// Exit status 2: what was typed makes no sense.
    Usage(String),
    /// The reader of standard output has gone; nothing is wrong.
    ClosedPipe,
}

impl Failure {
    /// For errors from writing to standard output.
    pub fn stdout(error: io::Error) -> Failure {
        if error.kind() == io::ErrorKind::BrokenPipe {
            Failure::ClosedPipe
        } else {
            Failure::Run(anyhow::Error::new(error).context("cannot write to standard output"))
        }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Failure {
        if let Error::Interrupted | Error::Suspended { .. } = error {
            return Failure::Interrupted(error.to_string());
        }
        // The engine's messages already end with their cause; as a chain it would be printed twice.
        Failure::Run(anyhow::Error::msg(error_with_options(error)))
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Failure {
        Failure::Run(error)
    }
}
