//! A mesh file that gets its name only when it is complete.

use crate::error::{Error, Result};
use crate::part::PartFile;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// What small parts are gathered in before a system call; larger ones go to the file as they are.
const BUFFER_BYTES: usize = 64 << 10;

/// A buffered [`PartFile`].
pub(super) struct MeshFile {
    path: PathBuf,
    /// `None` once it is finished. What is still buffered when it is dropped goes with the file.
    open: Option<(BufWriter<File>, PartFile)>,
}

impl MeshFile {
    pub(super) fn create(path: &Path) -> Result<MeshFile> {
        let part = PartFile::create(path)?;
        let file = part.file().try_clone().map_err(Error::io(path, "create"))?;
        let writer = BufWriter::with_capacity(BUFFER_BYTES, file);
        Ok(MeshFile { path: path.to_owned(), open: Some((writer, part)) })
    }

    /// Appends bytes.
    pub(super) fn append(&mut self, bytes: &[u8]) -> Result<()> {
        self.write(|writer| writer.write_all(bytes))
    }

    /// Runs `write` on the open file and names the file in its error.
    fn write(&mut self, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<()> {
        match &mut self.open {
            Some((writer, _)) => write(writer).map_err(Error::io(&self.path, "write")),
            None => Err(Error::io(&self.path, "write")(io::Error::other("the file is finished"))),
        }
    }

    /// Overwrites what stands at `offset`.
    pub(super) fn patch(&mut self, offset: u64, bytes: &[u8]) -> Result<()> {
        self.write(|writer| {
            writer.seek(SeekFrom::Start(offset))?;
            writer.write_all(bytes)
        })
    }

    /// Flushes the file and gives it its name.
    pub(super) fn finish(&mut self) -> Result<()> {
        self.write(|writer| writer.flush())?;
        match self.open.take() {
            Some((_, mut part)) => part.finish(),
            None => Ok(()),
        }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for MeshFile {
    fn drop(&mut self) {
        if let Some((writer, _)) = self.open.take() {
            drop(writer.into_parts());
        }
    }
}
