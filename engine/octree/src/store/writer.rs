//! Writes a store: records first, in the order they are appended, then index, metadata and commit, and at last
//! the final name. Commits in between go to a journal, so that an interrupted writing can be gone on with.

use super::begin::{JournalWriter, UnfinishedStore, begin};
use super::identity::{BeadTables, IdentityEntry, IdentityPlace, identity_crc};
use super::index::Index;
use super::journal::{JournalHead, SettingPairs};
use super::layout::{
    FileId, HEADER_BYTES, IndexEntry, PAGE_BYTES, SLOT_OFFSETS, Slot, Version, encode_preamble, record_crc,
};
use super::meta::Meta;
use super::resume_state::ResumeState;
use crate::brick::Brick;
use crate::brick::codec::{PayloadHead, PayloadKind, Scratch, encode_into};
use crate::disk::planted::{Bug, planted};
use crate::disk::write_back::WriteBack;
use crate::disk::{Disk, DiskFile, SystemDisk};
use crate::error::{Error, Result};
use crate::lattice::NodeKey;
use crate::part::{part_path, require_directory};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Records are gathered into writes of at least this size, so that the cost of a system call is spread over
/// some two hundred typical records.
const WRITE_BYTES: usize = 1 << 20;
/// The remedy for what can only be a mistake in the program.
const BUG: &str = "this is a bug in the program, please report it";
/// The remedy for what does not fit what an earlier run has left.
const UNFIT: &str = "the unfinished store was made in another way or is damaged: add `restart` to begin anew";

/// Writes one store to `FINAL.part`; [`StoreWriter::finish`] gives it its final name. Dropped before that, it
/// leaves what was committed, with a journal of it, and nothing if nothing was.
///
/// The finished file's bytes depend only on the metadata and on the order of the appended records.
pub struct StoreWriter {
    disk: Arc<dyn Disk>,
    file: Arc<dyn DiskFile>,
    part_path: PathBuf,
    final_path: PathBuf,
    file_id: FileId,
    version: Version,
    /// In the order in which they were appended.
    entries: Vec<IndexEntry>,
    /// Which beads leaves count, if the store is to say so.
    identity: Option<BeadTables>,
    lists: Vec<IdentityEntry>,
    /// What an earlier run has left.
    kept: Option<Arc<ResumeState>>,
    journal: JournalWriter,
    /// How often to commit, and when that was done last.
    pace: Option<Duration>,
    committed: Instant,
    /// Records not yet written; they belong at `written`.
    buffer: Vec<u8>,
    written: u64,
    write_back: WriteBack,
    state: State,
    /// Whether nothing of it is to be kept.
    is_given_up: bool,
    /// What to do about records that do not fit together.
    remedy: &'static str,
    scratch: Scratch,
    payload: Vec<u8>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    Open,
    /// A write failed: the file's content is not what was asked for.
    Poisoned,
    Finished,
}

/// What [`StoreWriter::finish`] wrote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stats {
    /// Nodes in the store.
    pub nodes: u64,
    /// Leaves among them.
    pub leaves: u64,
    /// Bytes of all records.
    pub record_bytes: u64,
    /// Size of the file.
    pub file_bytes: u64,
}

impl StoreWriter {
    /// Creates `FINAL.part`, takes its lock and writes the header. `meta` decides the store's identity: up to
    /// its numbers it must be the one given to [`StoreWriter::finish`].
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be created, [`Error::Store`] if `final_path` cannot become a store,
    /// another process is writing it, or it is an unfinished store that somebody may want to go on with.
    pub fn create(final_path: &Path, meta: &Meta) -> Result<StoreWriter> {
        let made_by = ("made by".to_owned(), "copying records".to_owned());
        StoreWriter::begin(Arc::new(SystemDisk), final_path, meta, vec![made_by], false)
    }

