//! The fixed little-endian layouts of the store: header, commit slots, index entries. `FORMAT.md` shows them
//! as byte diagrams, and a test compares its constants with these.
//!
//! What is read here is only *parsed*: values are in range for their type, checksums of their own bytes hold.
//! Whether they agree with the file around them is for the reader to check.

use crate::brick::codec::{PayloadHead, PayloadKind};
use crate::lattice::NodeKey;
use std::ops::Range;

/// First bytes of every store. The first is not ASCII and the line ends differ, so that a transfer in text
/// mode shows at once.
pub const MAGIC: [u8; 8] = *b"\x89BRF\r\n\x1a\n";
/// The newest version of the format. A store's own version stands in its header and in every checksum.
pub const FORMAT_VERSION: u32 = 3;
/// The three header pages; records begin here.
pub const HEADER_BYTES: usize = 3 * PAGE_BYTES;
/// One page. The slots lie on pages of their own, since a torn write damages a whole sector of up to 4 KiB.
pub const PAGE_BYTES: usize = 4096;
/// Bytes of the header page in use.
pub const PREAMBLE_BYTES: usize = FILE_ID.end + 4;
/// Offset of the two commit slots.
pub const SLOT_OFFSETS: [usize; 2] = [PAGE_BYTES, 2 * PAGE_BYTES];
/// Bytes of a slot.
pub const SLOT_BYTES: usize = SLOT_CRC + 4;
/// Bytes of an index entry.
pub const ENTRY_BYTES: usize = 32;
/// Bytes of [`FileId`].
pub const FILE_ID_BYTES: usize = 16;
/// Largest metadata blob: a few hundred sources with long paths take less than a tenth.
pub const META_BYTES_MAX: usize = 1 << 20;

const VERSION: Range<usize> = field(MAGIC.len(), 4);
const HEADER_SIZE: Range<usize> = field(VERSION.end, 4);
const FILE_ID: Range<usize> = field(HEADER_SIZE.end, FILE_ID_BYTES);

const GENERATION: Range<usize> = field(0, 8);
const SLOT_FILE_ID: Range<usize> = field(GENERATION.end, FILE_ID_BYTES);
const RECORDS_END: Range<usize> = field(SLOT_FILE_ID.end, 8);
const INDEX_OFFSET: Range<usize> = field(RECORDS_END.end, 8);
const INDEX_ENTRIES: Range<usize> = field(INDEX_OFFSET.end, 8);
const META_OFFSET: Range<usize> = field(INDEX_ENTRIES.end, 8);
const META_BYTES: Range<usize> = field(META_OFFSET.end, 4);
const INDEX_CRC: Range<usize> = field(META_BYTES.end, 4);
const META_CRC: Range<usize> = field(INDEX_CRC.end, 4);
const SLOT_CRC: usize = META_CRC.end;

const ENTRY_KEY: Range<usize> = field(0, 8);
const ENTRY_OFFSET: Range<usize> = field(ENTRY_KEY.end, 8);
const ENTRY_LENGTH: Range<usize> = field(ENTRY_OFFSET.end, 4);
const ENTRY_CRC: Range<usize> = field(ENTRY_LENGTH.end, 4);
const ENTRY_KIND: usize = ENTRY_CRC.end;
const ENTRY_LEAF: usize = ENTRY_KIND + 1;
const ENTRY_MIN: Range<usize> = field(ENTRY_LEAF + 1, 2);
const ENTRY_MAX: Range<usize> = field(ENTRY_MIN.end, 2);
const ENTRY_RESERVED: Range<usize> = field(ENTRY_MAX.end, 2);
const _: () = assert!(ENTRY_RESERVED.end == ENTRY_BYTES && SLOT_BYTES <= PAGE_BYTES);

const fn field(start: usize, bytes: usize) -> Range<usize> {
    start..start + bytes
}

/// Ties slots and metadata to the header of their file; equal for equal input and settings.
pub type FileId = [u8; FILE_ID_BYTES];

/// Copies a field out of its layout; both sizes are constants, so it cannot fail.
fn get<const N: usize>(bytes: &[u8], field: Range<usize>) -> [u8; N] {
    bytes[field].try_into().expect("fields have the size of their type")
}

