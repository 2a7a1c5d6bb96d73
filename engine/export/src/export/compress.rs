//! zlib streams of many small pieces, the same bytes for the same piece.

use flate2::{Compress, Compression, FlushCompress, Status};
use std::collections::HashMap;

/// Fast, and for data of few values nearly as small as the best.
const LEVEL: u32 = 4;
/// Streams that are remembered.
const REMEMBERED_MAX: usize = 1024;

/// A compressor, used over and over.
pub(crate) struct Zlib {
    compress: Compress,
    out: Vec<u8>,
    /// Streams of pieces of one repeated value, by the value and the length; most pieces are such.
    repeated: HashMap<(u32, usize), Vec<u8>>,
}

impl Zlib {
    /// A compressor.
    pub(crate) fn new() -> Zlib {
        Zlib {
            compress: Compress::new(Compression::new(LEVEL), true),
            out: Vec::new(),
            repeated: HashMap::new(),
        }
    }

    /// The stream of a piece.
    pub(crate) fn pack(&mut self, bytes: &[u8]) -> &[u8] {
        self.compress.reset();
        self.out.clear();
        // What zlib promises for data that do not compress.
        self.out.reserve(bytes.len() + bytes.len() / 1000 + 128);
        loop {
            let read = self.compress.total_in() as usize;
            match self.compress.compress_vec(&bytes[read..], &mut self.out, FlushCompress::Finish) {
                Ok(Status::StreamEnd) => return &self.out,
                _ => self.out.reserve(4096),
            }
        }
    }

    /// The stream of `count` values of four bytes that are all the same.
    pub(crate) fn pack_repeated(&mut self, value: u32, count: usize) -> &[u8] {
        if !self.repeated.contains_key(&(value, count)) {
            if self.repeated.len() == REMEMBERED_MAX {
                self.repeated.clear();
            }
            let stream = self.pack(&value.to_le_bytes().repeat(count)).to_vec();
            self.repeated.insert((value, count), stream);
        }
        &self.repeated[&(value, count)]
    }
}