    /// As [`StoreWriter::create`], but goes on where an earlier writer of the same metadata and `settings`, which are
    /// all that decides the store beside the metadata, was interrupted: see [`StoreWriter::kept`]. `restart` gives up
    /// what is there. From then on [`StoreWriter::commit_if_due`] commits every `pace`.
    ///
    /// # Errors
    /// As [`StoreWriter::create`], and [`Error::Store`] if what is there has other metadata or settings.
    pub fn resume(
        final_path: &Path,
        meta: &Meta,
        settings: SettingPairs,
        restart: bool,
        pace: Duration,
    ) -> Result<StoreWriter> {
        let mut writer = StoreWriter::begin(Arc::new(SystemDisk), final_path, meta, settings, restart)?;
        writer.pace = Some(pace);
        Ok(writer)
    }

    pub(super) fn begin(
        disk: Arc<dyn Disk>,
        final_path: &Path,
        meta: &Meta,
        settings: SettingPairs,
        restart: bool,
    ) -> Result<StoreWriter> {
        check_target(final_path)?;
        let head = JournalHead { version: meta.version(), meta: meta.clone(), settings };
        let UnfinishedStore { file, journal, found } = begin(&*disk, final_path, &head, restart)?;
        let part_path = part_path(final_path);
        let keep = |found| Arc::new(ResumeState::new(Arc::clone(&file), &part_path, head.version, found));
        let kept = found.as_ref().map(keep);
        let (entries, lists, records_end) = found
            .map_or((Vec::new(), Vec::new(), HEADER_BYTES as u64), |f| (f.entries, f.lists, f.records_end));
        // From here on dropping the writer removes the file, if nothing is committed.
        let mut writer = StoreWriter {
            disk,
            file,
            part_path,
            final_path: final_path.to_owned(),
            file_id: meta.file_id(),
            version: meta.version(),
            entries,
            identity: None,
            lists,
            kept,
            journal,
            pace: None,
            committed: Instant::now(),
            buffer: Vec::with_capacity(WRITE_BYTES + WRITE_BYTES / 4),
            written: 0,
            write_back: WriteBack::default(),
            state: State::Open,
            is_given_up: false,
            remedy: BUG,
            scratch: Scratch::new(),
            payload: Vec::new(),
        };
        // The slots too: an earlier run may have got as far as filling one.
        let mut header = [0; HEADER_BYTES];
        let preamble = encode_preamble(writer.file_id, writer.version);
        header[..preamble.len()].copy_from_slice(&preamble);
        writer.write(&header)?;
        writer.flush()?;
        writer.written = records_end;
        if writer.kept.is_some() {
            writer.remedy = UNFIT;
        }
        Ok(writer)
    }

    /// Says that the records come from files, which may be forged, and what to do if they do not fit together.
    pub fn of_files(mut self, remedy: &'static str) -> StoreWriter {
        self.remedy = remedy;
        self
    }

    /// What an earlier writer has left. Its records are in the store; to append them again changes nothing.
    pub fn kept(&self) -> Option<Arc<ResumeState>> {
        self.kept.clone()
    }

    /// Encodes and appends a node.
    ///
    /// # Errors
    /// As [`StoreWriter::append`].
    pub fn append_brick(&mut self, key: NodeKey, leaf: bool, brick: &Brick) -> Result<()> {
        let mut payload = std::mem::take(&mut self.payload);
        payload.clear();
        let head = encode_into(brick, &mut self.scratch, &mut payload);
        let appended = self.append(key, leaf, head, &payload);
        self.payload = payload;
        appended
    }

