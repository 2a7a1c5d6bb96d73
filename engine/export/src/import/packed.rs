//! Samples that are compressed or written as text: unpacked once, into a temporary file, from which boxes are read.

use super::base64::Base64;
use super::grid::{GridBox, GridLayout, SampleSource, SampleType, for_rows};
use crate::error::{Error, Result};
use crate::part::temporary::TempFile;
use crate::progress::Progress;
use flate2::read::{MultiGzDecoder, ZlibDecoder};
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Bytes that are unpacked at a time.
const PIECE: usize = 1 << 16;
/// Bytes that deflate makes of one, at most.
const MOST_RATIO: usize = 1100;
/// What to do with damaged files.
const AGAIN: &str = "export or copy the file again";

/// How samples are packed; ranges are of bytes of the file.
#[derive(Clone, Debug)]
pub(super) enum Packing {
    /// One stream of zlib or gzip.
    Stream(Range<usize>),
    /// As VTK writes them: a header of numbers of 4 or 8 bytes and the samples, in base64 or not, in zlib blocks or not.
    Vtk { range: Range<usize>, is_base64: bool, is_zlib: bool, header_bytes: usize },
    /// Numbers as text.
    Text(Range<usize>),
}

/// Packed samples.
pub(super) struct Packed {
    path: PathBuf,
    packing: Packing,
    number: SampleType,
    shape: [usize; 3],
    bytes: usize,
    unpacked: Option<TempFile>,
}

impl Packed {
    /// Of samples with a layout.
    ///
    /// # Errors
    /// If the file cannot hold as many.
    pub fn new(path: &Path, layout: &GridLayout, packing: Packing) -> Result<Packed> {
        let (range, ratio) = match &packing {
            Packing::Stream(range) => (range, MOST_RATIO),
            Packing::Vtk { range, is_zlib, .. } => (range, if *is_zlib { MOST_RATIO } else { 1 }),
            Packing::Text(range) => (range, layout.number.bytes()),
        };
        let most = range.len().saturating_mul(ratio);
        let bytes = layout.bytes().filter(|&bytes| bytes <= most);
        let bytes = bytes.ok_or_else(|| layout.wrong_size(path, range.start, range.len()))?;
        let (number, shape) = (layout.number, layout.shape);
        Ok(Packed { path: path.to_owned(), packing, number, shape, bytes, unpacked: None })
    }

    fn error(&self, what: impl ToString) -> Error {
        Error::input(&self.path, "samples", what, AGAIN)
    }

    /// Copies what a reader gives, `most` bytes at most, to the temporary file, and says how many they were.
    fn copy(
        &self,
        from: &mut dyn Read,
        most: usize,
        to: &TempFile,
        progress: &dyn Progress,
    ) -> Result<usize> {
        let (mut piece, mut copied) = (vec![0; PIECE], 0);
        while copied < most {
            progress.check()?;
            let room = piece.len().min(most - copied);
            let read = from.read(&mut piece[..room]);
            let count = read.map_err(|error| self.error(format!("cannot be unpacked: {error}")))?;
            if count == 0 {
                break;
            }
            to.append(&piece[..count])?;
            progress.advance(count as u64);
            copied += count;
        }
        Ok(copied)
    }

    /// Unpacks the blocks that VTK writes.
    fn blocks(&self, from: &mut dyn Read, size: usize, to: &TempFile, bars: &dyn Progress) -> Result<()> {
        let [count, block, last] =
            [self.number_of(from, size)?, self.number_of(from, size)?, self.number_of(from, size)?];
        let whole = if last > 0 { count.saturating_sub(1) } else { count };
        let told = block.checked_mul(whole).and_then(|bytes| bytes.checked_add(last));
        if told != Some(self.bytes as u64) || block == 0 || count > self.bytes as u64 {
            let what = format!("{count} blocks of {block} bytes, the last of {last}, are not {}", self.bytes);
            return Err(self.error(what));
        }
        // The sizes of the packed blocks stand before all blocks; what is remembered of them is bounded by the file.
        let mut sizes = Vec::new();
        for _ in 0..count {
            sizes.push(self.number_of(from, size)?);
        }
        for (n, packed) in sizes.into_iter().enumerate() {
            let bytes = if n as u64 >= whole { last } else { block } as usize;
            let mut stream = ZlibDecoder::new(Read::take(&mut *from, packed));
            if self.copy(&mut stream, bytes, to, bars)? != bytes {
                return Err(self.error(format!("block {n} holds less than {bytes} bytes")));
            }
            let mut rest = stream.into_inner();
            std::io::copy(&mut rest, &mut std::io::sink()).map_err(|error| self.error(error))?;
        }
        Ok(())
    }

