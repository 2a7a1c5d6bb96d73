//! A mesh file that gets its name only when it is complete.

use crate::error::{Error, Result};
use crate::part::PartFile;
use rustix::fs::{FallocateFlags, fallocate};
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// What small parts are gathered in before a system call; larger ones go to the file as they are.
const BUFFER_BYTES: usize = 64 << 10;
/// What the disk is asked for at a time, ahead of what is written. With the place of its blocks settled beforehand a
/// file takes ext4 half the time to write, and the rename over an older one need not wait for the disk.
const RESERVE_BYTES: u64 = 64 << 20;
/// Smaller files ask for nothing.
const SMALL_BYTES: u64 = 4 << 20;

/// A buffered [`PartFile`].
pub(super) struct MeshFile {
    path: PathBuf,
    /// Bytes appended.
    length: u64,
    /// Bytes that the file has room for; the most there are once the system has refused.
    reserved: u64,
    /// `None` once it is finished. What is still buffered when it is dropped goes with the file.
    open: Option<(BufWriter<File>, PartFile)>,
}

impl MeshFile {
    pub(super) fn create(path: &Path) -> Result<MeshFile> {
        let part = PartFile::create(path)?;
        let file = part.file().try_clone().map_err(Error::io(path, "create"))?;
        let writer = BufWriter::with_capacity(BUFFER_BYTES, file);
        Ok(MeshFile { path: path.to_owned(), length: 0, reserved: SMALL_BYTES, open: Some((writer, part)) })
    }

    /// Appends bytes.
    pub(super) fn append(&mut self, bytes: &[u8]) -> Result<()> {
        self.length += bytes.len() as u64;
        if self.length > self.reserved {
            self.reserve();
        }
        self.write(|writer| writer.write_all(bytes))
    }

    /// Asks for room for what is appended next. That there is none, or that the file system cannot tell, is left to
    /// the writing to find out.
    fn reserve(&mut self) {
        let Some((_, part)) = &self.open else { return };
        let wanted = self.length + RESERVE_BYTES;
        let given = fallocate(part.file(), FallocateFlags::empty(), 0, wanted);
        self.reserved = if given.is_ok() { wanted } else { u64::MAX };
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
        let length = self.length;
        self.write(|writer| {
            writer.flush()?;
            writer.get_ref().set_len(length)
        })?;
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