/// A version of the format that this program reads and writes. A store has the lowest that says what is in it,
/// so that older programs read what they can.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// Triangle soups.
    One,
    /// Beads as solids: the metadata has a part about them, and leaves may tell which beads they count.
    Two,
    /// One of several shards of a store of version 1 or 2.
    Three,
}

impl Version {
    /// As in the file.
    pub const fn number(self) -> u32 {
        match self {
            Version::One => 1,
            Version::Two => 2,
            Version::Three => FORMAT_VERSION,
        }
    }

    /// The version of that number, if it is known here.
    pub fn from_number(number: u32) -> Option<Version> {
        [Version::One, Version::Two, Version::Three].into_iter().find(|version| version.number() == number)
    }
}

/// The used bytes of the header page.
pub fn encode_preamble(id: FileId, version: Version) -> [u8; PREAMBLE_BYTES] {
    let mut out = [0; PREAMBLE_BYTES];
    out[..MAGIC.len()].copy_from_slice(&MAGIC);
    out[VERSION].copy_from_slice(&version.number().to_le_bytes());
    out[HEADER_SIZE].copy_from_slice(&(HEADER_BYTES as u32).to_le_bytes());
    out[FILE_ID].copy_from_slice(&id);
    let crc = crc32fast::hash(&out[..FILE_ID.end]);
    out[FILE_ID.end..].copy_from_slice(&crc.to_le_bytes());
    out
}

/// Why a file is not a store of this version.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PreambleError {
    /// The magic is missing, or the file ends within the header.
    NotAStore,
    /// A store of a version of the format that is unknown here.
    Version(u32),
    /// The header page is damaged.
    Damaged,
}

/// Reads the header page. `header` is the file's first [`HEADER_BYTES`] bytes, or the whole of a shorter file.
pub fn decode_preamble(header: &[u8]) -> Result<(FileId, Version), PreambleError> {
    if header.len() < HEADER_BYTES || !header.starts_with(&MAGIC) {
        return Err(PreambleError::NotAStore);
    }
    let number = u32::from_le_bytes(get(header, VERSION));
    let version = Version::from_number(number).ok_or(PreambleError::Version(number))?;
    let id = get(header, FILE_ID);
    let sound = header.starts_with(&encode_preamble(id, version))
        && header[PREAMBLE_BYTES..PAGE_BYTES].iter().all(|&b| b == 0);
    if sound { Ok((id, version)) } else { Err(PreambleError::Damaged) }
}

/// A commit: where the index and the metadata lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// 1 for the first commit, one more for each after it; its lowest bit says which slot it is in.
    pub generation: u64,
    /// The header's.
    pub file_id: FileId,
    /// End of the area, from [`HEADER_BYTES`], that holds the records.
    pub records_end: u64,
    /// Offset of the index.
    pub index_offset: u64,
    /// Number of index entries.
    pub index_entries: u64,
    /// Offset of the metadata.
    pub meta_offset: u64,
    /// Bytes of the metadata.
    pub meta_bytes: u32,
    /// CRC-32 of the index.
    pub index_crc: u32,
    /// CRC-32 of the metadata.
    pub meta_crc: u32,
}

impl Slot {
    /// The stored form.
    pub fn encode(&self) -> [u8; SLOT_BYTES] {
        let mut out = [0; SLOT_BYTES];
        out[GENERATION].copy_from_slice(&self.generation.to_le_bytes());
        out[SLOT_FILE_ID].copy_from_slice(&self.file_id);
        out[RECORDS_END].copy_from_slice(&self.records_end.to_le_bytes());
        out[INDEX_OFFSET].copy_from_slice(&self.index_offset.to_le_bytes());
        out[INDEX_ENTRIES].copy_from_slice(&self.index_entries.to_le_bytes());
        out[META_OFFSET].copy_from_slice(&self.meta_offset.to_le_bytes());
        out[META_BYTES].copy_from_slice(&self.meta_bytes.to_le_bytes());
        out[INDEX_CRC].copy_from_slice(&self.index_crc.to_le_bytes());
        out[META_CRC].copy_from_slice(&self.meta_crc.to_le_bytes());
        let crc = crc32fast::hash(&out[..SLOT_CRC]);
        out[SLOT_CRC..].copy_from_slice(&crc.to_le_bytes());
        out
    }

