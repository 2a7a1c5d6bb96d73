//! Which beads a brick's samples count: the part of a store that says so, if it was asked for.
//!
//! One record a leaf lists the segments of beads that touch it, and one set of tables describes the beads. So
//! beads are told apart at every point, not only at samples. `FORMAT.md` shows the bytes.

use super::layout::Version;
use crate::brick::Count;
use crate::lattice::{NodeKey, ROOT_BITS, Units};
use serde::{Deserialize, Serialize};

/// Where the identity of beads lies in the file. Known at the end of a build only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct IdentityPlace {
    /// Offset of the tables.
    pub tables_offset: u64,
    /// Their bytes.
    pub tables_bytes: u64,
    /// CRC-32 of the tables.
    pub tables_crc: u32,
    /// Offset of the index of the leaves' records.
    pub index_offset: u64,
    /// Number of its entries.
    pub index_entries: u64,
    /// CRC-32 of the index.
    pub index_crc: u32,
}

impl IdentityPlace {
    /// Bytes of the index.
    pub fn index_bytes(&self) -> u64 {
        self.index_entries * IDENTITY_ENTRY_BYTES as u64
    }
}

/// Where one leaf's record lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdentityEntry {
    /// The leaf.
    pub key: NodeKey,
    /// File offset of the record.
    pub offset: u64,
    /// Its bytes.
    pub length: u32,
    /// CRC-32 over format version, key and record.
    pub crc: u32,
}

/// Bytes of an [`IdentityEntry`] in the file.
pub(super) const IDENTITY_ENTRY_BYTES: usize = 24;
/// Bytes of a bead in the tables.
const BEAD_BYTES: usize = 28;
/// Bytes of a section in the tables.
const SECTION_BYTES: usize = 40;

impl IdentityEntry {
    pub(super) fn encode(&self) -> [u8; IDENTITY_ENTRY_BYTES] {
        let mut out = [0; IDENTITY_ENTRY_BYTES];
        out[..8].copy_from_slice(&self.key.code().to_le_bytes());
        out[8..16].copy_from_slice(&self.offset.to_le_bytes());
        out[16..20].copy_from_slice(&self.length.to_le_bytes());
        out[20..].copy_from_slice(&self.crc.to_le_bytes());
        out
    }

    /// `None` for an illegal key.
    pub(super) fn decode(bytes: &[u8; IDENTITY_ENTRY_BYTES]) -> Option<IdentityEntry> {
        let mut fields = Fields(bytes);
        Some(IdentityEntry {
            key: NodeKey::from_code(fields.u64()?)?,
            offset: fields.u64()?,
            length: fields.u32()?,
            crc: fields.u32()?,
        })
    }
}

/// CRC-32 of an identity record, bound to its leaf and version as those of bricks are.
pub(super) fn identity_crc(version: Version, key: NodeKey, record: &[u8]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&version.number().to_le_bytes());
    crc.update(&key.code().to_le_bytes());
    crc.update(record);
    crc.finalize()
}

/// A segment of a bead on the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BeadSegment {
    /// One end of its centre line.
    pub a: Units,
    /// The other end.
    pub b: Units,
    /// Its cross-section in the tables.
    pub section: u32,
    /// Its bead in the tables, or its pass, counted through all beads, where the store counts those.
    pub pass: u32,
    /// The line of the file that deposits it, from 1; 0 where the store counts beads.
    pub line: u64,
}

/// A bead as the tables describe it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct BeadRow {
    /// Its file among the store's sources, from 0.
    pub source: u32,
    /// Layer of that file, from 0.
    pub layer: u32,
    /// Tool (extruder) number.
    pub tool: u16,
    /// What the slicer calls it, as an index into the features.
    pub feature: u16,
    /// First and last line of the file that deposit it, from 1.
    pub lines: (u64, u64),
}

/// A cross-section, in lattice units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectionRow {
    /// Half its width.
    pub half_width: f64,
    /// Half its height.
    pub half_height: f64,
    /// The tool's axis.
    pub axis: [f64; 3],
}

