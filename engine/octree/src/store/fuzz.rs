//! The store's readers, fed with any bytes.

use super::identity::IDENTITY_ENTRY_BYTES;
use super::journal::{FRAME_BYTES, JOURNAL_HEAD_BYTES, Journal, frame_crc};
use super::layout::{
    ENTRY_BYTES, HEADER_BYTES, IndexEntry, PAGE_BYTES, SLOT_BYTES, SLOT_OFFSETS, Slot, decode_preamble,
    record_crc,
};
use super::reader::Store;
use super::source::ByteSource;
use crate::brick::Brick;
use crate::brick::codec::{Compression, PayloadKind, Scratch, decode, encode_with};
use std::ops::Range;
use std::path::Path;

/// Records that are read of a store.
const READ: usize = 64;

/// A file as it is, and with checksums that fit, without which hardly any change would reach what is behind them.
pub fn store(bytes: &[u8]) {
    read_store(bytes.to_vec());
    let mut sealed = bytes.to_vec();
    seal_store(&mut sealed);
    read_store(sealed);
}

fn read_store(bytes: Vec<u8>) {
    let store = match Store::of_source(Path::new("a.brf"), ByteSource::Memory(bytes), 1 << 20, &|_| None) {
        Ok(store) => store,
        Err(error) => return one_line(&error.to_string()),
    };
    for entry in store.entries().iter().take(READ) {
        if let Err(error) = store.load(entry) {
            one_line(&error);
        }
    }
    match store.bead_tables() {
        Ok(Some(tables)) => {
            for entry in store.identity_entries().iter().take(READ) {
                let _ = store.segments(entry.key, &tables);
            }
        }
        Ok(None) => {}
        Err(error) => one_line(&error.to_string()),
    }
    let _ = store.strays();
}

fn one_line(text: &str) {
    assert!(!text.contains('\n'), "{text}");
}

/// Makes the checksums of slots, index, metadata and records fit what they are of.
fn seal_store(bytes: &mut [u8]) {
    let Ok((_, version)) = decode_preamble(&bytes[..bytes.len().min(HEADER_BYTES)]) else { return };
    for (which, at) in SLOT_OFFSETS.into_iter().enumerate() {
        let Some(page) = bytes.get_mut(at..at + PAGE_BYTES) else { return };
        let crc = crc32fast::hash(&page[..SLOT_BYTES - 4]);
        page[SLOT_BYTES - 4..SLOT_BYTES].copy_from_slice(&crc.to_le_bytes());
        let Some(mut slot) = Slot::decode(page, which) else { continue };
        let index = part(bytes, slot.index_offset, slot.index_entries.saturating_mul(ENTRY_BYTES as u64));
        let meta = part(bytes, slot.meta_offset, slot.meta_bytes.into());
        let (Some(index), Some(meta)) = (index, meta) else { continue };
        for at in index.clone().step_by(ENTRY_BYTES) {
            let stored: [u8; ENTRY_BYTES] = bytes[at..at + ENTRY_BYTES].try_into().expect("as many");
            let Ok(mut entry) = IndexEntry::decode(&stored) else { continue };
            let Some(record) = part(bytes, entry.offset, entry.length.into()) else { continue };
            entry.crc = record_crc(version, entry.key, entry.leaf, entry.head, &bytes[record]);
            bytes[at..at + ENTRY_BYTES].copy_from_slice(&entry.encode());
        }
        slot.index_crc = crc32fast::hash(&bytes[index]);
        slot.meta_crc = crc32fast::hash(&bytes[meta]);
        bytes[at..at + SLOT_BYTES].copy_from_slice(&slot.encode());
    }
}

/// A part of the file, if it is there.
fn part(bytes: &[u8], offset: u64, length: u64) -> Option<Range<usize>> {
    let end = offset.checked_add(length).filter(|end| *end <= bytes.len() as u64)?;
    Some(offset as usize..end as usize)
}

/// A journal as it is, and with checksums that fit.
pub fn journal(bytes: &[u8]) {
    let _ = Journal::decode(bytes);
    let mut sealed = bytes.to_vec();
    let _ = seal_journal(&mut sealed);
    if let Some(journal) = Journal::decode(&sealed) {
        let entries: usize = journal.frames.iter().map(|frame| frame.entries.len()).sum();
        assert!(entries * ENTRY_BYTES <= bytes.len());
    }
}

