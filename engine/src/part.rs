//! Files that get their name only when they are complete.

use crate::disk::open_locked;
use crate::error::{Error, Result};
use std::fs::File;
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
        let file = open_locked(&part).map_err(Error::io(path, "create"))?.ok_or_else(|| busy(path))?;
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

/// The error of a file that another process is writing.
pub(crate) fn busy(path: &Path) -> Error {
    let what = "another process is writing this file";
    Error::store(path, "output", what, "wait for it or choose another name")
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