/// Beads, cross-sections and names of features.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BeadTables {
    /// By number.
    pub beads: Vec<BeadRow>,
    /// By number.
    pub sections: Vec<SectionRow>,
    /// Names, as in "External perimeter".
    pub features: Vec<String>,
    /// The first pass of each bead, and behind them the number of all; empty where the store counts beads.
    pub passes: Vec<u32>,
}

impl BeadTables {
    /// What the store counts, and lists of segments name.
    pub fn count(&self) -> Count {
        if self.passes.is_empty() { Count::Beads } else { Count::Passes }
    }

    /// How many there are of what is counted.
    pub(super) fn counted(&self) -> u64 {
        self.passes.last().map_or(self.beads.len() as u64, |passes| u64::from(*passes))
    }

    /// The bead of a number that a list of segments has, and which of its passes it is, from 0, if passes are counted.
    pub fn bead_of(&self, number: u32) -> (u32, Option<u32>) {
        if self.passes.is_empty() {
            return (number, None);
        }
        let bead = self.passes.partition_point(|&first| first <= number).saturating_sub(1);
        (bead as u32, Some(number - self.passes[bead]))
    }

    pub(super) fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(12 + self.beads.len() * BEAD_BYTES);
        for count in [self.beads.len(), self.sections.len(), self.features.len()] {
            out.extend((count as u32).to_le_bytes());
        }
        for bead in &self.beads {
            out.extend(bead.source.to_le_bytes());
            out.extend(bead.layer.to_le_bytes());
            out.extend(bead.tool.to_le_bytes());
            out.extend(bead.feature.to_le_bytes());
            out.extend(bead.lines.0.to_le_bytes());
            out.extend(bead.lines.1.to_le_bytes());
        }
        for section in &self.sections {
            let [x, y, z] = section.axis;
            [section.half_width, section.half_height, x, y, z]
                .iter()
                .for_each(|v| out.extend(v.to_le_bytes()));
        }
        for name in &self.features {
            out.extend((name.len() as u32).to_le_bytes());
            out.extend(name.as_bytes());
        }
        self.passes.iter().for_each(|first| out.extend(first.to_le_bytes()));
        out
    }

    /// Takes memory in proportion to `bytes`; the error is one phrase.
    pub(super) fn decode(bytes: &[u8], count: Count) -> Result<BeadTables, &'static str> {
        const DAMAGED: &str = "the tables of beads have the wrong size";
        let mut fields = Fields(bytes);
        let mut number = || Some(fields.u32()? as usize);
        let (beads, sections, features) =
            number().and_then(|b| Some((b, number()?, number()?))).ok_or(DAMAGED)?;
        // Every entry takes bytes, so the counts are checked before memory is taken for them.
        let passes = if count == Count::Passes { beads as u64 + 1 } else { 0 };
        let rows = beads as u64 * BEAD_BYTES as u64 + sections as u64 * SECTION_BYTES as u64;
        let least = rows + (features as u64 + passes) * 4;
        // Beads name features by 16 bits, and a short name takes more memory than bytes of the file.
        if least > fields.0.len() as u64 || features > 1 << 16 {
            return Err(DAMAGED);
        }
        let mut tables = BeadTables {
            beads: Vec::with_capacity(beads),
            sections: Vec::with_capacity(sections),
            features: Vec::with_capacity(features),
            passes: Vec::with_capacity(passes as usize),
        };
        for _ in 0..beads {
            tables.beads.push(fields.bead().ok_or(DAMAGED)?);
        }
        for _ in 0..sections {
            tables.sections.push(fields.section().ok_or(DAMAGED)?);
        }
        for _ in 0..features {
            let length = fields.u32().ok_or(DAMAGED)? as usize;
            let name = fields.take(length).ok_or(DAMAGED)?;
            tables.features.push(String::from_utf8_lossy(name).into_owned());
        }
        for _ in 0..passes {
            tables.passes.push(fields.u32().ok_or(DAMAGED)?);
        }
        if tables.passes.first().is_some_and(|&first| first != 0) || !tables.passes.is_sorted_by(|a, b| a < b)
        {
            return Err("the passes of beads are out of order");
        }
        if !fields.0.is_empty() {
            return Err(DAMAGED);
        }
        let finite =
            |s: &SectionRow| [s.half_width, s.half_height].iter().chain(&s.axis).all(|v| v.is_finite());
        if !tables.sections.iter().all(finite) {
            return Err("a cross-section is not finite");
        }
        if tables.beads.iter().any(|bead| usize::from(bead.feature) >= tables.features.len()) {
            return Err("a bead names a feature that the tables lack");
        }
        Ok(tables)
    }
}

