//! Files that get their name only when they are complete, and durable.

pub mod folder;
#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod outputs;
mod pair;
pub mod temporary;

pub use crate::disk::{directory_of, free_bytes};
pub use pair::PartPair;

use crate::disk::planted::{Bug, planted};
use crate::disk::write_back::WriteBack;
use crate::disk::{Disk, DiskFile, SystemDisk, abandoned};
use crate::error::{Error, Result};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// What small parts are gathered in before a system call; larger ones go to the file as they are.
const BUFFER_BYTES: usize = 64 << 10;
/// What the disk is asked for at a time, ahead of what is appended. With the place of its blocks settled beforehand a
/// file takes ext4 half the time to write.
const RESERVE_BYTES: u64 = 64 << 20;
/// Smaller files ask for nothing.
const SMALL_BYTES: u64 = 4 << 20;

/// A file named `NAME.part`, locked against other writers, until it is finished; removed if it never is. A program that
/// is killed leaves it, and the next writer of the same name begins by emptying it.
///
/// What is written goes to the disk in the background, so that [`PartFile::finish`] has little to wait for. An error
/// from any call is for good: the file never gets its name.
pub struct PartFile {
    disk: Arc<dyn Disk>,
    path: PathBuf,
    part: PathBuf,
    file: Arc<dyn DiskFile>,
    /// Appended, but not yet written.
    buffer: Vec<u8>,
    /// Where the buffer goes.
    end: u64,
    /// Up to where there is room, as far as it matters.
    reserved: u64,
    written: Mutex<WriteProgress>,
    finished: bool,
}

/// How far writing has come.
#[derive(Default)]
struct WriteProgress {
    bytes: u64,
    /// Where the last of them ends.
    end: u64,
    back: WriteBack,
    failed: bool,
}

impl PartFile {
    /// Creates the unfinished file, or empties what a killed writer left of one.
    ///
    /// # Errors
    /// If `path` is there and no regular file, the file cannot be created, or another process is writing it.
    pub fn create(path: &Path) -> Result<PartFile> {
        PartFile::create_on(Arc::new(SystemDisk), path)
    }

    /// As [`PartFile::create`], on another disk than the system's.
    pub fn create_on(disk: Arc<dyn Disk>, path: &Path) -> Result<PartFile> {
        if path.is_dir() {
            let remedy = "give the file a name in it";
            return Err(Error::store(path, "output", "this is a directory", remedy));
        }
        // A device would be replaced by the finished file: no more /dev/null for anybody.
        if std::fs::metadata(path).is_ok_and(|there| !there.is_file()) {
            let what = "this is no regular file";
            return Err(Error::store(path, "output", what, "choose the name of a file"));
        }
        let part = part_path(path);
        let file = disk.open_locked(&part).map_err(|error| not_created(path, error))?;
        let file = file.ok_or_else(|| busy(path))?;
        let (buffer, written) = (Vec::with_capacity(BUFFER_BYTES), Mutex::default());
        let created = PartFile {
            disk,
            path: path.to_owned(),
            part,
            file,
            buffer,
            end: 0,
            reserved: SMALL_BYTES,
            written,
            finished: false,
        };
        created.file.set_size(0).map_err(Error::io(path, "empty"))?;
        Ok(created)
    }

    /// The final name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes appended so far.
    pub fn appended(&self) -> u64 {
        self.end + self.buffer.len() as u64
    }