    /// Appends a node whose brick [`encode_into`] has encoded, on whichever thread.
    ///
    /// # Errors
    /// [`Error::Io`] if writing fails, after which the writer takes nothing more; [`Error::Store`] if the
    /// record breaks a rule of the format.
    pub fn append(&mut self, key: NodeKey, leaf: bool, head: PayloadHead, payload: &[u8]) -> Result<()> {
        self.check_usable()?;
        let unfit = |what: &str| self.unfit(format!("record {key}"), what);
        let length = u32::try_from(payload.len()).map_err(|_| unfit("the payload is too long"))?;
        let offset = if head.kind == PayloadKind::UNIFORM { 0 } else { self.position() };
        let crc = record_crc(self.version, key, leaf, head, payload);
        let entry = IndexEntry { key, offset, length, crc, leaf, head };
        entry.check().map_err(unfit)?;
        if let Some(kept) = self.kept.as_ref().and_then(|kept| kept.entry(key))
            && !planted(Bug::KeptNodesRepeated)
        {
            let same = IndexEntry { offset: kept.offset, ..entry } == *kept;
            return if same { Ok(()) } else { Err(unfit("it is not what an earlier run has made of it")) };
        }
        self.write(payload)?;
        if self.entries.len() == self.entries.capacity() {
            // Not doubled: what the list may grow to counts as memory that is taken.
            self.entries.reserve_exact(self.entries.len() / 8 + 1024);
        }
        self.entries.push(entry);
        Ok(())
    }

    /// Memory that the index takes so far.
    pub fn index_bytes(&self) -> u64 {
        let kept = self.kept.as_ref().map_or(0, |kept| kept.heap_bytes());
        (self.entries.capacity() * size_of::<IndexEntry>()) as u64 + kept
    }

    /// The nodes so far, in key order, and which of them are leaves.
    pub fn nodes(&self) -> Vec<(NodeKey, bool)> {
        let mut nodes: Vec<(NodeKey, bool)> = self.entries.iter().map(|e| (e.key, e.leaf)).collect();
        nodes.sort_unstable();
        nodes
    }

    /// The smallest sample of all nodes so far, rounded.
    pub fn lowest(&self) -> Option<i16> {
        self.entries.iter().map(|entry| entry.head.min).min()
    }

    /// Begins the identity of beads, for stores whose metadata announces it.
    pub fn begin_identity(&mut self, tables: BeadTables) {
        self.identity = Some(tables);
    }

    /// Appends the record of a leaf, made by [`super::encode_segments`].
    ///
    /// # Errors
    /// As [`StoreWriter::append`].
    pub fn append_identity(&mut self, key: NodeKey, record: &[u8]) -> Result<()> {
        self.check_usable()?;
        let unfit = |what: &str| self.unfit(format!("identity {key}"), what);
        let length = u32::try_from(record.len()).map_err(|_| unfit("the record is too long"))?;
        if self.identity.is_none() {
            return Err(unfit("it was not begun"));
        }
        let crc = identity_crc(self.version, key, record);
        if let Some(kept) = self.kept.as_ref().and_then(|kept| kept.list(key)) {
            let same = (kept.length, kept.crc) == (length, crc);
            return if same { Ok(()) } else { Err(unfit("it is not what an earlier run has made of it")) };
        }
        self.lists.push(IdentityEntry { key, offset: self.position(), length, crc });
        self.write(record)
    }

    /// Makes all that was appended durable and enters it into the journal, if the pace of the writer says so.
    ///
    /// # Errors
    /// As [`StoreWriter::commit`].
    pub fn commit_if_due(&mut self) -> Result<()> {
        match self.pace {
            Some(pace) if self.committed.elapsed() >= pace => self.commit(),
            _ => Ok(()),
        }
    }

    /// Makes all that was appended durable and enters it into the journal: from then on it is not lost, whatever
    /// happens.
    ///
    /// # Errors
    /// [`Error::Io`], after which the writer takes nothing more.
    pub fn commit(&mut self) -> Result<()> {
        self.check_usable()?;
        if !self.journal.is_current((self.entries.len(), self.lists.len())) {
            self.flush()?;
            if !planted(Bug::RecordsNotSyncedBeforeFrame) {
                self.sync()?;
            }
            let done = self.journal.commit(&*self.disk, self.written, &self.entries, &self.lists);
            if done.is_err() {
                self.state = State::Poisoned;
            }
            done.map_err(Error::io(self.journal.path(), "write"))?;
        }
        self.committed = Instant::now();
        Ok(())
    }

