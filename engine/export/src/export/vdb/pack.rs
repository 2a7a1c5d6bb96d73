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

    /// Whether no bit is set.
    pub(super) fn is_empty(&self) -> bool {
        self.0.iter().all(|&byte| byte == 0)
    }

    /// The bits, the lowest of each byte first.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.0
    }
}

/// The values of inactive entries of a node: the background, and of level sets its opposite, which is inside.
#[derive(Clone)]
pub(super) struct Inactive<const BYTES: usize> {
    /// Entries that have the background.
    pub outer: Mask<BYTES>,
    /// Entries that have its opposite.
    pub inner: Mask<BYTES>,
}

impl<const BYTES: usize> Inactive<BYTES> {
    /// None.
    pub(super) fn new() -> Inactive<BYTES> {
        Inactive { outer: Mask::new(), inner: Mask::new() }
    }

    fn put(&self, out: &mut Vec<u8>) {
        match (self.outer.is_empty(), self.inner.is_empty()) {
            (_, true) => out.push(0),
            (true, false) => out.push(1),
            (false, false) => {
                out.push(3);
                out.extend(self.outer.bytes());
            }
        }
    }
}

/// Appends the active values of a node, and what its other values are.
pub(super) fn put_values<const BYTES: usize>(
    out: &mut Vec<u8>,
    active: &[u32],
    inactive: &Inactive<BYTES>,
    zlib: &mut Zlib,
) {
    inactive.put(out);
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