    /// Adds bytes at the end of what was appended before.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn append(&mut self, bytes: &[u8]) -> Result<()> {
        self.try_append(bytes).map_err(Error::io(&self.path, "write"))
    }

    fn try_append(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.buffer.len() + bytes.len() > BUFFER_BYTES {
            self.write_buffer()?;
        }
        if bytes.len() < BUFFER_BYTES {
            self.buffer.extend_from_slice(bytes);
            return Ok(());
        }
        self.write_at_end(bytes)
    }

    fn write_at_end(&mut self, bytes: &[u8]) -> io::Result<()> {
        let end = self.end + bytes.len() as u64;
        if end > self.reserved {
            let wanted = end + RESERVE_BYTES;
            // Whether there is none, or the file system cannot tell, is left to the writing to find out.
            self.reserved = if self.file.reserve(wanted) { wanted } else { u64::MAX };
        }
        self.try_write_at(bytes, self.end)?;
        self.end = end;
        Ok(())
    }

    fn write_buffer(&mut self) -> io::Result<()> {
        if !self.buffer.is_empty() {
            let mut buffer = std::mem::take(&mut self.buffer);
            let done = self.write_at_end(&buffer);
            buffer.clear();
            self.buffer = buffer;
            done?;
        }
        Ok(())
    }

    /// Writes bytes to a place behind all that is ever appended, from any thread. To change what was appended there is
    /// [`PartFile::overwrite`].
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn write_at(&self, bytes: &[u8], offset: u64) -> Result<()> {
        self.try_write_at(bytes, offset).map_err(Error::io(&self.path, "write"))
    }

    fn try_write_at(&self, bytes: &[u8], offset: u64) -> io::Result<()> {
        let done = self.file.write_all_at(bytes, offset);
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        written.failed |= done.is_err();
        written.bytes += bytes.len() as u64;
        written.end = written.end.max(offset + bytes.len() as u64);
        let bytes = written.bytes;
        written.back.wrote(&self.file, bytes);
        done
    }

    /// Overwrites the first bytes of what was appended.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn overwrite(&mut self, offset: u64, bytes: &[u8]) -> Result<()> {
        self.write_over(offset, bytes).map_err(Error::io(&self.path, "write"))
    }

    /// As [`PartFile::overwrite`].
    pub fn write_over(&mut self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        self.write_buffer()?;
        self.try_write_at(bytes, offset)
    }

    /// Makes the file durable, gives it its name, and makes that durable too. Nothing may be written any more.
    ///
    /// # Errors
    /// If any part of it was not written, or it cannot be made durable or renamed: it is removed then, and an older
    /// file of that name stays. If all that fails is to make the name durable, the file has it, whole.
    pub fn finish(&mut self) -> Result<()> {
        self.sync().map_err(Error::io(&self.path, "write"))?;
        let renamed = self.disk.rename(&self.part, &self.path);
        renamed.map_err(Error::io(&self.path, "rename the finished file to"))?;
        self.finished = true;
        if planted(Bug::PartDirectoryNotSynced) {
            return Ok(());
        }
        let synced = self.disk.sync_directory(&self.path);
        synced.map_err(Error::io(&self.path, "make durable the name of the finished file"))
    }

    fn sync(&mut self) -> io::Result<()> {
        self.write_buffer()?;
        let written = self.written.get_mut().unwrap_or_else(PoisonError::into_inner);
        if written.failed && !planted(Bug::PartFailureIgnored) {
            return Err(io::Error::other("an earlier write failed"));
        }
        written.back.finish()?;
        if self.reserved != SMALL_BYTES {
            self.file.set_size(written.end)?;
        }
        if planted(Bug::PartNotSynced) { Ok(()) } else { self.file.sync() }
    }
}

impl Write for PartFile {
    /// Appends all of the bytes.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.try_append(bytes).map(|()| bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.write_buffer()
    }
}

impl std::fmt::Debug for PartFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PartFile").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Drop for PartFile {
    fn drop(&mut self) {
        // The thread that writes back holds the file open, and with it the lock.
        let _ = self.written.get_mut().unwrap_or_else(PoisonError::into_inner).back.finish();
        if !self.finished && !planted(Bug::PartLeftBehind) {
            // Nobody would look for the temporary name; the error that led here is the one to report.
            let _ = self.disk.remove(&self.part);
        }
    }
}

/// Size in bytes of the unfinished file of a writer that was killed; `None` if there is none, or its writer lives. The next
/// writer of the name removes it.
pub fn left_behind(path: &Path) -> Option<u64> {
    abandoned(&part_path(path))
}

/// Free bytes for a file of that name, with what a killed writer of it has left; `None` where the system does not tell.
pub fn free_beside(path: &Path) -> Option<u64> {
    let free = free_bytes(directory_of(path)).ok()?;
    Some(free.saturating_add(left_behind(path).unwrap_or(0)))
}

/// The name of the unfinished file.
pub fn part_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    PathBuf::from(name)
}

fn not_created(path: &Path, error: io::Error) -> Error {
    match require_directory(path) {
        Err(missing) if error.kind() == io::ErrorKind::NotFound => missing,
        _ => Error::io(path, "create")(error),
    }
}