fn seal_journal(bytes: &mut [u8]) -> Option<()> {
    let u32_at = |bytes: &[u8], at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
    let lengths =
        u32_at(bytes, JOURNAL_HEAD_BYTES - 12)?.checked_add(u32_at(bytes, JOURNAL_HEAD_BYTES - 8)?)?;
    let head_end = JOURNAL_HEAD_BYTES + lengths as usize;
    let mut before = crc32fast::hash(bytes.get(..head_end)?);
    bytes.get_mut(head_end..head_end + 4)?.copy_from_slice(&before.to_le_bytes());
    let mut start = head_end + 4;
    loop {
        let entries = u32_at(bytes, start + FRAME_BYTES - 12)? as usize;
        let lists = u32_at(bytes, start + FRAME_BYTES - 8)? as usize;
        let end = start + FRAME_BYTES + entries * ENTRY_BYTES + lists * IDENTITY_ENTRY_BYTES;
        before = frame_crc(before, bytes.get(start..end)?);
        bytes[start + FRAME_BYTES - 4..start + FRAME_BYTES].copy_from_slice(&before.to_le_bytes());
        start = end;
    }
}

/// A payload behind its kind and its two extreme values.
pub fn brick(bytes: &[u8]) {
    let Some(([kind, low, high], payload)) = bytes.split_first_chunk() else { return };
    let uniform = i16::from_le_bytes([*low, *high]);
    let Some(kind) = PayloadKind::from_bits(*kind) else { return };
    if let Ok(brick) = decode(kind, uniform, payload, &mut Scratch::new()) {
        // What is a brick can be stored again, and is the same brick then; one of equal counts is a uniform one.
        let (min, max) = brick.range();
        let brick = match brick {
            Brick::Counts { samples, hermite } if min == max && samples.1 == 0 && hermite.is_empty() => {
                Brick::Uniform(min)
            }
            other => other,
        };
        for compression in [Compression::Lz4, Compression::Range] {
            let mut stored = Vec::new();
            let head = encode_with(&brick, compression, &mut Scratch::new(), &mut stored);
            let again = decode(head.kind, head.min, &stored, &mut Scratch::new());
            assert!(again.is_ok_and(|again| again == brick));
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::brick::{Brick, Count};
    use crate::disk::sim::SimDisk;
    use crate::store::testing::{brick_at, fractions, lists, meta_of_beads, nodes};
    use crate::store::writer::StoreWriter;
    use crate::store::{Compression, PayloadKind, Scratch, encode_segments, encode_with};
    use std::path::{Path, PathBuf};
    use std::sync::Arc;

    fn seed(name: &str, bytes: &[u8]) {
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/seeds").join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("it can be made");
        std::fs::write(path, bytes).expect("it can be written");
    }

    /// A brick as LZ4 and as the range coder have it, behind its kind and its smallest sample.
    fn seeds_of_brick(name: &str, brick: &Brick) {
        for (compression, ending) in [(Compression::Lz4, ""), (Compression::Range, "-range")] {
            let mut payload = Vec::new();
            let head = encode_with(brick, compression, &mut Scratch::new(), &mut payload);
            if !payload.is_empty() {
                let head = [&[head.kind.bits()], head.min.to_le_bytes().as_slice()].concat();
                seed(&format!("brick/{name}{ending}"), &[head, payload].concat());
            }
        }
    }

    /// `cargo test -p brickfield-octree --lib makes_seeds -- --ignored`, after a change of the format
    #[test]
    #[ignore = "writes into the repository"]
    fn makes_seeds_of_journals_and_bricks() {
        let disk = SimDisk::default();
        let settings = vec![("made by".to_owned(), "a test".to_owned())];
        let begun =
            StoreWriter::begin(Arc::new(disk.clone()), Path::new("a.brf"), &meta_of_beads(), settings, false);
        let mut writer = begun.expect("nothing fails");
        let mut nodes = nodes();
        nodes.sort_by_key(|(key, _)| key.post_order());
        for (number, (key, leaf)) in nodes.into_iter().enumerate() {
            let brick = brick_at(key, leaf);
            writer.append_brick(key, leaf, &brick).expect("nothing fails");
            writer.commit().expect("nothing fails");
            seeds_of_brick(&number.to_string(), &brick);
        }
        writer.begin_identity(crate::store::testing::tables());
        for (key, list) in lists() {
            let mut bytes = Vec::new();
            encode_segments(&list, Count::Beads, &mut bytes);
            writer.append_identity(key, &bytes).expect("nothing fails");
            writer.commit().expect("nothing fails");
        }
        seeds_of_brick("fractions", &fractions());
        // Equal counts, which no encoder writes as such.
        let counts = PayloadKind::from_bits(PayloadKind::RANGE_COUNTS).expect("a kind");
        seed("brick/alike-range", &[&[counts.bits()][..], &[0; 9]].concat());
        seed("journal/beads", &disk.files()[Path::new("a.brf.journal")]);
    }
}