    /// Reads the slot page `which`; `None` if nothing was committed there or the write was torn.
    pub fn decode(page: &[u8], which: usize) -> Option<Slot> {
        let slot = Slot {
            generation: u64::from_le_bytes(get(page, GENERATION)),
            file_id: get(page, SLOT_FILE_ID),
            records_end: u64::from_le_bytes(get(page, RECORDS_END)),
            index_offset: u64::from_le_bytes(get(page, INDEX_OFFSET)),
            index_entries: u64::from_le_bytes(get(page, INDEX_ENTRIES)),
            meta_offset: u64::from_le_bytes(get(page, META_OFFSET)),
            meta_bytes: u32::from_le_bytes(get(page, META_BYTES)),
            index_crc: u32::from_le_bytes(get(page, INDEX_CRC)),
            meta_crc: u32::from_le_bytes(get(page, META_CRC)),
        };
        let here = slot.generation > 0 && slot.which() == which;
        (here && page.starts_with(&slot.encode())).then_some(slot)
    }

    /// Which of the two slots the commit belongs in.
    pub fn which(&self) -> usize {
        (self.generation & 1) as usize
    }
}

/// Why entries are not an index: which node, and what is wrong with it.
pub type TreeError = (NodeKey, &'static str);

/// What the index holds of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IndexEntry {
    /// The node.
    pub key: NodeKey,
    /// File offset of the payload; 0 for a uniform brick.
    pub offset: u64,
    /// Stored bytes of the payload; 0 for a uniform brick.
    pub length: u32,
    /// CRC-32 over format version, key, leaf mark, kind, range and payload.
    pub crc: u32,
    /// True for a leaf.
    pub leaf: bool,
    /// Payload layout and range of the samples.
    pub head: PayloadHead,
}

impl IndexEntry {
    /// Bytes of an entry in the file.
    pub const BYTES: usize = ENTRY_BYTES;

    /// The stored form.
    pub fn encode(&self) -> [u8; ENTRY_BYTES] {
        let mut out = [0; ENTRY_BYTES];
        out[ENTRY_KEY].copy_from_slice(&self.key.code().to_le_bytes());
        out[ENTRY_OFFSET].copy_from_slice(&self.offset.to_le_bytes());
        out[ENTRY_LENGTH].copy_from_slice(&self.length.to_le_bytes());
        out[ENTRY_CRC].copy_from_slice(&self.crc.to_le_bytes());
        out[ENTRY_KIND] = self.head.kind.bits();
        out[ENTRY_LEAF] = u8::from(self.leaf);
        out[ENTRY_MIN].copy_from_slice(&self.head.min.to_le_bytes());
        out[ENTRY_MAX].copy_from_slice(&self.head.max.to_le_bytes());
        out
    }

    /// Reads a stored entry; the error says which rule of the format it breaks.
    pub fn decode(bytes: &[u8; ENTRY_BYTES]) -> Result<IndexEntry, &'static str> {
        let key = NodeKey::from_code(u64::from_le_bytes(get(bytes, ENTRY_KEY))).ok_or("an illegal key")?;
        let kind = PayloadKind::from_bits(bytes[ENTRY_KIND]).ok_or("an unknown kind")?;
        let leaf = match bytes[ENTRY_LEAF] {
            0 => false,
            1 => true,
            _ => return Err("a leaf mark that is neither 0 nor 1"),
        };
        let head = PayloadHead {
            kind,
            min: i16::from_le_bytes(get(bytes, ENTRY_MIN)),
            max: i16::from_le_bytes(get(bytes, ENTRY_MAX)),
        };
        let entry = IndexEntry {
            key,
            offset: u64::from_le_bytes(get(bytes, ENTRY_OFFSET)),
            length: u32::from_le_bytes(get(bytes, ENTRY_LENGTH)),
            crc: u32::from_le_bytes(get(bytes, ENTRY_CRC)),
            leaf,
            head,
        };
        if bytes[ENTRY_RESERVED] != [0, 0] {
            return Err("reserved bytes that are not zero");
        }
        entry.check()?;
        Ok(entry)
    }

    /// The rules that an entry has to keep by itself.
    pub fn check(&self) -> Result<(), &'static str> {
        let PayloadHead { kind, min, max } = self.head;
        if kind.is_uniform() && (self.offset != 0 || self.length != 0 || min != max) {
            return Err("a uniform brick with a payload or a range");
        }
        if !kind.is_uniform() && self.length == 0 {
            return Err("counts without a payload");
        }
        if min > max {
            return Err("a range from a larger to a smaller value");
        }
        if kind.has_hermite() && !self.leaf {
            return Err("Hermite edges on an interior node");
        }
        Ok(())
    }

    /// End of the payload; `None` if no file is that large.
    pub fn end(&self) -> Option<u64> {
        self.offset.checked_add(u64::from(self.length))
    }
}