    /// The unfinished file and how many nodes in it are safe, if there are any: dropped now, the writer leaves them.
    pub fn unfinished(&self) -> Option<(PathBuf, u64)> {
        self.journal.has_commits().then(|| (self.part_path.clone(), self.journal.nodes()))
    }

    /// Gives up what was appended, and what was committed before: dropped now, the writer leaves no file.
    pub fn give_up(&mut self) {
        self.is_given_up = true;
    }

    /// Sorts and checks the index, commits, makes the file durable and gives it its final name. The numbers of
    /// nodes per level in `meta` are filled in here.
    ///
    /// # Errors
    /// [`Error::Io`] if writing fails, [`Error::Store`] if the nodes are not one complete octree, or not those that a
    /// shard says it holds, or the metadata is another store's. The final name is untouched then.
    pub fn finish(mut self, mut meta: Meta) -> Result<Stats> {
        self.check_usable()?;
        if meta.file_id() != self.file_id {
            let what = "it is not the metadata that the store was begun with";
            return Err(Error::store(&self.final_path, "metadata", what, BUG));
        }
        if self.journal.has_commits() {
            // If the program ends between the last commit and the rename, the journal is what is gone on with.
            self.commit()?;
        }
        let mut entries = std::mem::take(&mut self.entries);
        entries.sort_unstable_by_key(|entry| entry.key);
        let index = match &meta.shard {
            None => Index::new(entries, meta.depth),
            Some(shard) => Index::of_shard(entries, meta.depth, shard),
        };
        let index = index.map_err(|(key, what)| self.unfit(format!("record {key}"), what))?;
        meta.numbers.nodes_per_level = index.nodes_per_level();
        if meta.beads.as_ref().is_some_and(|b| b.identity.is_some()) != self.identity.is_some() {
            return Err(self.unfit("metadata".into(), "it does not say whether beads are told apart"));
        }
        let records_end = self.position();
        if let (Some(beads), Some(tables)) = (&mut meta.beads, self.identity.take()) {
            beads.identity = Some(self.write_identity(&tables)?);
        }
        let meta_bytes = meta.encode().map_err(|what| {
            Error::store(&self.final_path, "metadata", what, "give fewer or shorter input paths")
        })?;
        self.commit_all(&index, &meta_bytes, records_end)?;
        let stats = Stats {
            nodes: index.entries().len() as u64,
            leaves: index.entries().iter().filter(|entry| entry.leaf).count() as u64,
            record_bytes: records_end - HEADER_BYTES as u64,
            file_bytes: self.position(),
        };
        self.publish()?;
        Ok(stats)
    }

    /// Writes tables and index of the beads' identity behind the records.
    fn write_identity(&mut self, tables: &BeadTables) -> Result<IdentityPlace> {
        let tables = tables.encode();
        let tables_offset = self.position();
        self.write(&tables)?;
        let mut lists = std::mem::take(&mut self.lists);
        lists.sort_unstable_by_key(|entry| entry.key);
        let index_offset = self.position();
        let mut index_crc = crc32fast::Hasher::new();
        for entry in &lists {
            let bytes = entry.encode();
            index_crc.update(&bytes);
            self.write(&bytes)?;
        }
        Ok(IdentityPlace {
            tables_offset,
            tables_bytes: tables.len() as u64,
            tables_crc: crc32fast::hash(&tables),
            index_offset,
            index_entries: lists.len() as u64,
            index_crc: index_crc.finalize(),
        })
    }

