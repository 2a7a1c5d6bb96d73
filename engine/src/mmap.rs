//! Read-only maps of whole files: the one place of the library that needs `unsafe`.
//!
//! A map lets files larger than memory be read by many threads without a copy. What it cannot promise: that
//! nobody else changes the file meanwhile. If another process rewrites it, the bytes seen change under the
//! reader; if another process *truncates* it, or the disk below fails, touching a lost page raises SIGBUS and
//! ends the program. Nothing in this library turns that signal into an error, so an input must be left alone
//! while it is read. Stores are read by positioned reads unless a map is asked for (`store::Io`). Everything that is written goes through positioned writes instead, never through a map.

use crate::error::{Error, Result};
use std::fs::File;
use std::path::Path;

/// How the bytes of a map will be touched; a hint for the system's read-ahead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// From front to back: read far ahead.
    Sequential,
    /// Here and there: read nothing ahead.
    Random,
}

/// A whole file, mapped read-only. `Send` and `Sync`; the map lives as long as the value.
#[derive(Debug)]
pub struct MappedFile {
    /// `None` for an empty file: the system refuses maps of length 0.
    map: Option<memmap2::Mmap>,
}

impl MappedFile {
    /// Maps the regular file `path`. Allocates nothing that depends on the file's size.
    ///
    /// # Errors
    /// If it does not exist, may not be read, is a directory, pipe or device, or the system refuses the map.
    pub fn open(path: &Path) -> Result<MappedFile> {
        let (file, bytes) = open_regular(path)?;
        if bytes == 0 {
            return Ok(MappedFile { map: None });
        }
        // SAFETY: the map is private to this value, read-only, and handed out only as `&[u8]`, for which every
        // byte pattern is valid. What the language cannot exclude is that another process changes the file;
        // no code of this library keeps a reference into the map across which it relies on a byte staying
        // equal for memory safety (lengths and indices taken from it are checked after they were copied out).
        // Truncation is SIGBUS, which ends the process and corrupts nothing; the module's text says so.
        let map = unsafe { memmap2::Mmap::map(&file) }.map_err(Error::io(path, "map"))?;
        Ok(MappedFile { map: Some(map) })
    }

    /// The content.
    #[inline]
    pub fn bytes(&self) -> &[u8] {
        self.map.as_deref().unwrap_or(&[])
    }

    /// Length in bytes.
    pub fn len(&self) -> u64 {
        self.bytes().len() as u64
    }

    /// True if the file has no bytes.
    pub fn is_empty(&self) -> bool {
        self.map.is_none()
    }

    /// Tells the system how the bytes will be read. Only a hint: a refusal, and a system without such hints,
    /// cost speed at most, so nothing is reported.
    pub fn advise(&self, access: Access) {
        #[cfg(unix)]
        if let Some(map) = &self.map {
            let advice = match access {
                Access::Sequential => memmap2::Advice::Sequential,
                Access::Random => memmap2::Advice::Random,
            };
            map.advise(advice).ok();
        }
        #[cfg(not(unix))]
        let _ = access;
    }
}

/// Opens the regular file `path` for reading, and tells its size.
///
/// # Errors
/// If it does not exist, may not be read, or is a directory, pipe or device.
pub fn open_regular(path: &Path) -> Result<(File, u64)> {
    // Asked before opening, since opening a pipe would wait for a writer.
    let kind = std::fs::metadata(path).map_err(Error::io(path, "open"))?;
    if kind.is_dir() {
        return Err(Error::input(path, "path", "is a directory", "name a file in it"));
    }
    if !kind.is_file() {
        return Err(Error::input(
            path,
            "path",
            "is not a regular file (a pipe or a device has no places to read at)",
            "write its content to a file first",
        ));
    }
    let file = File::open(path).map_err(Error::io(path, "open"))?;
    let bytes = file.metadata().map_err(Error::io(path, "read the size"))?.len();
    Ok((file, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_content_and_empty_files() {
        let dir = tempfile::tempdir().unwrap();
        let full = dir.path().join("full");
        std::fs::write(&full, b"brick").unwrap();
        let map = MappedFile::open(&full).unwrap();
        map.advise(Access::Sequential);
        map.advise(Access::Random);
        assert_eq!((map.bytes(), map.len(), map.is_empty()), (&b"brick"[..], 5, false));

        let empty = dir.path().join("empty");
        std::fs::write(&empty, b"").unwrap();
        let map = MappedFile::open(&empty).unwrap();
        map.advise(Access::Sequential);
        assert_eq!((map.bytes(), map.len(), map.is_empty()), (&b""[..], 0, true));
    }

    #[test]
    fn refuses_what_is_no_file() {
        let dir = tempfile::tempdir().unwrap();
        let text = MappedFile::open(dir.path()).unwrap_err().to_string();
        assert!(text.contains("is a directory"), "{text}");
        let text = MappedFile::open(&dir.path().join("none")).unwrap_err().to_string();
        assert!(text.contains("cannot open"), "{text}");
        #[cfg(unix)]
        {
            let text = MappedFile::open(Path::new("/dev/zero")).unwrap_err().to_string();
            assert!(text.contains("not a regular file"), "{text}");
        }
    }
}
