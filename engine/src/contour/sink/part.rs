//! A file that gets its name only when it is complete.

use crate::error::{Error, Result};
use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Large enough that a system call is rare next to the encoding.
const BUFFER_BYTES: usize = 1 << 20;

/// A buffered file named `<name>.part` until it is finished; removed if it never is.
pub(super) struct PartFile {
    path: PathBuf,
    part: PathBuf,
    writer: Option<BufWriter<File>>,
}

impl PartFile {
    pub(super) fn create(path: &Path) -> Result<PartFile> {
        let mut name = path.as_os_str().to_owned();
        name.push(".part");
        let part = PathBuf::from(name);
        let file = File::create(&part).map_err(Error::io(path, "create"))?;
        Ok(PartFile {
            path: path.to_owned(),
            part,
            writer: Some(BufWriter::with_capacity(BUFFER_BYTES, file)),
        })
    }

    /// Runs `write` on the open file and names the file in its error.
    pub(super) fn write(
        &mut self,
        write: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
    ) -> Result<()> {
        match &mut self.writer {
            Some(writer) => write(writer).map_err(Error::io(&self.path, "write")),
            None => Err(Error::io(&self.path, "write")(std::io::Error::other("the file is finished"))),
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
        self.writer = None;
        std::fs::rename(&self.part, &self.path).map_err(|error| {
            // Nobody would look for the temporary name; what cannot be removed either stays.
            let _ = std::fs::remove_file(&self.part);
            Error::io(&self.path, "rename the finished mesh to")(error)
        })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for PartFile {
    fn drop(&mut self) {
        if let Some(writer) = self.writer.take() {
            // What is still buffered goes with the file.
            drop(writer.into_parts().0);
            let _ = std::fs::remove_file(&self.part);
        }
    }
}