/// Before the first segment of a list.
const START: BeadSegment = BeadSegment { a: [0; 3], b: [0; 3], section: 0, pass: 0, line: 0 };

/// The record of a leaf from the segments that touch it, which must come pass by pass in order, or bead by bead where the
/// store counts those.
pub fn encode_segments(segments: &[BeadSegment], count: Count, out: &mut Vec<u8>) {
    let mut before = START;
    for segment in segments {
        push_varint(out, u64::from(segment.pass.wrapping_sub(before.pass)));
        push_varint(out, zigzag(i64::from(segment.section) - i64::from(before.section)));
        for axis in 0..3 {
            push_varint(out, zigzag(i64::from(segment.a[axis]) - i64::from(before.b[axis])));
        }
        for axis in 0..3 {
            push_varint(out, zigzag(i64::from(segment.b[axis]) - i64::from(segment.a[axis])));
        }
        if count == Count::Passes {
            push_varint(out, zigzag(segment.line.wrapping_sub(before.line) as i64));
        }
        before = *segment;
    }
}

/// Inverse of [`encode_segments`]; any bytes give segments within the root or an error of one phrase.
pub(super) fn decode_segments(
    bytes: &[u8],
    (passes, sections): (u64, u64),
    count: Count,
) -> Result<Vec<BeadSegment>, &'static str> {
    const DAMAGED: &str = "the list of segments is damaged";
    let mut fields = Fields(bytes);
    let mut before = START;
    let mut out = Vec::new();
    while !fields.0.is_empty() {
        let pass = u64::from(before.pass).checked_add(fields.varint().ok_or(DAMAGED)?).ok_or(DAMAGED)?;
        let section = i64::from(before.section).checked_add(fields.signed().ok_or(DAMAGED)?);
        let section = section.and_then(|s| u64::try_from(s).ok()).ok_or(DAMAGED)?;
        if pass >= passes || section >= sections {
            return Err("a segment of a bead that the tables lack");
        }
        let mut point = |from: Units| -> Option<Units> {
            let mut to = [0; 3];
            for axis in 0..3 {
                let c = i64::from(from[axis]).checked_add(fields.signed()?)?;
                to[axis] = i32::try_from(c).ok().filter(|c| (0..1 << ROOT_BITS).contains(c))?;
            }
            Some(to)
        };
        let a = point(before.b).ok_or(DAMAGED)?;
        let b = point(a).ok_or(DAMAGED)?;
        let line = match count {
            Count::Passes => before.line.wrapping_add(fields.signed().ok_or(DAMAGED)? as u64),
            Count::Beads => 0,
        };
        before = BeadSegment { a, b, section: section as u32, pass: pass as u32, line };
        out.push(before);
    }
    Ok(out)
}

fn push_varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn zigzag(value: i64) -> u64 {
    (value << 1 ^ value >> 63) as u64
}

/// Fields at the front of bytes, little-endian; `None` where they end.
pub struct Fields<'a>(pub &'a [u8]);

impl<'a> Fields<'a> {
    /// The next bytes.
    pub fn take(&mut self, length: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    /// The next four bytes.
    pub fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    /// The next eight bytes.
    pub fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.array().map(f64::from_le_bytes)
    }

    fn bead(&mut self) -> Option<BeadRow> {
        Some(BeadRow {
            source: self.u32()?,
            layer: self.u32()?,
            tool: self.u16()?,
            feature: self.u16()?,
            lines: (self.u64()?, self.u64()?),
        })
    }

    fn section(&mut self) -> Option<SectionRow> {
        let (half_width, half_height) = (self.f64()?, self.f64()?);
        Some(SectionRow { half_width, half_height, axis: [self.f64()?, self.f64()?, self.f64()?] })
    }

