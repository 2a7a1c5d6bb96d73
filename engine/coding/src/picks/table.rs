//! A table of beads, written at once and read block by block.

use super::block::{block, SEGMENTS_MAX};
use super::header::{u32_at, PickBlock, PickHeader, PICK_BLOCK_BYTES, PICK_HEADER_BYTES};
use super::segment::PickSegment;
use crate::bsp::{crc32, Fault};
use crate::range::{Decoder, Encoder};
use std::collections::BTreeMap;

/// A block of segments, coded.
pub struct CodedPickBlock {
    entry: PickBlock,
    bytes: Vec<u8>,
}

impl PickHeader {
    /// Codes a block of at most [`SEGMENTS_MAX`] segments, of which the header says how.
    pub fn code(&self, segments: &[PickSegment]) -> CodedPickBlock {
        debug_assert!((1..=SEGMENTS_MAX).contains(&segments.len()));
        let (mut low, mut high) = ([i32::MAX; 3], [i32::MIN; 3]);
        for bounds in segments.iter().map(|segment| segment.bounds(self.steps)) {
            for a in 0..3 {
                low[a] = low[a].min(bounds.0[a]);
                high[a] = high[a].max(bounds.1[a]);
            }
        }
        let mut bytes = Vec::new();
        let mut coder = Encoder::new(&mut bytes);
        block(&mut coder, self.by_segment, segments.len(), segments);
        coder.finish();
        let (size, count) = (bytes.len() as u32, segments.len() as u32);
        CodedPickBlock {
            entry: PickBlock { low, high, bytes: size, segments: count, crc: crc32(0, &bytes) },
            bytes,
        }
    }
}

/// The bytes of a table. What the header says of names, blocks and segments is filled in.
pub fn pick_table_bytes(
    mut header: PickHeader,
    features: &[String],
    sources: &[String],
    blocks: &[CodedPickBlock],
) -> Vec<u8> {
    let mut behind = Vec::new();
    for name in features.iter().chain(sources) {
        behind.extend_from_slice(&(name.len() as u32).to_le_bytes());
        behind.extend_from_slice(name.as_bytes());
    }
    header.features = features.len() as u32;
    header.sources = sources.len() as u32;
    header.name_bytes = behind.len() as u32;
    blocks.iter().for_each(|block| behind.extend_from_slice(&block.entry.to_bytes()));
    header.blocks = blocks.len() as u32;
    header.segments = blocks.iter().map(|block| u64::from(block.entry.segments)).sum();
    header.crc = crc32(0, &behind);
    let mut bytes = header.to_bytes().to_vec();
    bytes.append(&mut behind);
    blocks.iter().for_each(|block| bytes.extend_from_slice(&block.bytes));
    bytes
}

/// The bead at a picked place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PickedBead {
    /// The segment that is nearest.
    pub segment: PickSegment,
    /// Distance of the place from its solid's surface, negative inside, in world lengths.
    pub distance: f64,
    /// Heights of the bead's lower and upper side there, in the world.
    pub heights: (f64, f64),
}

/// A table of beads as it is read: header, names and directory first, then the blocks that are asked for.
pub struct PickTable {
    header: PickHeader,
    features: Vec<String>,
    sources: Vec<String>,
    blocks: Vec<PickBlock>,
    /// Where each block begins, and the last one ends.
    starts: Vec<u64>,
    loaded: BTreeMap<usize, Vec<PickSegment>>,
}

impl PickTable {
    /// Reads what stands before the blocks.
    ///
    /// # Errors
    /// What is wrong with it. Counts are checked against the bytes that are there before memory is taken.
    pub fn open(bytes: &[u8]) -> Result<PickTable, Fault> {
        let header = PickHeader::read(bytes)?;
        let end = header.blocks_start();
        if (bytes.len() as u64) < end {
            return Err(Fault("it ends within its directory"));
        }
        let behind = &bytes[PICK_HEADER_BYTES..end as usize];
        if crc32(0, behind) != header.crc {
            return Err(Fault("its directory is damaged"));
        }
        let (names, directory) = behind.split_at(header.name_bytes as usize);
        let names = read_names(names, header.features as usize + header.sources as usize);
        let mut features = names.ok_or(Fault("its names say what cannot be"))?;
        let sources = features.split_off(header.features as usize);
        let blocks: Vec<PickBlock> = directory.chunks_exact(PICK_BLOCK_BYTES).map(PickBlock::read).collect();
        let is_sound = |block: &PickBlock| {
            (1..=SEGMENTS_MAX as u32).contains(&block.segments)
                && (0..3).all(|a| block.low[a] <= block.high[a])
        };
        let segments: u64 = blocks.iter().map(|block| u64::from(block.segments)).sum();
        if !blocks.iter().all(is_sound) || segments != header.segments {
            return Err(Fault("its directory says what cannot be"));
        }
        let mut starts = vec![end];
        for block in &blocks {
            starts.push(starts[starts.len() - 1] + u64::from(block.bytes));
        }
        Ok(PickTable { header, features, sources, blocks, starts, loaded: BTreeMap::new() })
    }

    /// What it says of itself.
    pub fn header(&self) -> &PickHeader {
        &self.header
    }

    /// Names of features.
    pub fn features(&self) -> &[String] {
        &self.features
    }

    /// Names of files.
    pub fn sources(&self) -> &[String] {
        &self.sources
    }

    /// The directory.
    pub fn blocks(&self) -> &[PickBlock] {
        &self.blocks
    }

    /// Where a block begins, or behind the last one the file ends.
    pub fn start(&self, block: usize) -> u64 {
        self.starts[block]
    }

    /// Blocks that are in memory.
    pub fn loaded(&self) -> &BTreeMap<usize, Vec<PickSegment>> {
        &self.loaded
    }

    /// Gives back the memory of all blocks.
    pub fn forget(&mut self) {
        self.loaded.clear();
    }

    /// Takes in a block.
    ///
    /// # Errors
    /// If it is damaged, or there is none of that number.
    pub fn take(&mut self, number: usize, bytes: &[u8]) -> Result<(), Fault> {
        let fault = Fault("a block of it is damaged");
        let entry = self.blocks.get(number).ok_or(fault)?;
        if bytes.len() as u64 != u64::from(entry.bytes) || crc32(0, bytes) != entry.crc {
            return Err(fault);
        }
        let mut coder = Decoder::new(bytes);
        let segments = block(&mut coder, self.header.by_segment, entry.segments as usize, &[]);
        let (features, sources) = (self.header.features, self.header.sources);
        let is_named = |s: &PickSegment| s.bead.feature < features && s.bead.source < sources;
        let is_solid = |s: &PickSegment| s.width > 0 && s.height > 0;
        if !coder.finish() || !segments.iter().all(|s| is_named(s) && is_solid(s)) {
            return Err(fault);
        }
        self.loaded.insert(number, segments);
        Ok(())
    }
}

/// So many names, which take all bytes.
fn read_names(mut bytes: &[u8], count: usize) -> Option<Vec<String>> {
    let mut names = Vec::with_capacity(count);
    for _ in 0..count {
        if bytes.len() < 4 {
            return None;
        }
        let (length, rest) = (u32_at(bytes, 0) as usize, &bytes[4..]);
        if rest.len() < length {
            return None;
        }
        let (name, rest) = rest.split_at(length);
        names.push(String::from_utf8_lossy(name).into_owned());
        bytes = rest;
    }
    if bytes.is_empty() {
        Some(names)
    } else {
        None
    }
}