/// CRC-32 of a record: over format version, key, leaf mark, kind, range and payload, so that a sound record
/// under another key, or read by another version, does not pass.
pub fn record_crc(version: Version, key: NodeKey, leaf: bool, head: PayloadHead, payload: &[u8]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&version.number().to_le_bytes());
    crc.update(&key.code().to_le_bytes());
    crc.update(&[head.kind.bits(), u8::from(leaf)]);
    crc.update(&head.min.to_le_bytes());
    crc.update(&head.max.to_le_bytes());
    crc.update(payload);
    crc.finalize()
}

#[cfg(test)]
mod tests {
    use super::super::journal::{FRAME_BYTES, JOURNAL_HEAD_BYTES, JOURNAL_VERSION};
    use super::*;

    /// `NAME = value` lines in the document against the constants, both ways.
    #[test]
    fn the_document_has_these_constants() {
        let document = include_str!("../../../FORMAT.md");
        let stated: Vec<(&str, usize)> = document
            .lines()
            .filter_map(|line| line.strip_prefix("    ")?.split_once(" = "))
            .filter_map(|(name, value)| Some((name.trim(), value.trim().replace(',', "").parse().ok()?)))
            .collect();
        let constants = [
            ("FORMAT_VERSION", FORMAT_VERSION as usize),
            ("PAGE_BYTES", PAGE_BYTES),
            ("HEADER_BYTES", HEADER_BYTES),
            ("PREAMBLE_BYTES", PREAMBLE_BYTES),
            ("SLOT_OFFSET_0", SLOT_OFFSETS[0]),
            ("SLOT_OFFSET_1", SLOT_OFFSETS[1]),
            ("SLOT_BYTES", SLOT_BYTES),
            ("ENTRY_BYTES", ENTRY_BYTES),
            ("FILE_ID_BYTES", FILE_ID_BYTES),
            ("META_BYTES_MAX", META_BYTES_MAX),
            ("JOURNAL_VERSION", JOURNAL_VERSION as usize),
            ("JOURNAL_HEAD_BYTES", JOURNAL_HEAD_BYTES),
            ("FRAME_BYTES", FRAME_BYTES),
        ];
        let fields = [
            ("VERSION", VERSION),
            ("HEADER_SIZE", HEADER_SIZE),
            ("FILE_ID", FILE_ID),
            ("GENERATION", GENERATION),
            ("SLOT_FILE_ID", SLOT_FILE_ID),
            ("RECORDS_END", RECORDS_END),
            ("INDEX_OFFSET", INDEX_OFFSET),
            ("INDEX_ENTRIES", INDEX_ENTRIES),
            ("META_OFFSET", META_OFFSET),
            ("META_BYTES", META_BYTES),
            ("INDEX_CRC", INDEX_CRC),
            ("META_CRC", META_CRC),
            ("SLOT_CRC", field(SLOT_CRC, 4)),
            ("ENTRY_KEY", ENTRY_KEY),
            ("ENTRY_OFFSET", ENTRY_OFFSET),
            ("ENTRY_LENGTH", ENTRY_LENGTH),
            ("ENTRY_CRC", ENTRY_CRC),
            ("ENTRY_KIND", field(ENTRY_KIND, 1)),
            ("ENTRY_LEAF", field(ENTRY_LEAF, 1)),
            ("ENTRY_MIN", ENTRY_MIN),
            ("ENTRY_MAX", ENTRY_MAX),
            ("ENTRY_RESERVED", ENTRY_RESERVED),
        ];
        assert_eq!(stated, constants);
        for (name, range) in fields {
            let row = format!("| {} | {} | `{name}` |", range.start, range.len());
            assert!(document.contains(&row), "FORMAT.md lacks the row {row}");
        }
    }
}