    /// LEB128, at most ten bytes.
    fn varint(&mut self) -> Option<u64> {
        let mut value = 0u64;
        for shift in (0..64).step_by(7) {
            let byte = self.array::<1>()?[0];
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn signed(&mut self) -> Option<i64> {
        self.varint().map(|v| (v >> 1) as i64 ^ -((v & 1) as i64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn segments() -> impl Strategy<Value = Vec<BeadSegment>> {
        let position = || prop::array::uniform3(0i32..1 << ROOT_BITS);
        let segment = (position(), position(), 0u32..50, 0u32..1000, any::<u64>());
        let made = |(a, b, section, pass, line)| BeadSegment { a, b, section, pass, line };
        prop::collection::vec(segment, 0..40).prop_map(move |list| {
            let mut list: Vec<BeadSegment> = list.into_iter().map(made).collect();
            list.sort_by_key(|segment| segment.pass);
            list
        })
    }

    proptest! {
        #[test]
        fn lists_of_segments_survive(list in segments()) {
            for count in [Count::Passes, Count::Beads] {
                let mut bytes = Vec::new();
                encode_segments(&list, count, &mut bytes);
                let lines = |s: &BeadSegment| if count == Count::Passes { s.line } else { 0 };
                let kept: Vec<_> = list.iter().map(|s| BeadSegment { line: lines(s), ..*s }).collect();
                prop_assert_eq!(decode_segments(&bytes, (1000, 50), count), Ok(kept));
                if let Some(last) = list.last() {
                    prop_assert!(decode_segments(&bytes, (u64::from(last.pass), 50), count).is_err());
                    prop_assert!(decode_segments(&bytes[..bytes.len() - 1], (1000, 50), count).is_err());
                }
            }
        }

        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            for count in [Count::Passes, Count::Beads] {
                let _ = BeadTables::decode(&bytes, count);
                for segment in decode_segments(&bytes, (1000, 50), count).unwrap_or_default() {
                    prop_assert!(segment.pass < 1000 && segment.section < 50);
                    prop_assert!(segment.a.iter().chain(&segment.b).all(|c| (0..1 << ROOT_BITS).contains(c)));
                }
            }
        }
    }

    #[test]
    fn tables_survive_and_are_checked() {
        let bead = BeadRow { source: 1, layer: 2, tool: 3, feature: 1, lines: (4, 1 << 40) };
        let section = SectionRow { half_width: 1.5, half_height: 0.25, axis: [0.0, 0.6, 0.8] };
        let features = vec!["".to_owned(), "Perimètre".to_owned()];
        let tables =
            BeadTables { beads: vec![bead; 3], sections: vec![section; 2], features, passes: vec![] };
        let counting = BeadTables { passes: vec![0, 1, 4, 9], ..tables.clone() };
        for (tables, count) in [(tables.clone(), Count::Beads), (counting.clone(), Count::Passes)] {
            let bytes = tables.encode();
            assert_eq!(BeadTables::decode(&bytes, count), Ok(tables.clone()));
            for cut in 0..bytes.len() {
                assert!(BeadTables::decode(&bytes[..cut], count).is_err());
            }
            let mut huge = bytes.clone();
            huge[..4].copy_from_slice(&u32::MAX.to_le_bytes());
            assert!(BeadTables::decode(&huge, count).is_err());
            let bad = BeadTables { features: vec![String::new()], ..tables };
            assert!(BeadTables::decode(&bad.encode(), count).is_err());
        }
        let bad = BeadTables { passes: vec![0, 4, 4, 9], ..counting.clone() };
        assert!(BeadTables::decode(&bad.encode(), Count::Passes).is_err());
        assert_eq!((tables.counted(), counting.counted()), (3, 9));
        assert_eq!([0, 1, 3, 4, 8].map(|n| counting.bead_of(n).0), [0, 1, 1, 2, 2]);
        assert_eq!(counting.bead_of(8), (2, Some(4)));
        assert_eq!(tables.bead_of(2), (2, None));
    }
}
