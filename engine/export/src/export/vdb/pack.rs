//! Bytes of the format: numbers, strings, masks, and values that are compressed.

use crate::export::zlib::Deflate;
use std::collections::HashMap;

/// Streams that are remembered.
const REMEMBERED_MAX: usize = 1024;
/// Bytes of a value.
const VALUE_BYTES: usize = 4;
/// How far back equal values are likely in a full leaf: the row before, and the layer before.
const NEAR: [usize; 4] = [32, 28, 36, 256];

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

    /// The bits of 64 entries, the lowest first.
    pub(super) fn set_word(&mut self, word: usize, bits: u64) {
        self.0[word * 8..][..8].copy_from_slice(&bits.to_le_bytes());
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

/// Makes the streams of values.
pub(super) struct ValueStreams {
    deflate: Deflate,
    bytes: Vec<u8>,
    stream: Vec<u8>,
    /// Streams of one repeated value, by the value and how often; most streams are such.
    repeated: HashMap<(u32, usize), Vec<u8>>,
}

impl ValueStreams {
    /// None yet.
    pub(super) fn new() -> ValueStreams {
        let (bytes, stream) = (Vec::new(), Vec::new());
        ValueStreams { deflate: Deflate::new(), bytes, stream, repeated: HashMap::new() }
    }

    fn pack(&mut self, values: &[u32]) -> &[u8] {
        self.bytes.clear();
        values.iter().for_each(|value| self.bytes.extend_from_slice(&value.to_le_bytes()));
        self.stream.clear();
        self.deflate.zlib(&self.bytes, VALUE_BYTES, &NEAR, &mut self.stream);
        &self.stream
    }

    fn pack_repeated(&mut self, values: &[u32], value: u32) -> &[u8] {
        let key = (value, values.len());
        if !self.repeated.contains_key(&key) {
            if self.repeated.len() == REMEMBERED_MAX {
                self.repeated.clear();
            }
            let stream = self.pack(values).to_vec();
            self.repeated.insert(key, stream);
        }
        &self.repeated[&key]
    }
}

/// Appends the active values of a node, and what its other values are.
pub(super) fn put_values<const BYTES: usize>(
    out: &mut Vec<u8>,
    active: &[u32],
    inactive: &Inactive<BYTES>,
    streams: &mut ValueStreams,
) {
    inactive.put(out);
    let bytes = active.len() * VALUE_BYTES;
    let stream = match active.first() {
        None => &[],
        Some(&first) if active.iter().all(|&value| value == first) => streams.pack_repeated(active, first),
        Some(_) => streams.pack(active),
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
