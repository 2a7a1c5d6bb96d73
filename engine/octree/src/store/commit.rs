//! What a store's commit names: metadata and index, read and checked before anything is believed of them.

use super::fault::{StoreFault, fault, preamble_fault};
use super::identity::{IDENTITY_ENTRY_BYTES, IdentityEntry, IdentityPlace};
use super::index::Index;
use super::journal::Journal;
use super::layout::{
    ENTRY_BYTES, FileId, HEADER_BYTES, IndexEntry, META_BYTES_MAX, PAGE_BYTES, SLOT_OFFSETS, Slot, Version,
    decode_preamble,
};
use super::meta::Meta;
use super::source::ByteSource;
use crate::disk::planted::{Bug, planted};
use crate::lattice::NodeKey;

/// Bytes of the index that are read at once.
const INDEX_BYTES_AT_ONCE: usize = ENTRY_BYTES << 15;
/// Bytes of it that are asked for before they are read, where they lie elsewhere.
const INDEX_BYTES_AHEAD: u64 = 8 * INDEX_BYTES_AT_ONCE as u64;

/// Everything of a file but the records.
pub(super) struct Commit {
    pub version: Version,
    pub meta: Meta,
    pub index: Index,
    pub identity: Vec<IdentityEntry>,
    /// Where all of it ends.
    pub end: u64,
    pub unfinished: bool,
}

/// Reads everything but the records.
pub(super) fn read_commit(
    source: &ByteSource,
    journal: &dyn Fn() -> Option<Journal>,
) -> std::result::Result<Commit, StoreFault> {
    let unreadable = |what| fault("header", what);
    let header = source.part(0, source.bytes().min(HEADER_BYTES as u64)).map_err(unreadable)?;
    let (file_id, version) = decode_preamble(&header).map_err(preamble_fault)?;
    let slots = [0, 1].map(|which| Slot::decode(&header[SLOT_OFFSETS[which]..][..PAGE_BYTES], which));
    // A valid slot was written after all that it points to was durable. So the newest valid one counts, and
    // where its index is damaged there is no falling back to an older state of the tree.
    let slots = slots.into_iter().flatten();
    let newest = match planted(Bug::StaleSlotChosen) {
        false => slots.max_by_key(|slot| slot.generation),
        true => slots.min_by_key(|slot| slot.generation),
    };
    let Some(slot) = newest else {
        let journal = journal().filter(|journal| {
            (journal.head.meta.file_id(), journal.head.version) == (file_id, version)
                && journal.frames.last().is_some_and(|frame| frame.records_end <= source.bytes())
        });
        let journal = journal.ok_or_else(|| StoreFault {
            place: "commit slots".to_owned(),
            what: "neither holds a commit, as where a build was stopped before its first one".to_owned(),
            remedy: "give the command that builds it again, which begins anew".to_owned(),
        })?;
        return unfinished_commit(journal);
    };
    // Of what lies elsewhere, both come at once.
    source.ahead(slot.meta_offset, u64::from(slot.meta_bytes).min(META_BYTES_MAX as u64));
    source.ahead(slot.index_offset, INDEX_BYTES_AHEAD);
    let meta = metadata_of(source, &slot, file_id).map_err(|what| fault("commit slot", what))?;
    if crc32fast::hash(&meta) != slot.meta_crc {
        return Err(fault("metadata", "the checksum differs"));
    }
    let entries = read_entries(source, &slot)?;
    let meta = Meta::decode(&meta, version).map_err(|what| fault("metadata", what))?;
    if meta.file_id() != file_id {
        return Err(fault("metadata", "it belongs to another store"));
    }
    let place = meta.beads.as_ref().and_then(|beads| beads.identity);
    let identity = match &place {
        Some(place) => read_identity(source, &slot, place)?,
        None => Vec::new(),
    };
    let index = index_of(entries, &identity, slot.records_end, &meta)?;
    if meta.numbers.nodes_per_level != index.nodes_per_level() {
        return Err(fault("metadata", "its numbers of nodes are not those of the index"));
    }
    let end = slot.meta_offset + u64::from(slot.meta_bytes);
    Ok(Commit { version, meta, index, identity, end, unfinished: false })
}

