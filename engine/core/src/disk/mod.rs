//! The calls by which a file is written that must survive whatever happens: positioned, never through a map.
//!
//! They stand behind two traits, so that tests can let any one of them fail, and can work out what a crash between
//! any two of them leaves.

#[doc(hidden)]
pub mod planted;
#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod sim;
pub mod write_back;

use rustix::fs::{FallocateFlags, fallocate, statvfs};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Error, ErrorKind, Result};
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::Path;
use std::sync::Arc;

/// An open file. Any thread may call.
pub trait DiskFile: Send + Sync {
    /// Its size in bytes.
    ///
    /// # Errors
    /// The system's, as of all that follow.
    fn size(&self) -> Result<u64>;
    /// Reads some bytes; 0 at the end of the file.
    fn read_at(&self, bytes: &mut [u8], offset: u64) -> Result<usize>;
    /// Writes some of the bytes, and says how many.
    fn write_at(&self, bytes: &[u8], offset: u64) -> Result<usize>;
    /// Cuts the file off, or fills it up with zeros.
    fn set_size(&self, bytes: u64) -> Result<()>;
    /// Asks for room for so many bytes, of which some may then count as written, as zeros; whether it is given. No
    /// write needs it.
    fn reserve(&self, _bytes: u64) -> bool {
        false
    }
    /// Returns when content and size are durable.
    fn sync(&self) -> Result<()>;
}

impl dyn DiskFile {
    /// Reads all of the bytes.
    ///
    /// # Errors
    /// [`ErrorKind::UnexpectedEof`] if the file ends before.
    pub fn read_all_at(&self, mut bytes: &mut [u8], mut offset: u64) -> Result<()> {
        while !bytes.is_empty() {
            match self.read_at(bytes, offset) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(read) => {
                    bytes = &mut bytes[read..];
                    offset += read as u64;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Writes all of the bytes.
    ///
    /// # Errors
    /// The system's; some of the bytes may have been written then.
    pub fn write_all_at(&self, mut bytes: &[u8], mut offset: u64) -> Result<()> {
        while !bytes.is_empty() {
            match self.write_at(bytes, offset) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(written) => {
                    bytes = &bytes[written..];
                    offset += written as u64;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// Files by name.
pub trait Disk: Send + Sync {
    /// Opens or creates a file and takes its lock, which lasts as long as the file is open; `None` if another
    /// holds it.
    ///
    /// # Errors
    /// The system's, as of all that follow.
    fn open_locked(&self, path: &Path) -> Result<Option<Arc<dyn DiskFile>>>;
    /// Whether there is a file.
    fn exists(&self, path: &Path) -> Result<bool>;
    /// Gives a file another name, at once for whoever looks; a file that had it is gone.
    fn rename(&self, from: &Path, to: &Path) -> Result<()>;
    /// Removes a file.
    fn remove(&self, path: &Path) -> Result<()>;
    /// Returns when the names in the directory of `path` are durable.
    fn sync_directory(&self, path: &Path) -> Result<()>;
}

/// The system's own.
#[derive(Clone, Copy, Debug)]
pub struct SystemDisk;

impl DiskFile for File {
    fn size(&self) -> Result<u64> {
        Ok(self.metadata()?.len())
    }

    fn read_at(&self, bytes: &mut [u8], offset: u64) -> Result<usize> {
        FileExt::read_at(self, bytes, offset)
    }

    fn write_at(&self, bytes: &[u8], offset: u64) -> Result<usize> {
        FileExt::write_at(self, bytes, offset)
    }

    fn set_size(&self, bytes: u64) -> Result<()> {
        self.set_len(bytes)
    }

    fn reserve(&self, bytes: u64) -> bool {
        fallocate(self, FallocateFlags::empty(), 0, bytes).is_ok()
    }

    fn sync(&self) -> Result<()> {
        self.sync_data()
    }
}

impl Disk for SystemDisk {
    fn open_locked(&self, path: &Path) -> Result<Option<Arc<dyn DiskFile>>> {
        Ok(open_locked(path)?.map(|file| Arc::new(file) as Arc<dyn DiskFile>))
    }

    fn exists(&self, path: &Path) -> Result<bool> {
        path.try_exists()
    }

    fn rename(&self, from: &Path, to: &Path) -> Result<()> {
        std::fs::rename(from, to)
    }

    fn remove(&self, path: &Path) -> Result<()> {
        std::fs::remove_file(path)
    }

    fn sync_directory(&self, path: &Path) -> Result<()> {
        File::open(directory_of(path))?.sync_all()
    }
}

/// Bytes that are free on the disk of a folder.
///
/// # Errors
/// The system's.
pub fn free_bytes(folder: &Path) -> Result<u64> {
    let disk = statvfs(folder)?;
    Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
}

/// Size in bytes of a file that is there and that no writer holds locked; `None` if there is none, or its writer lives.
pub fn abandoned(path: &Path) -> Option<u64> {
    let file = OpenOptions::new().read(true).write(true).open(path).ok()?;
    file.try_lock().ok()?;
    file.metadata().ok().filter(|there| there.is_file()).map(|there| there.len())
}

/// The directory that a file is in.
pub fn directory_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// As [`Disk::open_locked`].
fn open_locked(path: &Path) -> Result<Option<File>> {
    // Another writer may finish or give up between opening and locking: the name then belongs to another
    // file, or to none, and the lock is worth nothing. Each turn that is lost so means that one was done.
    for _ in 0..64 {
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Ok(None),
            Err(TryLockError::Error(error)) => {
                return Err(Error::new(error.kind(), format!("lock: {error}")));
            }
        }
        let ours = file.metadata()?;
        let named = std::fs::metadata(path);
        if named.is_ok_and(|named| (named.dev(), named.ino()) == (ours.dev(), ours.ino())) {
            return Ok(Some(file));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_written_by_place_and_locked() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("x");
        assert!(!SystemDisk.exists(&path).unwrap());
        assert_eq!(abandoned(&path), None, "there is none");
        let file = SystemDisk.open_locked(&path).unwrap().expect("nobody has it");
        assert_eq!(abandoned(&path), None, "its writer lives");
        assert!(SystemDisk.open_locked(&path).unwrap().is_none());
        file.write_all_at(b"brick", 3).unwrap();
        // Some file systems give no room; none loses what is there.
        let reserved = file.reserve(100);
        assert_eq!(file.size().unwrap(), if reserved { 100 } else { 8 });
        file.set_size(8).unwrap();
        file.sync().unwrap();
        let mut bytes = [1; 8];
        file.read_all_at(&mut bytes, 0).unwrap();
        assert_eq!((&bytes, file.size().unwrap()), (b"\0\0\0brick", 8));
        assert_eq!(file.read_all_at(&mut bytes, 1).unwrap_err().kind(), ErrorKind::UnexpectedEof);
        let other = directory.path().join("y");
        SystemDisk.rename(&path, &other).unwrap();
        SystemDisk.sync_directory(&other).unwrap();
        assert!(SystemDisk.exists(&other).unwrap() && !SystemDisk.exists(&path).unwrap());
        assert!(SystemDisk.open_locked(&other).unwrap().is_none(), "the lock goes with the file");
        drop(file);
        SystemDisk.remove(&other).unwrap();
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
        assert_eq!(directory_of(Path::new("x")), Path::new("."));
    }
}