    /// Writes index and metadata behind the records, makes them durable, then writes the slot that makes them
    /// valid, and makes that durable.
    fn commit_all(&mut self, index: &Index, meta: &[u8], records_end: u64) -> Result<()> {
        let mut index_crc = crc32fast::Hasher::new();
        let index_offset = self.position();
        for entry in index.entries() {
            let bytes = entry.encode();
            index_crc.update(&bytes);
            self.write(&bytes)?;
        }
        let meta_offset = self.position();
        self.write(meta)?;
        self.flush()?;
        if !planted(Bug::RecordsNotSyncedBeforeSlot) {
            self.sync()?;
        }
        let slot = Slot {
            generation: 1,
            file_id: self.file_id,
            records_end,
            index_offset,
            index_entries: index.entries().len() as u64,
            meta_offset,
            meta_bytes: meta.len() as u32,
            index_crc: index_crc.finalize(),
            meta_crc: crc32fast::hash(meta),
        };
        let mut page = [0; PAGE_BYTES];
        let bytes = slot.encode();
        page[..bytes.len()].copy_from_slice(&bytes);
        let written = self.file.write_all_at(&page, SLOT_OFFSETS[slot.which()] as u64);
        self.or_poison(written, "write")?;
        if planted(Bug::SlotNotSynced) { Ok(()) } else { self.sync() }
    }

    /// Gives the file its final name, for good.
    fn publish(&mut self) -> Result<()> {
        if planted(Bug::JournalRemovedBeforeRename) {
            self.journal.remove(&*self.disk);
        }
        self.disk
            .rename(&self.part_path, &self.final_path)
            .map_err(Error::io(&self.final_path, "rename to"))?;
        self.state = State::Finished;
        if !planted(Bug::DirectoryNotSyncedAfterRename) {
            let synced = self.disk.sync_directory(&self.final_path);
            synced.map_err(Error::io(&self.final_path, "make the name durable of"))?;
        }
        self.journal.remove(&*self.disk);
        Ok(())
    }

    /// File offset of the next byte.
    fn position(&self) -> u64 {
        self.written + self.buffer.len() as u64
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.buffer.extend_from_slice(bytes);
        if self.buffer.len() >= WRITE_BYTES { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        let written = self.file.write_all_at(&self.buffer, self.written);
        self.or_poison(written, "write")?;
        self.written += self.buffer.len() as u64;
        self.buffer.clear();
        self.write_back.wrote(&self.file, self.written);
        Ok(())
    }

    fn sync(&mut self) -> Result<()> {
        let synced = self.write_back.finish().and_then(|()| self.file.sync());
        self.or_poison(synced, "make durable")
    }

    fn or_poison(&mut self, result: std::io::Result<()>, action: &'static str) -> Result<()> {
        if result.is_err() && !planted(Bug::PoisonIgnored) {
            self.state = State::Poisoned;
        }
        result.map_err(Error::io(&self.part_path, action))
    }

    /// The error of records that do not fit together.
    fn unfit(&self, place: String, what: &str) -> Error {
        Error::store(&self.final_path, place, what, self.remedy)
    }

    fn check_usable(&self) -> Result<()> {
        if self.state == State::Open {
            return Ok(());
        }
        let what = "an earlier write failed";
        Err(Error::store(
            &self.final_path,
            "output",
            what,
            "make room or choose another place, and give the same command again",
        ))
    }
}

impl Drop for StoreWriter {
    fn drop(&mut self) {
        // The thread holds the file, and with it the lock. What it met was told, or the store is given up.
        let _ = self.write_back.finish();
        if self.state != State::Finished && (self.is_given_up || !self.journal.has_commits()) {
            // Nobody is left to tell; the next writer empties the file.
            let _ = self.disk.remove(&self.part_path);
            self.journal.remove(&*self.disk);
        }
    }
}

/// Refuses names that can never become a store, before any work is spent on one.
///
/// # Errors
/// [`Error::Store`] if `final_path` is no name of a file, a directory or the like, or in no directory.
pub fn check_target(final_path: &Path) -> Result<()> {
    let refuse = |what: &str, remedy: &str| Err(Error::store(final_path, "output", what, remedy));
    if final_path.file_name().is_none() {
        return refuse("this is not the name of a file", "give the store a name such as part.brf");
    }
    match std::fs::metadata(final_path) {
        Ok(found) if found.is_dir() => {
            return refuse("this is a directory", "give the store a name in it");
        }
        Ok(found) if !found.is_file() => {
            return refuse("this is not a regular file", "choose another name");
        }
        _ => {}
    }
    require_directory(final_path)
}
