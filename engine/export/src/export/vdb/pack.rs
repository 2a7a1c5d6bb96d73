//! Bytes of the format: numbers, strings, masks, and values that are compressed.

use crate::export::compress::Zlib;

/// Appends a number of 32 bits.
pub(super) fn word(out: &mut Vec<u8>, number: u32) {
    out.extend(number.to_le_bytes());
}

/// Appends a number of 64 bits.
pub(super) fn long(out: &mut Vec<u8>, number: i64) {
    out.extend(number.to_le_bytes());
}

/// Appends a string with its length.
pub(super) fn put_string(out: &mut Vec<u8>, text: &str) {
    word(out, text.len() as u32);
    out.extend(text.bytes());
}

/// A bit for each entry of a node, in `BYTES` bytes.
#[derive(Clone)]
pub(super) struct Mask<const BYTES: usize>([u8; BYTES]);

impl<const BYTES: usize> Mask<BYTES> {
    /// No bit.
    pub(super) fn new() -> Mask<BYTES> {
        Mask([0; BYTES])
    }

    /// Sets a bit.
    pub(super) fn set(&mut self, index: usize) {
        self.0[index / 8] |= 1 << (index % 8);
    }

    /// The bits, the lowest of each byte first.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.0
    }
}

/// Appends the active values of a node whose other values are the background.
pub(super) fn put_values(out: &mut Vec<u8>, active: &[u32], zlib: &mut Zlib) {
    out.push(0);
    let bytes = active.len() * 4;
    let stream = match active.first() {
        None => &[],
        Some(&first) if active.iter().all(|&value| value == first) => zlib.pack_repeated(first, active.len()),
        Some(_) => zlib.pack(&active.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>()),
    };
    if !stream.is_empty() && stream.len() < bytes {
        long(out, stream.len() as i64);
        out.extend(stream);
    } else {
        // A negative length: as they are.
        long(out, -(bytes as i64));
        active.iter().for_each(|&value| word(out, value));
    }
}