/// Fails unless the directory that a file is to be made in is there.
///
/// # Errors
/// [`Error::Store`] that says so.
pub fn require_directory(path: &Path) -> Result<()> {
    if directory_of(path).is_dir() {
        return Ok(());
    }
    Err(Error::store(path, "output", "its directory does not exist", "create the directory first"))
}

/// The error of a file that another process is writing.
pub fn busy(path: &Path) -> Error {
    let what = "another process is writing this file";
    Error::store(path, "output", what, "wait for it or choose another name")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::disk::planted::with_planted;
    use crate::part::outputs::{NAME, cut_everywhere, fail_everywhere};
    use std::panic::{AssertUnwindSafe, catch_unwind};

    /// Small and large parts, and places in any order.
    fn write(disk: Arc<dyn Disk>) -> Result<()> {
        let mut file = PartFile::create_on(disk, Path::new(NAME))?;
        file.append(b"small")?;
        file.append(&[7; BUFFER_BYTES])?;
        file.append(b"parts")?;
        file.overwrite(1, b"M")?;
        let end = file.appended();
        file.write_at(b"places", end + 10)?;
        file.write_at(b"0123456789", end)?;
        file.finish()
    }

    #[test]
    fn one_writer_at_a_time_and_nothing_left_behind() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("mesh.stl");
        let mut first = PartFile::create(&path).unwrap();
        let refused = PartFile::create(&path).unwrap_err().to_string();
        assert!(refused.contains("another process is writing"), "{refused}");
        first.append(b"whole").unwrap();
        first.finish().unwrap();
        drop(first);
        assert_eq!(std::fs::read(&path).unwrap(), b"whole");
        std::fs::write(part_path(&path), b"half").unwrap();
        assert_eq!(left_behind(&path), Some(4));
        let next = PartFile::create(&path).unwrap();
        assert_eq!(left_behind(&path), None, "its writer lives");
        drop(next);
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_is_no_file_is_not_replaced_by_one() {
        let refused = PartFile::create(Path::new("/dev/null")).unwrap_err().to_string();
        assert!(refused.contains("/dev/null") && refused.contains("no regular file"), "{refused}");
        assert!(!Path::new("/dev/null.part").exists());
    }

    #[test]
    fn every_byte_goes_where_it_belongs() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a");
        let mut file = PartFile::create(&path).unwrap();
        let mut bytes = Vec::new();
        for length in [0, 1, BUFFER_BYTES - 1, 2, BUFFER_BYTES, BUFFER_BYTES + 1, 5, 9 << 20, 3] {
            let part: Vec<u8> = (0..length).map(|n| (n % 251) as u8).collect();
            file.append(&part).unwrap();
            bytes.extend(part);
        }
        assert_eq!(file.appended(), bytes.len() as u64);
        file.overwrite(2, b"patch").unwrap();
        bytes[2..7].copy_from_slice(b"patch");
        file.finish().unwrap();
        assert!(std::fs::read(&path).unwrap() == bytes);
    }

    #[test]
    fn every_call_may_fail_and_the_power_go() {
        assert!(fail_everywhere(&write) > 40);
        assert!(cut_everywhere(&write, 100) > 1000);
    }

    #[test]
    fn a_failed_write_is_not_forgotten() {
        ignore_failures();
    }

    /// # Panics
    /// If a file gets its name of which a part was not written.
    fn ignore_failures() -> usize {
        fail_everywhere(&|disk| {
            let mut file = PartFile::create_on(disk, Path::new(NAME))?;
            // Who does not look at errors.
            let _ = file.append(&[7; BUFFER_BYTES]);
            let _ = file.append(&[8; BUFFER_BYTES]);
            file.finish()
        })
    }

    #[test]
    fn every_planted_mistake_is_found() {
        let cut: fn() -> usize = || cut_everywhere(&write, 10);
        let cases = [
            (Bug::PartNotSynced, cut),
            (Bug::PartDirectoryNotSynced, cut),
            (Bug::PartFailureIgnored, ignore_failures),
            (Bug::PartLeftBehind, || fail_everywhere(&write)),
        ];
        for (bug, test) in cases {
            let found = with_planted(bug, || catch_unwind(AssertUnwindSafe(test)).is_err());
            assert!(found, "{bug:?}");
        }
    }
}
