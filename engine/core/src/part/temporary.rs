//! Temporary files of what does not fit in memory.

use crate::disk::{DiskFile, free_bytes};
use crate::error::{Error, Result};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

/// A file that stands beside another under a name made of its own, and is removed when it is no longer needed. A program that is
/// killed leaves it.
pub struct BesideFile(PathBuf);

impl BesideFile {
    /// Of `file`, with an ending more. Nothing is made.
    pub fn new(file: &Path, ending: &str) -> BesideFile {
        let mut name = file.as_os_str().to_owned();
        name.push(ending);
        BesideFile(PathBuf::from(name))
    }

    /// Its name.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for BesideFile {
    fn drop(&mut self) {
        // What is left of it harms nobody.
        let _ = std::fs::remove_file(&self.0);
    }
}

/// A file without a name in some folder: however the program ends, killed included, the system removes it. It is made
/// when it is first written.
pub struct TempFile {
    folder: PathBuf,
    file: OnceLock<Arc<dyn DiskFile>>,
    end: AtomicU64,
}

impl TempFile {
    /// A file to be made in `folder`.
    pub fn new(folder: &Path) -> TempFile {
        TempFile { folder: folder.to_owned(), file: OnceLock::new(), end: AtomicU64::new(0) }
    }

    /// Bytes written so far.
    pub fn bytes(&self) -> u64 {
        self.end.load(Ordering::Relaxed)
    }

    /// Appends bytes, from any thread, and returns where they lie.
    ///
    /// # Errors
    /// If the file cannot be made or written.
    pub fn append(&self, bytes: &[u8]) -> Result<u64> {
        let file = match self.file.get() {
            Some(file) => file,
            None => {
                let new =
                    make(&self.folder).map_err(Error::io(&self.folder, "create a temporary file in"))?;
                // Of two threads that come here at once one wins, and the other's file vanishes.
                self.file.get_or_init(|| new)
            }
        };
        let offset = self.end.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        file.write_all_at(bytes, offset).map_err(Error::io(&self.folder, "write a temporary file in"))?;
        Ok(offset)
    }

    /// Reads `bytes.len()` bytes that were appended at `offset`.
    ///
    /// # Errors
    /// If the system cannot.
    pub fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<()> {
        let read = self.file.get().ok_or(std::io::ErrorKind::UnexpectedEof.into());
        read.and_then(|file| file.read_all_at(bytes, offset))
            .map_err(Error::io(&self.folder, "read the temporary file in"))
    }

    /// The error of bytes that are not those written.
    pub fn damaged(&self) -> Error {
        let source = std::io::Error::new(
            std::io::ErrorKind::InvalidData,
            "the disk returned other bytes than written",
        );
        Error::io(&self.folder, "read the temporary file in")(source)
    }

    /// See [`require_room`], for its folder.
    ///
    /// # Errors
    /// As that.
    pub fn require_room(&self, bytes: u64) -> Result<()> {
        require_room(&self.folder, bytes)
    }
}

/// Fails unless a folder's disk has room for `bytes`.
///
/// # Errors
/// If it has not, or cannot be asked.
pub fn require_room(folder: &Path, bytes: u64) -> Result<()> {
    let free = free_bytes(folder).map_err(Error::io(folder, "find out the free space of"))?;
    if bytes <= free {
        return Ok(());
    }
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    Err(Error::store(
        folder,
        "temporary file",
        format!("about {} MiB are needed and {} MiB are free", mib(bytes), mib(free)),
        "make room, choose another folder with `temp_dir`, or allow more memory with `memory`",
    ))
}

/// Fails unless temporary files can be made there.
///
/// # Errors
/// If it is no folder.
pub fn require_folder(folder: &Path) -> Result<()> {
    if folder.is_dir() {
        return Ok(());
    }
    let remedy = "name an existing folder with `temp_dir`";
    Err(Error::store(folder, "temporary file", "this is not a folder", remedy))
}

fn make(folder: &Path) -> io::Result<Arc<dyn DiskFile>> {
    #[cfg(any(test, feature = "testing"))]
    if let Some(file) = stand_in::of(folder) {
        return Ok(file);
    }
    Ok(Arc::new(tempfile::tempfile_in(folder)?))
}

/// Files that tests put in the place of a folder's temporary file.
#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod stand_in {
    use super::*;
    use std::collections::BTreeMap;
    use std::sync::{Mutex, PoisonError};

    static FILES: Mutex<BTreeMap<PathBuf, Arc<dyn DiskFile>>> = Mutex::new(BTreeMap::new());

    pub(super) fn of(folder: &Path) -> Option<Arc<dyn DiskFile>> {
        FILES.lock().unwrap_or_else(PoisonError::into_inner).get(folder).cloned()
    }

    /// From now on the temporary file of that folder is this one.
    pub fn put(folder: &Path, file: Arc<dyn DiskFile>) {
        FILES.lock().unwrap_or_else(PoisonError::into_inner).insert(folder.to_owned(), file);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_no_name_and_returns_what_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let file = TempFile::new(folder.path());
        assert!(file.read(0, &mut [0]).is_err());
        let (a, b) = (file.append(b"brick").unwrap(), file.append(b"field").unwrap());
        let mut bytes = [0; 5];
        file.read(b, &mut bytes).unwrap();
        assert_eq!((&bytes, file.bytes()), (b"field", 10));
        file.read(a, &mut bytes).unwrap();
        assert_eq!(&bytes, b"brick");
        assert!(file.read(6, &mut bytes).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn too_little_room_is_known_beforehand() {
        let folder = tempfile::tempdir().unwrap();
        let file = TempFile::new(folder.path());
        file.require_room(1).unwrap();
        let refused = file.require_room(u64::MAX).unwrap_err().to_string();
        assert!(refused.contains("are free; make room"), "{refused}");
        assert!(TempFile::new(&folder.path().join("none")).require_room(1).is_err());
    }
}
