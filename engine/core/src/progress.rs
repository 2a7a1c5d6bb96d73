//! How long work reports its progress and learns that it should stop.

use crate::error::{Error, Result};

/// Receives progress; methods are called from any thread.
pub trait Progress: Sync {
    /// A new phase begins; `total` steps if known, in the unit named (as in "triangles", "bricks").
    fn phase(&self, _name: &str, _total: Option<u64>, _unit: &str) {}
    /// `steps` more are done.
    fn advance(&self, _steps: u64) {}
    /// Something that the user should know before the work is done, one line.
    fn note(&self, _text: &str) {}
    /// Something that the user should think about before the work is done, one line.
    fn warn(&self, _text: &str) {}
    /// True if the work should stop soon.
    fn cancelled(&self) -> bool {
        false
    }

    /// [`Error::Interrupted`] if the work should stop.
    fn check(&self) -> Result<()> {
        if self.cancelled() { Err(Error::Interrupted) } else { Ok(()) }
    }
}

/// Reports nothing and never cancels.
pub struct Silent;
impl Progress for Silent {}
