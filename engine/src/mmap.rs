//! Read-only memory maps.

use crate::error::{Error, Result};
use std::path::Path;

/// A file mapped for reading.
pub struct MappedFile(memmap2::Mmap);

impl MappedFile {
    /// Maps the whole file.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be opened or mapped.
    pub fn open(path: &Path) -> Result<MappedFile> {
        let file = std::fs::File::open(path).map_err(Error::io(path, "open"))?;
        // SAFETY: the map is read-only, and nothing derived from its bytes is trusted without a check, so
        // another process that writes the file changes answers, not memory safety of ours.
        let map = unsafe { memmap2::Mmap::map(&file) }.map_err(Error::io(path, "map"))?;
        Ok(MappedFile(map))
    }

    /// The file's bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}
