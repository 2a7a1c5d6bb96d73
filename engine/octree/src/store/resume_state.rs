//! What an earlier run has left of an unfinished store, found sound.

use super::identity::{IdentityEntry, identity_crc};
use super::journal::{CommitFrame, Journal};
use super::layout::{HEADER_BYTES, IndexEntry, Version, decode_preamble, record_crc};
use crate::brick::Brick;
use crate::brick::codec::{Scratch, decode};
use crate::disk::DiskFile;
use crate::disk::planted::{Bug, planted};
use crate::error::Error;
use crate::lattice::{MAX_LEVEL, NodeKey};
use std::io::{ErrorKind, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Nodes and lists of beads that need not be made again. Any number of threads may ask.
pub struct ResumeState {
    file: Arc<dyn DiskFile>,
    path: PathBuf,
    version: Version,
    /// By key.
    entries: Vec<IndexEntry>,
    /// By key.
    lists: Vec<IdentityEntry>,
    /// Where along the Morton curve the last list's node begins.
    last_list: Option<u64>,
}

/// What of a journal's frames can be gone on with.
pub(super) struct RecoveredFrames {
    /// In the order in which they were appended.
    pub entries: Vec<IndexEntry>,
    pub lists: Vec<IdentityEntry>,
    pub generation: u64,
    pub records_end: u64,
    /// Where the sound frames end in the journal, and the checksum of the last.
    pub journal_end: u64,
    pub crc: u32,
}

/// Reads what the frames name, and takes them up to the first of which something is missing or damaged: what has not
/// survived is made again.
pub(super) fn find(journal: Journal, file: &Arc<dyn DiskFile>) -> Result<RecoveredFrames> {
    let Journal { head, frames, head_end, head_crc } = journal;
    let mut found = RecoveredFrames {
        entries: Vec::new(),
        lists: Vec::new(),
        generation: 0,
        records_end: HEADER_BYTES as u64,
        journal_end: head_end,
        crc: head_crc,
    };
    let mut bytes = Vec::new();
    for frame in frames {
        if !planted(Bug::KeptRecordsNotVerified) && !is_sound(&frame, head.version, file, &mut bytes)? {
            break;
        }
        let CommitFrame { generation, records_end, entries, lists, end, crc } = frame;
        found.entries.extend(entries);
        found.lists.extend(lists);
        found = RecoveredFrames { generation, records_end, journal_end: end, crc, ..found };
    }
    Ok(found)
}

/// Whether every record of a frame is what its checksum says.
fn is_sound(
    frame: &CommitFrame,
    version: Version,
    file: &Arc<dyn DiskFile>,
    bytes: &mut Vec<u8>,
) -> Result<bool> {
    if frame.records_end > file.size()? {
        return Ok(false);
    }
    for entry in &frame.entries {
        read(file, (entry.offset, entry.length), bytes)?;
        if record_crc(version, entry.key, entry.leaf, entry.head, bytes) != entry.crc {
            return Ok(false);
        }
    }
    for entry in &frame.lists {
        read(file, (entry.offset, entry.length), bytes)?;
        if identity_crc(version, entry.key, bytes) != entry.crc {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Reads a payload, which is known to lie within the file.
fn read(file: &Arc<dyn DiskFile>, (offset, length): (u64, u32), bytes: &mut Vec<u8>) -> Result<()> {
    bytes.resize(length as usize, 0);
    file.read_all_at(bytes, offset)
}

/// Whether the file begins as the store that the journal is about.
pub(super) fn belongs(journal: &Journal, file: &Arc<dyn DiskFile>) -> Result<bool> {
    let mut header = vec![0; HEADER_BYTES];
    match file.read_all_at(&mut header, 0) {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(false),
        other => other?,
    }
    Ok(decode_preamble(&header) == Ok((journal.head.meta.file_id(), journal.head.version)))
}

impl ResumeState {
    pub(super) fn new(
        file: Arc<dyn DiskFile>,
        path: &Path,
        version: Version,
        found: &RecoveredFrames,
    ) -> ResumeState {
        let (mut entries, mut lists) = (found.entries.clone(), found.lists.clone());
        entries.sort_unstable_by_key(|entry| entry.key);
        lists.sort_unstable_by_key(|entry| entry.key);
        let begins = |key: NodeKey| key.code() << (3 * u32::from(MAX_LEVEL - key.level()));
        let last_list = lists.iter().map(|list| begins(list.key)).max();
        ResumeState { file, path: path.to_owned(), version, entries, lists, last_list }
    }

    /// Nodes that it holds.
    pub fn nodes(&self) -> u64 {
        self.entries.len() as u64
    }

    /// How far it goes along the Morton curve through the root, 0 to 1: builds append in that order.
    pub fn part_of_curve(&self) -> f64 {
        let whole = 1u64 << (3 * u32::from(MAX_LEVEL));
        let ends = |key: NodeKey| (key.code() + 1) << (3 * u32::from(MAX_LEVEL - key.level()));
        let last = self.entries.iter().map(|entry| ends(entry.key)).max().unwrap_or(whole);
        (last - whole) as f64 / whole as f64
    }

    /// Memory that it takes.
    pub(super) fn heap_bytes(&self) -> u64 {
        (self.entries.capacity() * size_of::<IndexEntry>()
            + self.lists.capacity() * size_of::<IdentityEntry>()) as u64
    }

    /// What there is of a node. Payloads are appended children first, so if it is an interior node, all that is below it is
    /// there too.
    pub(super) fn entry(&self, key: NodeKey) -> Option<&IndexEntry> {
        self.entries.binary_search_by_key(&key, |entry| entry.key).ok().map(|at| &self.entries[at])
    }

    /// What there is of a leaf's list of beads.
    pub(super) fn list(&self, key: NodeKey) -> Option<&IdentityEntry> {
        self.lists.binary_search_by_key(&key, |entry| entry.key).ok().map(|at| &self.lists[at])
    }

    /// Whether the lists of beads of everything below a node are there: they are appended along the Morton curve, so if
    /// one behind them is.
    pub fn has_lists_behind(&self, key: NodeKey) -> bool {
        self.last_list.is_some_and(|last| last > key.post_order().0)
    }

    /// The brick of a node whose subtree need not be built again. `None` if there is none, and of uniform leaves: these
    /// may stand for a part of the tree that was found empty when its siblings were not, and cost nothing to find again.
    ///
    /// # Errors
    /// If it cannot be read, or not any more what it was.
    pub fn brick(&self, key: NodeKey) -> crate::error::Result<Option<Brick>> {
        self.load(key).map_err(Error::io(&self.path, "read"))
    }

    fn load(&self, key: NodeKey) -> Result<Option<Brick>> {
        let Some(entry) = self.entry(key) else { return Ok(None) };
        if entry.head.kind.is_uniform() {
            return Ok((!entry.leaf).then_some(Brick::Uniform(entry.head.min)));
        }
        let mut bytes = Vec::new();
        read(&self.file, (entry.offset, entry.length), &mut bytes)?;
        if record_crc(self.version, key, entry.leaf, entry.head, &bytes) != entry.crc {
            return Err(std::io::Error::new(ErrorKind::InvalidData, format!("record {key} has changed")));
        }
        let brick = decode(entry.head.kind, entry.head.min, &bytes, &mut Scratch::new());
        brick.map(Some).map_err(|error| std::io::Error::new(ErrorKind::InvalidData, error.to_string()))
    }
}
