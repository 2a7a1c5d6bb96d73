//! Writes a store: records first, in the order they are appended, then index, metadata and commit, and at last
//! the final name.

use super::identity::{BeadTables, IdentityEntry, IdentityPlace, identity_crc};
use super::index::Index;
use super::layout::{
    FileId, HEADER_BYTES, IndexEntry, PAGE_BYTES, SLOT_OFFSETS, Slot, Version, encode_preamble, record_crc,
};
use super::meta::Meta;
use super::write_back::WriteBack;
use crate::brick::Brick;
use crate::brick::codec::{PayloadHead, PayloadKind, Scratch, encode_into};
use crate::error::{Error, Result};
use crate::lattice::NodeKey;
use crate::part::{lock, part_path};
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Records are gathered into writes of at least this size, so that the cost of a system call is spread over
/// some two hundred typical records.
const WRITE_BYTES: usize = 1 << 20;
/// The remedy for what can only be a mistake in the program.
const BUG: &str = "this is a bug in the program, please report it";

/// Writes one store to `FINAL.part`; [`StoreWriter::finish`] gives it its final name. Dropped before that, it
/// leaves nothing behind.
///
/// The file's bytes depend only on the metadata and on the order of the appended records.
pub struct StoreWriter {
    file: File,
    part_path: PathBuf,
    final_path: PathBuf,
    file_id: FileId,
    version: Version,
    entries: Vec<IndexEntry>,
    /// Which beads leaves count, if the store is to say so.
    identity: Option<Identity>,
    /// Records not yet written; they belong at `written`.
    buffer: Vec<u8>,
    written: u64,
    write_back: WriteBack,
    state: State,
    scratch: Scratch,
    payload: Vec<u8>,
}

/// Which beads leaves count.
struct Identity {
    tables: BeadTables,
    entries: Vec<IdentityEntry>,
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
    /// [`Error::Io`] if the file cannot be created, [`Error::Store`] if `final_path` cannot become a store or
    /// another process is writing it.
    pub fn create(final_path: &Path, meta: &Meta) -> Result<StoreWriter> {
        check_target(final_path)?;
        let part_path = part_path(final_path);
        let file = lock(final_path, &part_path)?;
        // From here on dropping the writer removes the file.
        let mut writer = StoreWriter {
            file,
            part_path,
            final_path: final_path.to_owned(),
            file_id: meta.file_id(),
            version: meta.version(),
            entries: Vec::new(),
            identity: None,
            buffer: Vec::with_capacity(WRITE_BYTES + WRITE_BYTES / 4),
            written: 0,
            write_back: WriteBack::default(),
            state: State::Open,
            scratch: Scratch::new(),
            payload: Vec::new(),
        };
        writer.file.set_len(0).map_err(Error::io(&writer.part_path, "empty"))?;
        let mut header = [0; HEADER_BYTES];
        let preamble = encode_preamble(writer.file_id, writer.version);
        header[..preamble.len()].copy_from_slice(&preamble);
        writer.write(&header)?;
        writer.flush()?;
        Ok(writer)
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
        let bug = |what: &str| Error::store(&self.final_path, format!("record {key}"), what, BUG);
        let length = u32::try_from(payload.len()).map_err(|_| bug("the payload is too long"))?;
        let offset = if head.kind == PayloadKind::UNIFORM { 0 } else { self.position() };
        let crc = record_crc(self.version, key, leaf, head, payload);
        let entry = IndexEntry { key, offset, length, crc, leaf, head };
        entry.check().map_err(bug)?;
        self.write(payload)?;
        self.entries.push(entry);
        Ok(())
    }

    /// Memory that the index takes so far.
    pub fn index_bytes(&self) -> u64 {
        (self.entries.capacity() * size_of::<IndexEntry>()) as u64
    }

    /// The nodes so far, in key order, and which of them are leaves.
    pub fn nodes(&self) -> Vec<(NodeKey, bool)> {
        let mut nodes: Vec<(NodeKey, bool)> = self.entries.iter().map(|e| (e.key, e.leaf)).collect();
        nodes.sort_unstable();
        nodes
    }

    /// Begins the identity of beads, for stores whose metadata announces it.
    pub fn begin_identity(&mut self, tables: BeadTables) {
        self.identity = Some(Identity { tables, entries: Vec::new() });
    }

    /// Appends the record of a leaf, made by [`super::encode_segments`].
    ///
    /// # Errors
    /// As [`StoreWriter::append`].
    pub fn append_identity(&mut self, key: NodeKey, record: &[u8]) -> Result<()> {
        self.check_usable()?;
        let bug = |what: &str| Error::store(&self.final_path, format!("identity {key}"), what, BUG);
        let length = u32::try_from(record.len()).map_err(|_| bug("the record is too long"))?;
        let entry = IdentityEntry {
            key,
            offset: self.position(),
            length,
            crc: identity_crc(self.version, key, record),
        };
        let identity = self.identity.as_mut().ok_or_else(|| bug("it was not begun"))?;
        identity.entries.push(entry);
        self.write(record)
    }