/// What a journal says, of which every frame is known to be sound.
fn unfinished_commit(journal: Journal) -> std::result::Result<Commit, StoreFault> {
    let Journal { head, frames, .. } = journal;
    let end = frames.last().map_or(HEADER_BYTES as u64, |frame| frame.records_end);
    let (mut entries, mut identity) = (Vec::new(), Vec::new());
    for frame in frames {
        entries.extend(frame.entries);
        identity.extend(frame.lists);
    }
    entries.sort_unstable_by_key(|entry: &IndexEntry| entry.key);
    identity.sort_unstable_by_key(|entry: &IdentityEntry| entry.key);
    let index = Index::of_unfinished(entries, head.meta.depth)
        .map_err(|(key, what)| fault(format!("journal, entry of {key}"), what))?;
    if !identity.is_sorted_by(|a, b| a.key < b.key) {
        return Err(fault("journal", "a list of beads is repeated"));
    }
    let mut meta = head.meta;
    // Tables and index of the beads come at the end.
    if let Some(beads) = &mut meta.beads {
        beads.identity = None;
    }
    Ok(Commit { version: head.version, meta, index, identity, end, unfinished: true })
}

/// Reads the metadata that a commit names, having checked that records, index and metadata lie in the file in this order;
/// the error is one phrase.
fn metadata_of(source: &ByteSource, slot: &Slot, file_id: FileId) -> std::result::Result<Vec<u8>, String> {
    const CUT: &str = "the file is shorter than its commit says";
    if slot.file_id != file_id {
        return Err("it belongs to another store".to_owned());
    }
    if slot.meta_bytes as usize > META_BYTES_MAX {
        return Err("the metadata is larger than the format allows".to_owned());
    }
    let index_bytes = slot.index_entries.checked_mul(ENTRY_BYTES as u64).ok_or(CUT)?;
    let index_end = slot.index_offset.checked_add(index_bytes).ok_or(CUT)?;
    let meta_end = slot.meta_offset.checked_add(u64::from(slot.meta_bytes)).ok_or(CUT)?;
    let ordered = (HEADER_BYTES as u64) <= slot.records_end
        && slot.records_end <= slot.index_offset
        && index_end <= slot.meta_offset;
    if meta_end > source.bytes() {
        return Err(CUT.to_owned());
    }
    if !ordered {
        return Err("its parts overlap".to_owned());
    }
    source.part(slot.meta_offset, u64::from(slot.meta_bytes))
}

/// Reads the index, which is known to lie in the file, part by part: as a whole it would be in memory twice.
fn read_entries(source: &ByteSource, slot: &Slot) -> std::result::Result<Vec<IndexEntry>, StoreFault> {
    let end = slot.index_entries * ENTRY_BYTES as u64;
    let mut entries = Vec::with_capacity(slot.index_entries as usize);
    let (mut checksum, mut illegal) = (crc32fast::Hasher::new(), None);
    let mut bytes = Vec::new();
    for from in (0..end).step_by(INDEX_BYTES_AT_ONCE) {
        let length = (end - from).min(INDEX_BYTES_AT_ONCE as u64);
        source.ahead(slot.index_offset + from, (end - from).min(INDEX_BYTES_AHEAD));
        let read = source.read(slot.index_offset + from, length, &mut bytes);
        read.map_err(|what| fault("commit slot", what))?;
        checksum.update(&bytes);
        let mut stored = bytes.as_chunks::<ENTRY_BYTES>().0.iter();
        while let (None, Some(entry)) = (&illegal, stored.next()) {
            match IndexEntry::decode(entry) {
                Ok(entry) => entries.push(entry),
                Err(what) => illegal = Some((entries.len(), what)),
            }
        }
    }
    if checksum.finalize() != slot.index_crc && !planted(Bug::IndexChecksumIgnored) {
        return Err(fault("index", "the checksum differs"));
    }
    match illegal {
        Some((position, what)) => Err(fault(format!("index entry {position}"), what)),
        None => Ok(entries),
    }
}

