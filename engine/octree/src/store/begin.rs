//! The beginning of a store's writing: anew, or where an earlier run left off.

use super::identity::IdentityEntry;
use super::journal::{Journal, JournalHead, SettingPairs, encode_frame, journal_path};
use super::layout::IndexEntry;
use super::resume_state::{RecoveredFrames, belongs, find};
use crate::disk::planted::{Bug, planted};
use crate::disk::{Disk, DiskFile};
use crate::error::{Error, Result};
use crate::part::{busy, part_path};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What to do about an unfinished store that is another's.
const REMEDY: &str =
    "give the same input and settings to go on with it; to begin anew add `restart`, or remove this file";

/// Appends commits to a journal, which is made when the first comes: most stores are finished before one is due.
pub(super) struct JournalWriter {
    path: PathBuf,
    /// The stored form of what it begins with.
    head: Vec<u8>,
    file: Option<Arc<dyn DiskFile>>,
    /// Whether there may be a file.
    is_there: bool,
    end: u64,
    crc: u32,
    generation: u64,
    /// How many entries and lists it has.
    counts: (usize, usize),
}

impl JournalWriter {
    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether there is something to go on with.
    pub fn has_commits(&self) -> bool {
        self.generation > 0
    }

    /// Nodes that are durable.
    pub fn nodes(&self) -> u64 {
        self.counts.0 as u64
    }

    /// Whether everything is committed.
    pub fn is_current(&self, counts: (usize, usize)) -> bool {
        self.counts == counts
    }

    /// Commits the entries and lists that it does not have yet. The records must be durable.
    ///
    /// # Errors
    /// The system's. Nobody knows then whether the commit is there.
    pub fn commit(
        &mut self,
        disk: &dyn Disk,
        records_end: u64,
        entries: &[IndexEntry],
        lists: &[IdentityEntry],
    ) -> io::Result<()> {
        self.is_there = true;
        let first = self.file.is_none();
        let file = match &self.file {
            Some(file) => Arc::clone(file),
            None => {
                let file = disk.open_locked(&self.path)?.ok_or(io::ErrorKind::WouldBlock)?;
                file.set_size(0)?;
                file
            }
        };
        let mut bytes = if first { self.head.clone() } else { Vec::new() };
        let new = (&entries[self.counts.0..], &lists[self.counts.1..]);
        let crc = encode_frame((self.generation + 1, records_end), new.0, new.1, self.crc, &mut bytes);
        file.write_all_at(&bytes, self.end)?;
        if !planted(Bug::FrameNotSynced) {
            file.sync()?;
        }
        if first && !planted(Bug::DirectoryNotSyncedAtCommit) {
            // Both names: that of the store's file is as new.
            disk.sync_directory(&self.path)?;
        }
        self.file = Some(file);
        self.end += bytes.len() as u64;
        self.crc = crc;
        self.generation += 1;
        self.counts = (entries.len(), lists.len());
        Ok(())
    }

    /// Removes the file. What is left of one beside a finished store means nothing to anybody, so nobody is told of a
    /// failure.
    pub fn remove(&mut self, disk: &dyn Disk) {
        if std::mem::take(&mut self.is_there) {
            let _ = disk.remove(&self.path);
        }
        // Its lock goes last: until then no other writer begins.
        self.file = None;
    }
}

/// A store's unfinished file, locked.
pub(super) struct UnfinishedStore {
    pub file: Arc<dyn DiskFile>,
    pub journal: JournalWriter,
    /// What is there already.
    pub found: Option<RecoveredFrames>,
}

/// Opens or creates `NAME.part`. If its journal says that it is an unfinished store of the same input and settings, it
/// is gone on with; otherwise it is emptied, or, if it is an unfinished store of another input or other settings,
/// refused unless `restart` says to give it up.
///
/// # Errors
/// [`Error::Io`]; [`Error::Store`] if another process is writing it, or it is refused.
pub(super) fn begin(
    disk: &dyn Disk,
    final_path: &Path,
    head: &JournalHead,
    restart: bool,
) -> Result<UnfinishedStore> {
    let (part, journal_path) = (part_path(final_path), journal_path(final_path));
    let file = disk.open_locked(&part).map_err(Error::io(final_path, "create"))?;
    let file = file.ok_or_else(|| busy(final_path))?;
    let (head_bytes, head_crc) = head
        .encode()
        .map_err(|what| Error::store(final_path, "metadata", what, "give fewer or shorter input paths"))?;
    let journal = JournalWriter {
        path: journal_path,
        end: 0,
        head: head_bytes,
        crc: head_crc,
        file: None,
        is_there: false,
        generation: 0,
        counts: (0, 0),
    };
    let begun = go_on(disk, (final_path, &part), &file, head, restart, journal);
    if begun.is_err() && file.size().is_ok_and(|size| size == 0) {
        // Just made, and of no use.
        let _ = disk.remove(&part);
    }
    let (journal, found) = begun?;
    if found.is_none() {
        file.set_size(0).map_err(Error::io(&part, "empty"))?;
    }
    Ok(UnfinishedStore { file, journal, found })
}

