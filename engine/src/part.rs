//! Files that get their name only when they are complete.

use crate::error::{Error, Result};
use std::fs::{File, OpenOptions, TryLockError};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// A file named `NAME.part`, locked against other writers, until it is finished; removed if it never is.
#[derive(Debug)]
pub struct PartFile {
    path: PathBuf,
    part: PathBuf,
    file: File,
    finished: bool,
}

impl PartFile {
    /// Creates the unfinished file, or empties what a killed writer left of one.
    ///
    /// # Errors
    /// If `path` is a directory, the file cannot be created, or another process is writing it.
    pub fn create(path: &Path) -> Result<PartFile> {
        if path.is_dir() {
            let remedy = "give the file a name in it";
            return Err(Error::store(path, "output", "this is a directory", remedy));
        }
        let part = part_path(path);
        let file = lock(path, &part)?;
        let part_file = PartFile { path: path.to_owned(), part, file, finished: false };
        part_file.file.set_len(0).map_err(Error::io(path, "empty"))?;
        Ok(part_file)
    }

    /// The final name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The open file.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// If it cannot be renamed; it is removed then.
    pub fn finish(&mut self) -> Result<()> {
        std::fs::rename(&self.part, &self.path)
            .map_err(Error::io(&self.path, "rename the finished file to"))?;
        self.finished = true;
        Ok(())
    }
}

impl Drop for PartFile {
    fn drop(&mut self) {
        if !self.finished {
            // Nobody would look for the temporary name; the error that led here is the one to report.
            let _ = std::fs::remove_file(&self.part);
        }
    }
}

/// The name of the unfinished file.
pub fn part_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    PathBuf::from(name)
}

/// Opens or creates the unfinished file and takes its lock, which lasts as long as the file is open.
pub(crate) fn lock(path: &Path, part: &Path) -> Result<File> {
    // Another writer may finish or give up between opening and locking: the name then belongs to another
    // file, or to none, and the lock is worth nothing. Each turn that is lost so means that one was done.
    for _ in 0..64 {
        let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).clone();
        let file = options.open(part).map_err(Error::io(path, "create"))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => break,
            Err(TryLockError::Error(error)) => return Err(Error::io(part, "lock")(error)),
        }
        let ours = file.metadata().map_err(Error::io(part, "inspect"))?;
        let named = std::fs::metadata(part);
        if named.is_ok_and(|named| (named.dev(), named.ino()) == (ours.dev(), ours.ino())) {
            return Ok(file);
        }
    }
    let what = "another process is writing this file";
    Err(Error::store(path, "output", what, "wait for it or choose another name"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn one_writer_at_a_time_and_nothing_left_behind() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("mesh.stl");
        let mut first = PartFile::create(&path).unwrap();
        let refused = PartFile::create(&path).unwrap_err().to_string();
        assert!(refused.contains("another process is writing"), "{refused}");
        first.file().write_all(b"whole").unwrap();
        first.finish().unwrap();
        drop(first);
        assert_eq!(std::fs::read(&path).unwrap(), b"whole");
        drop(PartFile::create(&path).unwrap());
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
    }
}
