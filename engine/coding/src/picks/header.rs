//! Header and directory of a table of beads.

use super::segment::{PickOutline, Steps};
use crate::bsp::{array, crc32, Fault};

/// First bytes of a file.
pub const PICK_MAGIC: [u8; 8] = *b"\x89BPK\r\n\x1a\n";
/// Version of the format.
pub const PICK_VERSION: u32 = 1;
/// Bytes of the header.
pub const PICK_HEADER_BYTES: usize = 112;
/// Bytes of an entry of the directory.
pub const PICK_BLOCK_BYTES: usize = 36;
const CRC_OFFSET: usize = PICK_HEADER_BYTES - 4;
/// Most blocks: 2^38 segments.
const BLOCKS_MAX: u32 = 1 << 26;
/// Most features, and most files.
const NAMES_MAX: u32 = 1 << 16;

/// What a table says of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PickHeader {
    /// World position of the place of no steps.
    pub origin: [f64; 3],
    /// World lengths of a step.
    pub steps: Steps,
    /// Cross-section of all beads.
    pub outline: PickOutline,
    /// Whether lines are those of segments rather than of beads.
    pub by_segment: bool,
    /// Number of features.
    pub features: u32,
    /// Number of files.
    pub sources: u32,
    /// Bytes of their names.
    pub name_bytes: u32,
    /// Number of blocks.
    pub blocks: u32,
    /// Checksum of names and directory.
    pub crc: u32,
    /// Number of segments.
    pub segments: u64,
    /// Checksum of the header of the file of splats that the table belongs to.
    pub part: u32,
}

/// A block behind the directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PickBlock {
    /// Least corner of the box around its solids, in steps.
    pub low: [i32; 3],
    /// Greatest corner.
    pub high: [i32; 3],
    /// Its bytes.
    pub bytes: u32,
    /// Its segments.
    pub segments: u32,
    /// Checksum of its bytes.
    pub crc: u32,
}

impl PickHeader {
    /// One that says nothing of a table's parts and of splats yet.
    pub fn new(origin: [f64; 3], steps: Steps, outline: PickOutline, by_segment: bool) -> PickHeader {
        PickHeader {
            origin,
            steps,
            outline,
            by_segment,
            features: 0,
            sources: 0,
            name_bytes: 0,
            blocks: 0,
            crc: 0,
            segments: 0,
            part: 0,
        }
    }

    /// The header's bytes.
    pub fn to_bytes(&self) -> [u8; PICK_HEADER_BYTES] {
        let mut out = Vec::with_capacity(PICK_HEADER_BYTES);
        out.extend_from_slice(&PICK_MAGIC);
        out.extend_from_slice(&PICK_VERSION.to_le_bytes());
        out.extend_from_slice(&(PICK_HEADER_BYTES as u32).to_le_bytes());
        let floats = self.origin.iter().chain([&self.steps.across, &self.steps.up]);
        floats.for_each(|value| out.extend_from_slice(&value.to_le_bytes()));
        out.extend_from_slice(&[
            u8::from(self.outline == PickOutline::Ellipse),
            u8::from(self.by_segment),
            0,
            0,
        ]);
        for value in [self.features, self.sources, self.name_bytes, self.blocks, self.crc] {
            out.extend_from_slice(&value.to_le_bytes());
        }
        out.extend_from_slice(&self.segments.to_le_bytes());
        out.extend_from_slice(&self.part.to_le_bytes());
        out.resize(CRC_OFFSET, 0);
        let crc = crc32(0, &out);
        out.extend_from_slice(&crc.to_le_bytes());
        let mut bytes = [0; PICK_HEADER_BYTES];
        bytes.copy_from_slice(&out);
        bytes
    }

    /// Reads a header.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(bytes: &[u8]) -> Result<PickHeader, Fault> {
        if !bytes.starts_with(&PICK_MAGIC) {
            return Err(Fault("it does not begin as a table of beads does"));
        }
        if bytes.len() < PICK_HEADER_BYTES {
            return Err(Fault("it ends within its header"));
        }
        if u32_at(bytes, 8) != PICK_VERSION {
            return Err(Fault("it has a version that this program does not know"));
        }
        let is_sound = u32_at(bytes, CRC_OFFSET) == crc32(0, &bytes[..CRC_OFFSET]);
        if !is_sound || u32_at(bytes, 12) != PICK_HEADER_BYTES as u32 {
            return Err(Fault("its header is damaged"));
        }
        let f64_at = |at: usize| f64::from_le_bytes(array(bytes, at));
        let header = PickHeader {
            origin: [16, 24, 32].map(f64_at),
            steps: Steps { across: f64_at(40), up: f64_at(48) },
            outline: if bytes[56] == 1 { PickOutline::Ellipse } else { PickOutline::Stadium },
            by_segment: bytes[57] == 1,
            features: u32_at(bytes, 60),
            sources: u32_at(bytes, 64),
            name_bytes: u32_at(bytes, 68),
            blocks: u32_at(bytes, 72),
            crc: u32_at(bytes, 76),
            segments: u64::from_le_bytes(array(bytes, 80)),
            part: u32_at(bytes, 88),
        };
        header.check(bytes[56] <= 1 && bytes[57] <= 1)?;
        Ok(header)
    }

    fn check(&self, is_known: bool) -> Result<(), Fault> {
        let is_length = |length: f64| length.is_finite() && length > 0.0;
        let is_placed = self.origin.iter().all(|value| value.is_finite());
        let has_steps = is_length(self.steps.across) && is_length(self.steps.up);
        // A name takes four bytes at least.
        let names = u64::from(self.features) + u64::from(self.sources);
        let has_names = self.features <= NAMES_MAX && self.sources <= NAMES_MAX;
        let has_names = has_names && 4 * names <= u64::from(self.name_bytes);
        if is_known && is_placed && has_steps && has_names && self.blocks <= BLOCKS_MAX {
            return Ok(());
        }
        Err(Fault("its header says what cannot be"))
    }

    /// Where the directory begins.
    pub fn directory_start(&self) -> u64 {
        PICK_HEADER_BYTES as u64 + u64::from(self.name_bytes)
    }

    /// Where the blocks begin.
    pub fn blocks_start(&self) -> u64 {
        self.directory_start() + u64::from(self.blocks) * PICK_BLOCK_BYTES as u64
    }
}

impl PickBlock {
    /// The entry's bytes.
    pub fn to_bytes(&self) -> [u8; PICK_BLOCK_BYTES] {
        let mut bytes = [0; PICK_BLOCK_BYTES];
        for (n, value) in self.low.iter().chain(&self.high).enumerate() {
            bytes[4 * n..4 * n + 4].copy_from_slice(&value.to_le_bytes());
        }
        for (n, value) in [self.bytes, self.segments, self.crc].iter().enumerate() {
            bytes[24 + 4 * n..28 + 4 * n].copy_from_slice(&value.to_le_bytes());
        }
        bytes
    }

    /// Reads an entry of [`PICK_BLOCK_BYTES`].
    pub fn read(bytes: &[u8]) -> PickBlock {
        let i32_at = |at: usize| u32_at(bytes, at) as i32;
        PickBlock {
            low: [0, 4, 8].map(i32_at),
            high: [12, 16, 20].map(i32_at),
            bytes: u32_at(bytes, 24),
            segments: u32_at(bytes, 28),
            crc: u32_at(bytes, 32),
        }
    }
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(array(bytes, at))
}
