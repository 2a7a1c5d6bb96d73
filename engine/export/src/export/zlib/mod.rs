//! zlib streams, the same bytes for the same data: of anything, and of samples, much faster.

mod deflate;
mod general;
mod huffman;

pub(super) use deflate::Deflate;
pub(super) use general::Zlib;