    fn number_of(&self, from: &mut dyn Read, size: usize) -> Result<u64> {
        let mut bytes = [0; 8];
        from.read_exact(&mut bytes[..size]).map_err(|_| self.error("end within their header"))?;
        Ok(u64::from_le_bytes(bytes))
    }

    fn text(&self, text: &[u8], to: &TempFile, progress: &dyn Progress) -> Result<()> {
        let mut piece = Vec::new();
        for word in text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()) {
            let number = std::str::from_utf8(word).ok();
            if !number.is_some_and(|text| self.number.encode_text(text, &mut piece)) {
                let word: String = String::from_utf8_lossy(word).escape_debug().take(20).collect();
                return Err(
                    self.error(format!("\"{word}\" is no number of the type {}", self.number.numpy()))
                );
            }
            if piece.len() >= PIECE {
                progress.check()?;
                to.append(&piece)?;
                progress.advance(piece.len() as u64);
                piece.clear();
            }
        }
        to.append(&piece).map(|_| ())
    }

    fn unpack(&self, bytes: &[u8], to: &TempFile, progress: &dyn Progress) -> Result<()> {
        match self.packing.clone() {
            Packing::Stream(range) => {
                let packed = &bytes[range];
                let mut stream: Box<dyn Read> = match packed {
                    [0x1f, 0x8b, ..] => Box::new(MultiGzDecoder::new(packed)),
                    _ => Box::new(ZlibDecoder::new(packed)),
                };
                self.copy(&mut stream, self.bytes, to, progress).map(|_| ())
            }
            Packing::Text(range) => self.text(&bytes[range], to, progress),
            Packing::Vtk { range, is_base64, is_zlib, header_bytes } => {
                let mut text;
                let mut plain = &bytes[range];
                let from: &mut dyn Read = if is_base64 {
                    text = Base64::new(plain);
                    &mut text
                } else {
                    &mut plain
                };
                if is_zlib {
                    return self.blocks(from, header_bytes, to, progress);
                }
                let told = self.number_of(from, header_bytes)?;
                if told != self.bytes as u64 {
                    return Err(self.error(format!("are {told} bytes, not {}", self.bytes)));
                }
                self.copy(from, self.bytes, to, progress).map(|_| ())
            }
        }
    }
}

impl SampleSource for Packed {
    fn prepare(&mut self, bytes: &[u8], folder: &Path, progress: &dyn Progress) -> Result<()> {
        let file = TempFile::new(folder);
        file.require_room(self.bytes as u64)?;
        progress.phase("unpacking", Some(self.bytes as u64), "bytes");
        self.unpack(bytes, &file, progress)?;
        if file.bytes() != self.bytes as u64 {
            let ([x, y, z], size) = (self.shape, self.number.bytes());
            return Err(self.error(format!("are {} bytes, not {x} × {y} × {z} × {size}", file.bytes())));
        }
        self.unpacked = Some(file);
        Ok(())
    }

    fn read(&self, _: &[u8], samples: GridBox, out: &mut Vec<f64>) -> Result<()> {
        let file = self.unpacked.as_ref().ok_or_else(|| self.error("are not unpacked yet"))?;
        let size = self.number.bytes();
        let mut row = Vec::new();
        for_rows(self.shape, samples, |at, count| {
            row.resize(count * size, 0);
            file.read((at * size) as u64, &mut row)?;
            self.number.decode(&row, out);
            Ok(())
        })
    }
}
