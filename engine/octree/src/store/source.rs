//! The bytes of a store, wherever they are read from.

use super::pieces::{HELD_BYTES, Pieces};
use super::ranges::{ByteRanges, RangeFault};
use crate::error::Result;
use crate::mmap::{Access, MappedFile, open_regular};
use rustix::fs::{Advice, fadvise};
use std::fs::File;
use std::io::ErrorKind;
use std::num::NonZeroU64;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;

/// How a store is read. Answers are the same; what differs is what happens if another process, or the network,
/// interferes.
///
/// Nobody should change a store that is being read, and no program of this project does: builds write under another
/// name and rename. Whatever somebody else does, a record is copied, compared with its checksum and decoded from the
/// copy, so that no wrong answer comes of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Io {
    /// By positioned reads. If the file is cut short or its disk fails meanwhile, reading is an error. The right way on
    /// network mounts.
    #[default]
    Pread,
    /// Through a memory map. If the file is cut short, or its disk fails, reading is an error too, by way of a signal; see
    /// [`crate::mmap`] for what that cannot do. Saves a system call a record, which counts where bricks are small and all in
    /// memory.
    Mmap,
}

/// Of a record that was there when the file was opened.
const CUT_SHORT: &str = "the file has been cut short since it was opened, or its disk has failed";

/// An open file, or the bytes of one.
pub(super) enum ByteSource {
    Map(MappedFile),
    File {
        file: File,
        /// Its size when it was opened.
        bytes: u64,
    },
    /// What lies elsewhere and comes by ranges.
    Elsewhere(Pieces),
    #[cfg(any(test, feature = "fuzzing"))]
    Memory(Vec<u8>),
}

impl ByteSource {
    /// Opens a regular file.
    ///
    /// # Errors
    /// As [`MappedFile::open`].
    pub fn open(path: &Path, io: Io) -> Result<ByteSource> {
        Ok(match io {
            Io::Pread => {
                let (file, bytes) = open_regular(path)?;
                ByteSource::File { file, bytes }
            }
            Io::Mmap => {
                let map = MappedFile::open(path)?;
                map.advise(Access::Random);
                ByteSource::Map(map)
            }
        })
    }

    /// A file that lies elsewhere.
    pub fn elsewhere(ranges: Arc<dyn ByteRanges>) -> ByteSource {
        ByteSource::Elsewhere(Pieces::new(ranges, HELD_BYTES))
    }

    /// Where a part takes a while to come, the file that it comes from.
    pub fn pieces(&self) -> Option<&Pieces> {
        match self {
            ByteSource::Elsewhere(pieces) => Some(pieces),
            _ => None,
        }
    }

    /// Why nothing more can be read, where the reason is not the file itself.
    pub fn fault(&self) -> Option<&RangeFault> {
        self.pieces()?.fault()
    }

    /// Memory that it takes at most.
    pub fn bytes_held(&self) -> u64 {
        self.pieces().map_or(0, |_| HELD_BYTES)
    }

    /// Size in bytes.
    pub fn bytes(&self) -> u64 {
        match self {
            ByteSource::Map(map) => map.len(),
            ByteSource::File { bytes, .. } => *bytes,
            ByteSource::Elsewhere(pieces) => pieces.bytes(),
            #[cfg(any(test, feature = "fuzzing"))]
            ByteSource::Memory(bytes) => bytes.len() as u64,
        }
    }

    /// Copies a part of the file into `to`, in place of what that holds. Takes no memory for what is not there.
    ///
    /// # Errors
    /// One phrase.
    pub fn read(&self, offset: u64, length: u64, to: &mut Vec<u8>) -> std::result::Result<(), String> {
        let end = offset.checked_add(length).filter(|end| *end <= self.bytes());
        let end = end.ok_or("it lies outside the file")? as usize;
        match self {
            ByteSource::Map(map) => {
                to.clear();
                to.extend_from_slice(&map.bytes()[offset as usize..end]);
                if map.lost().is_some_and(|from| from < end as u64) {
                    return Err(CUT_SHORT.to_owned());
                }
            }
            ByteSource::File { file, .. } => {
                to.resize(length as usize, 0);
                file.read_exact_at(to, offset).map_err(|error| match error.kind() {
                    ErrorKind::UnexpectedEof => CUT_SHORT.to_owned(),
                    _ => format!("it cannot be read: {error}"),
                })?;
            }
            ByteSource::Elsewhere(pieces) => {
                to.resize(length as usize, 0);
                pieces.read(offset, to)?;
            }
            #[cfg(any(test, feature = "fuzzing"))]
            ByteSource::Memory(bytes) => {
                to.clear();
                to.extend_from_slice(&bytes[offset as usize..end]);
            }
        }
        Ok(())
    }

    /// Tells the system, or who fetches from elsewhere, that a part will be read before long. Only a hint, so nobody is told
    /// of a refusal.
    pub fn ahead(&self, offset: u64, bytes: u64) {
        match self {
            ByteSource::Map(map) => map.advise_ahead(offset, bytes),
            ByteSource::File { file, .. } => {
                let _ = fadvise(file, offset, NonZeroU64::new(bytes), Advice::WillNeed);
            }
            ByteSource::Elsewhere(pieces) => pieces.ahead(offset, bytes),
            #[cfg(any(test, feature = "fuzzing"))]
            ByteSource::Memory(_) => {}
        }
    }

    /// A part of the file.
    ///
    /// # Errors
    /// As [`ByteSource::read`].
    pub fn part(&self, offset: u64, length: u64) -> std::result::Result<Vec<u8>, String> {
        let mut bytes = Vec::new();
        self.read(offset, length, &mut bytes)?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_ways_of_reading_read_the_same() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("x");
        std::fs::write(&path, b"a brick store").unwrap();
        for io in [Io::Pread, Io::Mmap] {
            let source = ByteSource::open(&path, io).unwrap();
            assert_eq!(source.bytes(), 13);
            assert_eq!(source.part(2, 5).unwrap(), b"brick");
            let mut bytes = vec![9; 100];
            source.read(8, 5, &mut bytes).unwrap();
            assert_eq!(bytes, b"store");
            assert!(source.part(9, 5).is_err() && source.part(u64::MAX, 2).is_err());
            assert!(ByteSource::open(directory.path(), io).is_err());
        }
    }

    #[test]
    fn a_file_cut_short_is_an_error() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("x");
        std::fs::write(&path, vec![7; 100_000]).unwrap();
        let [read, mapped] = [Io::Pread, Io::Mmap].map(|io| ByteSource::open(&path, io).unwrap());
        File::options().write(true).open(&path).unwrap().set_len(5_000).unwrap();
        for source in [read, mapped] {
            assert_eq!(source.part(4_000, 1_000).unwrap(), [7; 1_000]);
            assert!(source.part(4_500, 95_000).unwrap_err().contains("cut short"));
            // What is left is still read.
            assert_eq!(source.part(0, 1_000).unwrap(), [7; 1_000]);
        }
    }
}