    /// Sorts and checks the index, commits, makes the file durable and gives it its final name. The numbers of
    /// nodes per level in `meta` are filled in here.
    ///
    /// # Errors
    /// [`Error::Io`] if writing fails, [`Error::Store`] if the nodes are not one complete octree, or not those that a
    /// share says it holds, or the metadata is another store's. The final name is untouched then.
    pub fn finish(mut self, mut meta: Meta) -> Result<Stats> {
        self.check_usable()?;
        let bug = |place: String, what: &str| Error::store(&self.final_path, place, what, BUG);
        if meta.file_id() != self.file_id {
            return Err(bug("metadata".into(), "it is not the metadata that the store was begun with"));
        }
        let mut entries = std::mem::take(&mut self.entries);
        entries.sort_unstable_by_key(|entry| entry.key);
        let index = match &meta.share {
            None => Index::new(entries, meta.depth),
            Some(share) => Index::of_share(entries, meta.depth, share),
        };
        let index = index.map_err(|(key, what)| bug(format!("record {key}"), what))?;
        meta.numbers.nodes_per_level = index.nodes_per_level();
        if meta.beads.as_ref().is_some_and(|b| b.identity.is_some()) != self.identity.is_some() {
            return Err(bug("metadata".into(), "it does not say whether beads are told apart"));
        }
        let records_end = self.position();
        if let (Some(beads), Some(identity)) = (&mut meta.beads, self.identity.take()) {
            beads.identity = Some(self.write_identity(identity)?);
        }
        let meta_bytes = meta.encode().map_err(|what| {
            Error::store(&self.final_path, "metadata", what, "give fewer or shorter input paths")
        })?;
        self.commit(&index, &meta_bytes, records_end)?;
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
    fn write_identity(&mut self, mut identity: Identity) -> Result<IdentityPlace> {
        let tables = identity.tables.encode();
        let tables_offset = self.position();
        self.write(&tables)?;
        identity.entries.sort_unstable_by_key(|entry| entry.key);
        let index_offset = self.position();
        let mut index_crc = crc32fast::Hasher::new();
        for entry in &identity.entries {
            let bytes = entry.encode();
            index_crc.update(&bytes);
            self.write(&bytes)?;
        }
        Ok(IdentityPlace {
            tables_offset,
            tables_bytes: tables.len() as u64,
            tables_crc: crc32fast::hash(&tables),
            index_offset,
            index_entries: identity.entries.len() as u64,
            index_crc: index_crc.finalize(),
        })
    }

    /// Writes index and metadata behind the records, makes them durable, then writes the slot that makes them
    /// valid, and makes that durable.
    fn commit(&mut self, index: &Index, meta: &[u8], records_end: u64) -> Result<()> {
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
        self.sync()?;
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
        self.sync()
    }

    /// Gives the file its final name, for good.
    fn publish(&mut self) -> Result<()> {
        std::fs::rename(&self.part_path, &self.final_path)
            .map_err(Error::io(&self.final_path, "rename to"))?;
        self.state = State::Finished;
        let directory = directory_of(&self.final_path);
        let synced = File::open(directory).and_then(|directory| directory.sync_all());
        synced.map_err(Error::io(directory, "make durable"))
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
        let synced = self.write_back.finish().and_then(|()| self.file.sync_data());
        self.or_poison(synced, "make durable")
    }

    fn or_poison(&mut self, result: std::io::Result<()>, action: &'static str) -> Result<()> {
        if result.is_err() {
            self.state = State::Poisoned;
        }
        result.map_err(Error::io(&self.part_path, action))
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
            "make room or choose another place, and start anew",
        ))
    }
}

impl Drop for StoreWriter {
    fn drop(&mut self) {
        // The thread holds the file, and with it the lock. What it met was told, or the store is given up.
        let _ = self.write_back.finish();
        if self.state != State::Finished {
            // Nobody is left to tell; the next writer empties the file.
            let _ = std::fs::remove_file(&self.part_path);
        }
    }
}

fn directory_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
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
    if !directory_of(final_path).is_dir() {
        return refuse("its directory does not exist", "create the directory first");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::testing::meta;
    use super::*;

    #[test]
    fn a_failed_write_poisons_the_writer() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("x.brf");
        let mut writer = StoreWriter::create(&path, &meta(2)).unwrap();
        // A file that is open for reading refuses to be written.
        writer.file = File::open(&writer.part_path).unwrap();
        writer.append_brick(NodeKey::ROOT, true, &Brick::Uniform(0)).unwrap();
        assert!(writer.flush().is_ok(), "a uniform brick writes nothing");
        writer.write(&[1]).unwrap();
        assert!(writer.flush().unwrap_err().to_string().contains("cannot write"));
        let refused = writer.append_brick(NodeKey::ROOT, true, &Brick::Uniform(0)).unwrap_err();
        assert!(refused.to_string().contains("an earlier write failed"));
        assert!(writer.finish(meta(2)).is_err());
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
    }
}
