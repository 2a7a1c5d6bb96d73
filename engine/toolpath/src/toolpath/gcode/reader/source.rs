//! The bytes of a G-code file: plain, or unpacked on the way.

use super::bgcode::{self, Bgcode};
use super::member::Text;
use crate::error::{Error, Result};
use std::fs::File;
use std::io::{self, Chain, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

/// Most memory that unpacking may take, in KiB. `xz -9` needs 64 MiB; what a damaged header asks for goes up to
/// 4 GiB.
const UNPACK_KIB_MAX: u32 = 256 << 10;

/// Bytes at the front that are looked at.
const START_BYTES: usize = 16;

const GZIP: &[u8] = b"\x1f\x8b";
const XZ: &[u8] = b"\xfd7zXZ\0";

/// Beginnings of other files that a user may well try: what they are, and what to do.
const FOREIGN: [(&[u8], &str, &str); 4] = [
    (b"PK\x03\x04", "a ZIP archive (.3mf is one)", "unpack it and give the .gcode file in it"),
    (b"\x28\xb5\x2f\xfd", "compressed with zstd", "unpack it, or compress it with gzip or xz"),
    (b"BZh", "compressed with bzip2", "unpack it, or compress it with gzip or xz"),
    (b"\x7fELF", "a program", "give a G-code file"),
];

type Peeked<R> = Chain<Cursor<Vec<u8>>, R>;

/// A stream of text.
pub(super) enum TextStream<R: Read> {
    Plain(Peeked<R>),
    Gzip(Box<flate2::read::MultiGzDecoder<Peeked<R>>>),
    Xz(Box<lzma_rust2::XzReader<Peeked<R>>>),
    Binary(Box<Bgcode<Peeked<R>>>),
}

impl<R: Read> TextStream<R> {
    /// The text in `packed`, the content of the file `path`, by what it begins with.
    ///
    /// # Errors
    /// If it is empty, cannot be read, or is of a format that is known not to be G-code text.
    pub(super) fn new(path: &Path, packed: R) -> Result<TextStream<R>> {
        let (start, packed) = peek(packed).map_err(Error::io(path, "read"))?;
        if start.is_empty() {
            return Err(Error::input(path, "byte 0", "is empty", "export or copy the file again"));
        }
        refuse_foreign(path, &start)?;
        if start.starts_with(GZIP) {
            return Ok(TextStream::Gzip(Box::new(flate2::read::MultiGzDecoder::new(packed))));
        }
        if start.starts_with(XZ) {
            let reader = lzma_rust2::XzReader::new_mem_limit(packed, true, UNPACK_KIB_MAX);
            return Ok(TextStream::Xz(Box::new(reader)));
        }
        if start.starts_with(bgcode::MAGIC) {
            return Ok(TextStream::Binary(Box::new(Bgcode::new(packed))));
        }
        Ok(TextStream::Plain(packed))
    }

    /// What reading it is called in messages.
    pub(super) fn action(&self) -> &'static str {
        match self {
            TextStream::Plain(_) => "read",
            TextStream::Gzip(_) | TextStream::Xz(_) | TextStream::Binary(_) => "unpack (cut off or damaged?)",
        }
    }
}

impl<R: Read> Read for TextStream<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            TextStream::Plain(reader) => reader.read(buffer),
            TextStream::Gzip(reader) => reader.read(buffer),
            TextStream::Xz(reader) => reader.read(buffer),
            TextStream::Binary(reader) => reader.read(buffer),
        }
    }
}

/// The first bytes, and the stream with them still in front.
fn peek<R: Read>(mut reader: R) -> io::Result<(Vec<u8>, Peeked<R>)> {
    let mut start = Vec::new();
    reader.by_ref().take(START_BYTES as u64).read_to_end(&mut start)?;
    Ok((start.clone(), Cursor::new(start).chain(reader)))
}

/// Refuses what is known to be something else.
pub(super) fn refuse_foreign(path: &Path, start: &[u8]) -> Result<()> {
    match FOREIGN.iter().find(|(magic, ..)| start.starts_with(magic)) {
        Some((_, what, remedy)) => Err(Error::input(path, "byte 0", format!("is {what}"), remedy)),
        None => Ok(()),
    }
}

/// A file that counts what is read of it.
pub(super) struct CountedFile<'a> {
    pub(super) file: File,
    pub(super) progress: &'a dyn crate::progress::Progress,
}

impl Read for CountedFile<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bytes = self.file.read(buffer)?;
        self.progress.advance(bytes as u64);
        Ok(bytes)
    }
}

impl Seek for CountedFile<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// A file, or what it holds as an archive.
pub(super) enum FileOrMember<R> {
    Whole(R),
    Member(Box<Text<R>>),
}

impl<R: Read> Read for FileOrMember<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            FileOrMember::Whole(reader) => reader.read(buffer),
            FileOrMember::Member(reader) => reader.read(buffer),
        }
    }
}

/// Opens a regular file.
///
/// # Errors
/// If it does not exist, may not be read, or is a directory, pipe or device.
pub(super) fn open(path: &Path) -> Result<File> {
    // Asked before opening, since opening a pipe would wait for a writer.
    let kind = std::fs::metadata(path).map_err(Error::io(path, "open"))?;
    if !kind.is_file() {
        let what =
            if kind.is_dir() { "is a directory" } else { "is not a regular file, which is read twice" };
        return Err(Error::input(path, "path", what, "give a file"));
    }
    File::open(path).map_err(Error::io(path, "open"))
}
