//! zlib streams of anything, by a compressor for anything.

use flate2::{Compress, Compression, FlushCompress, Status};

/// Fast, and for data of few values nearly as small as the best.
const LEVEL: u32 = 4;

/// A compressor, used over and over.
pub(in crate::export) struct Zlib {
    compress: Compress,
    out: Vec<u8>,
}

impl Zlib {
    /// A compressor.
    pub(in crate::export) fn new() -> Zlib {
        Zlib { compress: Compress::new(Compression::new(LEVEL), true), out: Vec::new() }
    }

    /// The stream of a piece.
    pub(in crate::export) fn pack(&mut self, bytes: &[u8]) -> &[u8] {
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
}