/// Reads the index of the beads' identity, which lies between the records and the index of bricks, behind the
/// tables.
fn read_identity(
    source: &ByteSource,
    slot: &Slot,
    place: &IdentityPlace,
) -> std::result::Result<Vec<IdentityEntry>, StoreFault> {
    let fault = |what: &str| fault("index of beads", what);
    let bytes = place.index_entries.checked_mul(IDENTITY_ENTRY_BYTES as u64);
    let end = bytes.and_then(|bytes| place.index_offset.checked_add(bytes));
    let tables_end = place.tables_offset.checked_add(place.tables_bytes);
    let (Some(end), Some(tables_end)) = (end, tables_end) else {
        return Err(fault("it lies outside the file"));
    };
    // The index of bricks is known to lie within the file.
    let ordered = slot.records_end <= place.tables_offset
        && tables_end <= place.index_offset
        && end <= slot.index_offset;
    if !ordered {
        return Err(fault("its parts overlap or lie outside the file"));
    }
    let bytes = source.part(place.index_offset, end - place.index_offset).map_err(|what| fault(&what))?;
    if crc32fast::hash(&bytes) != place.index_crc {
        return Err(fault("the checksum differs"));
    }
    let entries = bytes.as_chunks::<IDENTITY_ENTRY_BYTES>().0.iter().map(IdentityEntry::decode);
    let entries: Vec<IdentityEntry> =
        entries.collect::<Option<_>>().ok_or_else(|| fault("an illegal key"))?;
    if !entries.is_sorted_by(|a, b| a.key < b.key) {
        return Err(fault("its keys are out of order"));
    }
    Ok(entries)
}

/// The entries as an index, if they make one.
fn index_of(
    entries: Vec<IndexEntry>,
    identity: &[IdentityEntry],
    records_end: u64,
    meta: &Meta,
) -> std::result::Result<Index, StoreFault> {
    check_places(&entries, identity, records_end)?;
    let index = match &meta.shard {
        None => Index::new(entries, meta.depth),
        Some(shard) => Index::of_shard(entries, meta.depth, shard),
    };
    let index = index.map_err(|(key, what)| fault(format!("index entry of {key}"), what))?;
    match identity.iter().find(|entry| !may_list_beads(&index, meta, entry.key)) {
        Some(entry) => Err(fault(format!("index of beads, {}", entry.key), "the tree has no such leaf")),
        None => Ok(index),
    }
}

/// Whether the node is a leaf, or may become one when shards are joined.
fn may_list_beads(index: &Index, meta: &Meta, key: NodeKey) -> bool {
    match (index.get(key), &meta.shard) {
        (Some(node), _) => node.leaf,
        (None, Some(shard)) => shard.found.joined && key.level() <= shard.level && shard.owns(key),
        (None, None) => false,
    }
}

/// Payloads and lists of beads lie within the records area, and no two of them overlap.
fn check_places(
    entries: &[IndexEntry],
    identity: &[IdentityEntry],
    records_end: u64,
) -> std::result::Result<(), StoreFault> {
    let bricks = entries.iter().map(|entry| (entry.offset, entry.length, entry.key));
    let lists = identity.iter().map(|entry| (entry.offset, entry.length, entry.key));
    let mut stored: Vec<(u64, u32, NodeKey)> =
        bricks.chain(lists).filter(|(_, length, _)| *length > 0).collect();
    stored.sort_unstable();
    let mut free = HEADER_BYTES as u64;
    for (offset, length, key) in stored {
        let place = || format!("index entry of {key}");
        if offset < free && !planted(Bug::OverlapsIgnored) {
            return Err(fault(place(), "its record overlaps another one"));
        }
        free = offset
            .checked_add(u64::from(length))
            .filter(|&end| end <= records_end)
            .ok_or_else(|| fault(place(), "its record lies outside the file's records"))?;
    }
    Ok(())
}
