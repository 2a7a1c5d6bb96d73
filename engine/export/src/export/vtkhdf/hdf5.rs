//! The part of HDF5 that the format needs: groups, attributes, arrays in one piece or in chunks.
//!
//! As "HDF5 File Format Specification Version 3.0" has them: a superblock of version 2 and object headers of version 2,
//! each with its checksum. What is written is never changed but the superblock, which comes last.

use crate::error::Result;
use crate::part::PartFile;

/// Bytes of the superblock.
pub(super) const SUPERBLOCK_BYTES: usize = 48;
/// The address of what is nowhere.
pub(super) const NOWHERE: u64 = u64::MAX;

/// Types of numbers and texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Datatype {
    I16,
    I32,
    I64,
    F32,
    F64,
    Text(u32),
}

impl Datatype {
    pub(super) fn bytes(self) -> usize {
        match self {
            Datatype::I16 => 2,
            Datatype::I32 | Datatype::F32 => 4,
            Datatype::I64 | Datatype::F64 => 8,
            Datatype::Text(bytes) => bytes as usize,
        }
    }

    /// The message that says it.
    fn message(self) -> Vec<u8> {
        let size = self.bytes() as u32;
        let mut out = Vec::new();
        match self {
            Datatype::I16 | Datatype::I32 | Datatype::I64 => {
                // Signed, little-endian, of all bits.
                out.extend([0x10, 8, 0, 0]);
                out.extend(size.to_le_bytes());
                out.extend([0u16, 8 * size as u16].map(u16::to_le_bytes).concat());
            }
            Datatype::F32 | Datatype::F64 => {
                let (sign, exponent, bias) =
                    if self == Datatype::F32 { (31, [23, 8], 127u32) } else { (63, [52, 11], 1023) };
                out.extend([0x11, 0x20, sign, 0]);
                out.extend(size.to_le_bytes());
                out.extend([0u16, 8 * size as u16].map(u16::to_le_bytes).concat());
                out.extend([exponent[0], exponent[1], 0, exponent[0]]);
                out.extend(bias.to_le_bytes());
            }
            Datatype::Text(_) => {
                out.extend([0x13, 1, 0, 0]);
                out.extend(size.to_le_bytes());
            }
        }
        out
    }
}

/// A named value of a group.
pub(super) struct Attribute {
    name: &'static str,
    kind: Datatype,
    /// Length of a vector; none of a single value.
    length: Option<u64>,
    value: Vec<u8>,
}

impl Attribute {
    pub(super) fn new(name: &'static str, kind: Datatype, length: Option<u64>, value: Vec<u8>) -> Attribute {
        Attribute { name, kind, length, value }
    }

    pub(super) fn text(name: &'static str, text: &str) -> Attribute {
        Attribute::new(name, Datatype::Text(text.len() as u32), None, text.as_bytes().to_vec())
    }

    fn message(&self) -> Vec<u8> {
        let (kind, space) = (self.kind.message(), space(self.length.as_slice()));
        let mut out = vec![3, 0];
        out.extend(
            [self.name.len() as u16 + 1, kind.len() as u16, space.len() as u16]
                .map(u16::to_le_bytes)
                .concat(),
        );
        out.push(0);
        out.extend(self.name.bytes());
        out.push(0);
        [out, kind, space, self.value.clone()].concat()
    }
}

/// Where an array's numbers lie.
pub(super) enum DataLayout {
    Whole {
        at: u64,
        bytes: u64,
    },
    /// In chunks of `chunk` numbers, shuffled and deflated, found by a tree.
    Chunked {
        index: u64,
        chunk: u32,
    },
}

/// A group or an array.
pub(super) struct Object {
    /// Of a group: attributes and members with their addresses.
    pub(super) attributes: Vec<Attribute>,
    pub(super) links: Vec<(String, u64)>,
    array: Option<(Datatype, Vec<u64>, DataLayout)>,
}

impl Object {
    pub(super) fn group() -> Object {
        Object { attributes: Vec::new(), links: Vec::new(), array: None }
    }

    pub(super) fn array(kind: Datatype, dimensions: Vec<u64>, contents: DataLayout) -> Object {
        Object { attributes: Vec::new(), links: Vec::new(), array: Some((kind, dimensions, contents)) }
    }

    /// Appends the header; returns its address.
    pub(super) fn append(&self, file: &mut PartFile) -> Result<u64> {
        let mut messages = Vec::new();
        match &self.array {
            Some((kind, dimensions, contents)) => array_messages(*kind, dimensions, contents, &mut messages),
            None => self.group_messages(&mut messages),
        }
        for attribute in &self.attributes {
            message(&mut messages, 0x0c, &attribute.message());
        }
        let mut header = b"OHDR\x02\x02".to_vec();
        header.extend((messages.len() as u32).to_le_bytes());
        header.extend(messages);
        header.extend(lookup3(&header).to_le_bytes());
        let at = file.appended();
        file.append(&header)?;
        Ok(at)
    }