/// What of an earlier run is to be gone on with, and its journal.
fn go_on(
    disk: &dyn Disk,
    (final_path, part): (&Path, &Path),
    file: &Arc<dyn DiskFile>,
    head: &JournalHead,
    restart: bool,
    fresh: JournalWriter,
) -> Result<(JournalWriter, Option<RecoveredFrames>)> {
    let path = fresh.path.clone();
    let io = |action| Error::io(&path, action);
    if !disk.exists(&path).map_err(io("inspect"))? {
        return Ok((fresh, None));
    }
    // Who has just finished a store holds this lock until the journal is gone.
    let journal_file = disk.open_locked(&path).map_err(io("open"))?.ok_or_else(|| busy(final_path))?;
    let mut bytes = vec![0; journal_file.size().map_err(io("inspect"))? as usize];
    journal_file.read_all_at(&mut bytes, 0).map_err(io("read"))?;
    let read_part = |error| Error::io(part, "read")(error);
    // A journal beside another file than its own is what a finished store has left.
    let journal = match Journal::decode(&bytes) {
        Some(journal) if !restart && belongs(&journal, file).map_err(read_part)? => Some(journal),
        _ => None,
    };
    let found = match journal {
        Some(journal) => {
            require_same(part, &journal.head, head)?;
            Some(find(journal, file).map_err(read_part)?)
        }
        None => None,
    };
    let Some(found) = found.filter(|found| found.generation > 0) else {
        // For good, before the file that it describes becomes another.
        disk.remove(&path).and_then(|()| disk.sync_directory(&path)).map_err(io("remove"))?;
        return Ok((fresh, None));
    };
    bytes.truncate(found.journal_end as usize);
    // Written once more: what a failed sync has left in memory alone looks durable to whoever reads it.
    let rewritten =
        journal_file.set_size(found.journal_end).and_then(|()| journal_file.write_all_at(&bytes, 0));
    rewritten.map_err(io("write"))?;
    if !planted(Bug::LeftoverKept) {
        file.set_size(found.records_end).map_err(Error::io(part, "cut"))?;
    }
    let journal = JournalWriter {
        file: Some(journal_file),
        is_there: true,
        end: found.journal_end,
        crc: found.crc,
        generation: found.generation,
        counts: (found.entries.len(), found.lists.len()),
        ..fresh
    };
    Ok((journal, Some(found)))
}

/// Longest value of a setting that an error shows whole, in characters.
const SHOWN_MAX: usize = 120;

/// Fails, and names the difference, if an unfinished store comes of another input or other settings.
fn require_same(part: &Path, theirs: &JournalHead, ours: &JournalHead) -> Result<()> {
    if planted(Bug::SettingsNotCompared) {
        return Ok(());
    }
    match difference(theirs, ours) {
        Some(what) => Err(Error::store(part, "unfinished store", what, REMEDY)),
        None => Ok(()),
    }
}

/// The first thing in which two builds differ, with both values. What the user has set comes before what follows from
/// it: other widths of beads are another content of the input as well.
fn difference(theirs: &JournalHead, ours: &JournalHead) -> Option<String> {
    let facts = |head: &JournalHead| {
        let shard = head.meta.shard.as_ref().map_or("none".to_owned(), |shard| shard.id.to_string());
        head.meta.facts().into_iter().chain([("shard".to_owned(), shard)]).collect::<SettingPairs>()
    };
    let of_settings = other_value(&theirs.settings, &ours.settings);
    let (name, value, this) = of_settings.or_else(|| other_value(&facts(theirs), &facts(ours)))?;
    if let Some(number) = name.strip_prefix("BLAKE3 hash of input ") {
        return Some(other_content(number, theirs, ours));
    }
    if matches!(&name[..], "depth" | "root cube") && theirs.meta.root.edge != ours.meta.root.edge {
        let cell =
            |head: &JournalHead| format!("{} {}", head.meta.root.spacing(head.meta.depth), head.meta.unit);
        return Some(format!("its finest cell is {}, that of this build is {}", cell(theirs), cell(ours)));
    }
    let shown = |value: Option<String>| value.map_or("not set".to_owned(), |value| shown(&value));
    Some(format!("its {name} is {}, that of this build is {}", shown(value), shown(this)))
}

/// The first name of which two lists have other values, and both values.
fn other_value(
    theirs: &SettingPairs,
    ours: &SettingPairs,
) -> Option<(String, Option<String>, Option<String>)> {
    let value_in = |list: &SettingPairs, name: &str| {
        list.iter().find(|(other, _)| other == name).map(|(_, value)| value.clone())
    };
    let names = theirs.iter().chain(ours).map(|(name, _)| name);
    names
        .map(|name| (name.clone(), value_in(theirs, name), value_in(ours, name)))
        .find(|(_, value, this)| value != this)
}

/// A value, cut off if it is long.
fn shown(value: &str) -> String {
    match value.char_indices().nth(SHOWN_MAX) {
        Some((end, _)) => format!("{}…", &value[..end]),
        None => value.to_owned(),
    }
}

/// What can be said of an input with another hash; hashes say nothing to people.
fn other_content(number: &str, theirs: &JournalHead, ours: &JournalHead) -> String {
    let at = number.parse::<usize>().ok().and_then(|number| number.checked_sub(1)).unwrap_or_default();
    let source =
        |head: &JournalHead| head.meta.sources.get(at).map(|source| (source.path.clone(), source.bytes));
    match (source(theirs), source(ours)) {
        (Some((path, bytes)), Some((other, now))) if path == other && bytes == now => {
            format!(
                "its input {number}, {path:?}, has changed since then, though it has {now} bytes as before"
            )
        }
        (Some((path, bytes)), Some((other, now))) => format!(
            "its input {number} was {path:?} with {bytes} bytes, that of this build is {other:?} with {now} bytes"
        ),
        _ => format!("its input {number} is another"),
    }
}