    fn group_messages(&self, out: &mut Vec<u8>) {
        message(out, 0x02, &[&[0, 0][..], &[0xff; 16]].concat());
        message(out, 0x0a, &[0, 0]);
        for (name, at) in &self.links {
            let link = [&[1, 0, name.len() as u8][..], name.as_bytes(), &at.to_le_bytes()].concat();
            message(out, 0x06, &link);
        }
    }
}

fn array_messages(kind: Datatype, dimensions: &[u64], contents: &DataLayout, out: &mut Vec<u8>) {
    message(out, 0x01, &space(dimensions));
    message(out, 0x03, &kind.message());
    match *contents {
        DataLayout::Whole { at, bytes } => {
            message(out, 0x05, &[3, 0x0a]);
            message(out, 0x08, &[&[3, 1][..], &at.to_le_bytes(), &bytes.to_le_bytes()].concat());
        }
        DataLayout::Chunked { index, chunk } => {
            message(out, 0x05, &[3, 0x0b]);
            let sizes = [chunk, kind.bytes() as u32].map(u32::to_le_bytes).concat();
            message(out, 0x08, &[&[3, 2, 2][..], &index.to_le_bytes(), &sizes].concat());
            // Shuffle by the size of a number, and deflate.
            let mut filters = vec![2, 2];
            for (id, value) in [(2u16, kind.bytes() as u32), (1, 4)] {
                filters.extend([id, 0, 1].map(u16::to_le_bytes).concat());
                filters.extend(value.to_le_bytes());
            }
            message(out, 0x0b, &filters);
        }
    }
}

fn space(dimensions: &[u64]) -> Vec<u8> {
    let simple = u8::from(!dimensions.is_empty());
    let mut out = vec![2, dimensions.len() as u8, 0, simple];
    dimensions.iter().for_each(|dimension| out.extend(dimension.to_le_bytes()));
    out
}

fn message(out: &mut Vec<u8>, kind: u8, data: &[u8]) {
    out.push(kind);
    out.extend((data.len() as u16).to_le_bytes());
    out.push(0);
    out.extend(data);
}

/// The superblock of a file of so many bytes with the root group at an address.
pub(super) fn superblock(bytes: u64, root: u64) -> Vec<u8> {
    let mut out = b"\x89HDF\r\n\x1a\n\x02\x08\x08\x00".to_vec();
    out.extend([0, NOWHERE, bytes, root].map(u64::to_le_bytes).as_flattened());
    out.extend(lookup3(&out).to_le_bytes());
    out
}

/// Bob Jenkins' hash `lookup3`, "hashlittle" with an initial value of 0.
fn lookup3(bytes: &[u8]) -> u32 {
    let mut state = [0xdead_beefu32.wrapping_add(bytes.len() as u32); 3];
    if bytes.is_empty() {
        return state[2];
    }
    let word = |bytes: &[u8], n: usize| {
        (0..4).fold(0u32, |word, k| word | u32::from(bytes.get(4 * n + k).copied().unwrap_or(0)) << (8 * k))
    };
    let last = (bytes.len() - 1) / 12;
    for (number, piece) in bytes.chunks(12).enumerate() {
        (0..3).for_each(|n| state[n] = state[n].wrapping_add(word(piece, n)));
        if number < last { mix(&mut state) } else { end(&mut state) }
    }
    state[2]
}

fn mix(state: &mut [u32; 3]) {
    // Which word changes, by which and by how much it is turned.
    for (n, turn) in [4, 6, 8, 16, 19, 4].into_iter().enumerate() {
        let (a, b, c) = (n % 3, (n + 1) % 3, (n + 2) % 3);
        state[a] = state[a].wrapping_sub(state[c]) ^ state[c].rotate_left(turn);
        state[c] = state[c].wrapping_add(state[b]);
    }
}

fn end(state: &mut [u32; 3]) {
    for (n, turn) in [14, 11, 25, 16, 4, 14, 24].into_iter().enumerate() {
        let (a, b) = ((n + 2) % 3, (n + 1) % 3);
        state[a] = (state[a] ^ state[b]).wrapping_sub(state[b].rotate_left(turn));
    }
}

#[cfg(test)]
mod tests {
    use super::lookup3;

    /// The values that the author of the hash gives with it.
    #[test]
    fn the_checksum_is_that_of_its_author() {
        assert_eq!(lookup3(b""), 0xdead_beef);
        assert_eq!(lookup3(b"Four score and seven years ago"), 0x1777_0551);
    }
}
