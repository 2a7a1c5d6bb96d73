//! Opens a store and answers from it, without trusting a number in it.

use super::cache::{BrickCache, CacheStats};
use super::commit::{Commit, read_commit};
use super::fault::REBUILD;
use super::identity::{BeadSegment, BeadTables, IdentityEntry, IdentityPlace, decode_segments, identity_crc};
use super::index::Index;
use super::journal::{Journal, journal_of_part};
use super::layout::{
    HEADER_BYTES, IndexEntry, MAGIC, PAGE_BYTES, SLOT_BYTES, SLOT_OFFSETS, Slot, Version, record_crc,
};
use super::meta::Meta;
use super::prefetch::{Merging, Prefetch};
use super::ranges::{ByteRanges, RangeFault};
use super::source::{ByteSource, Io};
use super::{BrickTree, NodeInfo};
use crate::brick::Brick;
use crate::brick::codec::{Scratch, decode};
use crate::disk::planted::{Bug, planted};
use crate::error::{Error, Result};
use crate::lattice::{NodeKey, RootCube};
use crate::mmap::begins_with;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A store open for reading. Any number of threads may read at once.
pub struct Store {
    path: PathBuf,
    source: ByteSource,
    version: Version,
    meta: Meta,
    index: Index,
    /// Which beads leaves count, in key order.
    identity: Vec<IdentityEntry>,
    /// Where what the commit names ends.
    end: u64,
    unfinished: bool,
    cache: BrickCache<Brick>,
    ahead: Prefetch,
}

thread_local! {
    /// A record's payload, and what its decoding takes.
    static BUFFERS: RefCell<(Vec<u8>, Scratch)> = RefCell::new((Vec::new(), Scratch::new()));
}

/// What may be opened as a store.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum AcceptedStores {
    /// Whole stores: complete trees.
    #[default]
    Whole,
    /// Shards of stores too; see [`Meta::shard`].
    Shards,
    /// Shards, and stores and shards whose building has not ended; see [`Store::is_unfinished`].
    Unfinished,
}

/// How to open a store.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StoreOptions {
    /// Memory for decoded bricks.
    pub cache_bytes: u64,
    /// How to read.
    pub io: Io,
    /// What to open.
    pub accept: AcceptedStores,
}

/// Whether a file begins as a store does, finished or not.
pub fn is_store(path: &Path) -> bool {
    begins_with(path, &MAGIC)
}

/// BLAKE3 of some bytes, as sources of stores have it.
pub fn hash_of(bytes: &[u8]) -> [u8; 32] {
    *blake3::hash(bytes).as_bytes()
}

impl Store {
    /// Opens a finished store, a whole one. Decoded bricks are kept in at most `cache_bytes` of memory. Header, index
    /// and metadata are checked as a whole; records when they are read.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::Store`] if it is not a sound store of this version, or one
    /// shard of a store, which is no complete tree.
    pub fn open(path: &Path, cache_bytes: u64) -> Result<Store> {
        Store::open_with(path, StoreOptions { cache_bytes, ..StoreOptions::default() })
    }

    /// As [`Store::open`], but opens a shard of a store as well; see [`Meta::shard`].
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open_any(path: &Path, cache_bytes: u64) -> Result<Store> {
        Store::open_with(
            path,
            StoreOptions { cache_bytes, accept: AcceptedStores::Shards, ..StoreOptions::default() },
        )
    }

    /// Opens what the options ask for, in the way that they ask for.
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open_with(path: &Path, options: StoreOptions) -> Result<Store> {
        let StoreOptions { cache_bytes, io, accept } = options;
        let store =
            Store::of_source(
                path,
                ByteSource::open(path, io)?,
                cache_bytes,
                &|journal| match ByteSource::open(journal, Io::Pread) {
                    Ok(source) => source.part(0, source.bytes()).ok(),
                    Err(_) => None,
                },
            )?;
        store.accepted(accept)
    }

    /// Opens a store that lies elsewhere. `path` is how messages name it. Ranges that are read ahead come several at once;
    /// what is held of them is bounded, see [`Store::source_bytes`].
    ///
    /// The answers are those of the same file here: what comes is compared with the checksums of the store.
    ///
    /// # Errors
    /// As [`Store::open`]; [`Error::Store`] with the words of a [`RangeFault`] where bytes do not come. Nothing is read any
    /// more then.
    pub fn open_ranges(path: &Path, ranges: Arc<dyn ByteRanges>, options: StoreOptions) -> Result<Store> {
        let StoreOptions { cache_bytes, accept, .. } = options;
        let source = ByteSource::elsewhere(ranges);
        Store::of_source(path, source, cache_bytes, &|_| None)?.accepted(accept)
    }

    fn accepted(self, accept: AcceptedStores) -> Result<Store> {
        let (store, path) = (&self, &self.path);
        if store.unfinished && accept < AcceptedStores::Unfinished {
            let what = format!("this is an unfinished store, with {} nodes so far", store.entries().len());
            return Err(Error::store(
                path,
                "journal",
                what,
                "give the command that builds it again: it goes on",
            ));
        }
        match &store.meta.shard {
            Some(shard) if accept < AcceptedStores::Shards => {
                let what = format!("this is shard {} of a store", shard.id);
                let remedy = "join all shards with `brickfield cache merge`";
                Err(Error::store(path, "header", what, remedy))
            }
            _ => Ok(self),
        }
    }

    /// A store of these bytes; `journal` reads the file of that name, if there is one.
    pub(super) fn of_source(
        path: &Path,
        source: ByteSource,
        cache_bytes: u64,
        journal: &dyn Fn(&Path) -> Option<Vec<u8>>,
    ) -> Result<Store> {
        let of_journal = || Journal::decode(&journal(&journal_of_part(path)?)?);
        let commit = read_commit(&source, &of_journal);
        let Commit { version, meta, index, identity, end, unfinished } = commit.map_err(|fault| {
            let remedy = source.fault().map_or(&fault.remedy, |fault| &fault.remedy);
            Error::store(path, fault.place, fault.what, remedy)
        })?;
        let (cache, ahead) = (BrickCache::new(cache_bytes), Prefetch::default());
        let path = path.to_owned();
        Ok(Store { path, source, version, meta, index, identity, end, unfinished, cache, ahead })
    }

    /// Whether the building of the store has not ended. It has the subtrees that were committed when it was opened, each
    /// of them complete; nodes above them, tables and lists of beads may be missing.
    pub fn is_unfinished(&self) -> bool {
        self.unfinished
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Size of the file in bytes.
    pub fn file_bytes(&self) -> u64 {
        self.source.bytes()
    }

    /// BLAKE3 of the file.
    ///
    /// # Errors
    /// [`Error::Store`] if it cannot be read.
    pub fn hash(&self) -> Result<[u8; 32]> {
        const AT_ONCE: u64 = 1 << 20;
        let (mut hasher, mut at) = (blake3::Hasher::new(), 0);
        while at < self.file_bytes() {
            let bytes = AT_ONCE.min(self.file_bytes() - at);
            self.source.ahead(at, 8 * AT_ONCE);
            let part = self.source.part(at, bytes);
            hasher.update(&part.map_err(|what| self.read_error(format!("byte {at}"), what))?);
            at += bytes;
        }
        Ok(*hasher.finalize().as_bytes())
    }

    /// Bytes that the index takes in memory.
    pub fn index_bytes(&self) -> u64 {
        (size_of_val(self.index.entries()) + size_of_val(&self.identity[..])) as u64
    }

    /// Memory that bytes of a store elsewhere take at most; 0 of a file.
    pub fn source_bytes(&self) -> u64 {
        self.source.bytes_held()
    }

    /// Requests that were made for a store elsewhere so far, and bytes that came.
    pub fn requests(&self) -> Option<(u64, u64)> {
        Some(self.source.pieces()?.requests())
    }

    /// The store as messages shall name it: a temporary one by what it was made of.
    #[must_use]
    pub fn named(self, path: &Path) -> Store {
        Store { path: path.to_owned(), ..self }
    }

    /// The store with another bound on decoded bricks, of which none is kept yet.
    #[must_use]
    pub fn with_cache(self, cache_bytes: u64) -> Store {
        Store { cache: BrickCache::new(cache_bytes), ..self }
    }

    /// Where the store came from and how it was made.
    pub fn meta(&self) -> &Meta {
        &self.meta
    }

    /// What the index holds of a node.
    pub fn entry(&self, key: NodeKey) -> Option<&IndexEntry> {
        self.index.get(key)
    }

    /// All index entries in key order.
    pub fn entries(&self) -> &[IndexEntry] {
        self.index.entries()
    }

    /// The payload of one of the store's entries as stored, its checksum compared, for tools that copy records.
    ///
    /// # Errors
    /// [`Error::Store`] if the record is damaged.
    pub fn read_payload(&self, entry: &IndexEntry, bytes: &mut Vec<u8>) -> Result<()> {
        self.copy_record(entry, bytes).map_err(|what| self.record_error(entry.key, what))
    }

    /// The brick of a payload that [`Store::read_payload`] has given, for tools that need both.
    ///
    /// # Errors
    /// [`Error::Store`] if the record is damaged.
    pub fn decode(&self, entry: &IndexEntry, payload: &[u8], scratch: &mut Scratch) -> Result<Brick> {
        let brick = decode(entry.head.kind, entry.head.min, payload, scratch);
        brick.map_err(|what| self.record_error(entry.key, what))
    }

    /// The list of one of the store's entries of beads as stored, its checksum compared.
    ///
    /// # Errors
    /// [`Error::Store`] if the list is damaged.
    pub fn read_identity(&self, entry: &IdentityEntry) -> Result<Vec<u8>> {
        self.copy_identity(entry).map_err(|what| self.read_error(format!("identity {}", entry.key), what))
    }

    /// The beads of the store, if it tells them apart; reads and checks their tables.
    ///
    /// # Errors
    /// [`Error::Store`] if the tables are damaged.
    pub fn bead_tables(&self) -> Result<Option<BeadTables>> {
        let Some(place) = self.identity_place() else { return Ok(None) };
        let damaged = |what: &str| self.read_error("tables of beads", what);
        let bytes =
            self.source.part(place.tables_offset, place.tables_bytes).map_err(|what| damaged(&what))?;
        if crc32fast::hash(&bytes) != place.tables_crc {
            return Err(damaged("the checksum differs"));
        }
        let (count, beads) =
            self.meta.beads.as_ref().map_or_else(Default::default, |beads| (beads.count(), beads.beads));
        let tables = BeadTables::decode(&bytes, count).map_err(damaged)?;
        if tables.beads.len() as u64 != beads {
            return Err(damaged("their number is not that of the metadata"));
        }
        Ok(Some(tables))
    }

    /// The segments of beads that touch a leaf, pass by pass or bead by bead; none where the store does not tell beads apart.
    /// `tables` are the store's own.
    ///
    /// # Errors
    /// [`Error::Store`] if the record is damaged.
    pub fn segments(&self, key: NodeKey, tables: &BeadTables) -> Result<Vec<BeadSegment>> {
        let Ok(at) = self.identity.binary_search_by_key(&key, |entry| entry.key) else {
            return Ok(Vec::new());
        };
        self.load_segments(&self.identity[at], tables)
            .map_err(|what| self.read_error(format!("identity {key}"), what))
    }

    /// Where leaves say which beads they count, in key order.
    pub fn identity_entries(&self) -> &[IdentityEntry] {
        &self.identity
    }

    fn identity_place(&self) -> Option<&IdentityPlace> {
        self.meta.beads.as_ref()?.identity.as_ref()
    }

    /// The error is one phrase.
    pub(super) fn load_segments(
        &self,
        entry: &IdentityEntry,
        tables: &BeadTables,
    ) -> std::result::Result<Vec<BeadSegment>, String> {
        let bytes = self.copy_identity(entry)?;
        let counts = (tables.counted(), tables.sections.len() as u64);
        decode_segments(&bytes, counts, tables.count()).map_err(str::to_owned)
    }

    /// The error is one phrase.
    fn copy_identity(&self, entry: &IdentityEntry) -> std::result::Result<Vec<u8>, String> {
        let bytes = self.source.part(entry.offset, u64::from(entry.length))?;
        let sound = identity_crc(self.version, entry.key, &bytes) == entry.crc;
        if sound { Ok(bytes) } else { Err("the checksum differs".to_owned()) }
    }

    /// What the cache of decoded bricks has done and holds, and what was read ahead. Uniform bricks take no part in it.
    pub fn cache_stats(&self) -> CacheStats {
        self.ahead.add_to(self.cache.stats())
    }

    pub(super) fn index(&self) -> &Index {
        &self.index
    }

    /// Reads, verifies and decodes a record, past the cache. The error is one phrase.
    pub(super) fn load(&self, entry: &IndexEntry) -> std::result::Result<Brick, String> {
        BUFFERS.with_borrow_mut(|(bytes, scratch)| {
            self.copy_record(entry, bytes)?;
            decode(entry.head.kind, entry.head.min, bytes, scratch).map_err(|error| error.to_string())
        })
    }

    /// Copies a record's payload into `bytes` and verifies the copy: the file may change between the checksum and the
    /// decoder. The error is one phrase.
    fn copy_record(&self, entry: &IndexEntry, bytes: &mut Vec<u8>) -> std::result::Result<(), String> {
        self.ahead.reading(entry.key);
        self.source.read(entry.offset, u64::from(entry.length), bytes)?;
        let sound = record_crc(self.version, entry.key, entry.leaf, entry.head, bytes) == entry.crc;
        let counts = sound || planted(Bug::RecordChecksumIgnored);
        counts.then_some(()).ok_or_else(|| "the checksum differs".to_owned())
    }

    /// Changes a byte of a store in memory.
    #[cfg(test)]
    pub(super) fn poke(&mut self, at: usize, byte: u8) {
        if let ByteSource::Memory(bytes) = &mut self.source {
            bytes[at] = byte;
        }
    }

    /// Bytes of the file that no commit and no record explains, as phrases with their places.
    pub(super) fn strays(&self) -> std::result::Result<Vec<(u64, String)>, String> {
        let mut strays = Vec::new();
        let header = self.source.part(0, HEADER_BYTES as u64)?;
        for (which, offset) in SLOT_OFFSETS.into_iter().enumerate() {
            let page = &header[offset..][..PAGE_BYTES];
            // An empty slot is all zero; one that holds a commit only behind it.
            let from = if Slot::decode(page, which).is_some() { SLOT_BYTES } else { 0 };
            if let Some(at) = page[from..].iter().position(|&byte| byte != 0) {
                strays.push(((offset + from + at) as u64, format!("slot page {which} is not zero here")));
            }
        }
        let behind = self.file_bytes().saturating_sub(self.end);
        if behind > 0 && !self.unfinished {
            strays.push((self.end, format!("{behind} bytes stand behind all that the commit names")));
        }
        Ok(strays)
    }

    fn entry_of(&self, key: NodeKey) -> Result<&IndexEntry> {
        let (place, what) = (|| format!("record {key}"), "the store has no such node");
        let missing = || Error::store(&self.path, place(), what, "ask for another one");
        self.index.get(key).ok_or_else(missing)
    }

    fn record_error(&self, key: NodeKey, what: impl ToString) -> Error {
        self.read_error(format!("record {key}"), what)
    }

    /// What is read is not sound, or does not come.
    fn read_error(&self, place: impl ToString, what: impl ToString) -> Error {
        let remedy = self.source.fault().map_or(REBUILD, |fault| &fault.remedy);
        Error::store(&self.path, place, what, remedy)
    }

    /// The error of a store whose bytes do not come any more, for who counts damage and goes on.
    pub(super) fn fault(&self) -> Result<()> {
        match self.source.fault() {
            Some(RangeFault { what, remedy, .. }) => Err(Error::store(&self.path, "records", what, remedy)),
            None => Ok(()),
        }
    }

    /// As [`Store::load`], and puts the brick into the cache. What that lets go of is the memory of the thread's next brick:
    /// given back, it would wait in the allocator for the thread that once took it, and where first one thread reads most
    /// bricks and then another, the program would hold up to twice the cache (`slice` of 1.5 million nodes by two threads with
    /// a cache of 124 MiB: 279 MiB, and 206 where the allocator had one arena for both).
    pub(super) fn load_into_cache(&self, entry: &IndexEntry) -> std::result::Result<Arc<Brick>, String> {
        let brick = Arc::new(self.load(entry)?);
        if !entry.head.kind.is_uniform() {
            let evicted = self.cache.insert(entry.key, &brick, brick.heap_bytes());
            if let Some(brick) = evicted.into_iter().find_map(Arc::into_inner) {
                BUFFERS.with_borrow_mut(|(_, scratch)| scratch.reuse(brick));
            }
        }
        Ok(brick)
    }

    /// The brick from the cache or the file. The error is one phrase.
    pub(super) fn cached(&self, entry: &IndexEntry) -> std::result::Result<Arc<Brick>, String> {
        if entry.head.kind.is_uniform() {
            return Ok(Arc::new(Brick::Uniform(entry.head.min)));
        }
        match self.cache.get(entry.key) {
            Some(brick) => Ok(brick),
            None => self.load_into_cache(entry),
        }
    }
}

impl BrickTree for Store {
    fn root(&self) -> RootCube {
        self.meta.root
    }

    fn node(&self, key: NodeKey) -> Option<NodeInfo> {
        let entry = self.index.get(key)?;
        let head = entry.head;
        let fractions = head.kind.has_fractions();
        Some(NodeInfo { leaf: entry.leaf, min: head.min, max: head.max, fractions })
    }

    fn keys(&self) -> Vec<NodeKey> {
        self.index.entries().iter().map(|entry| entry.key).collect()
    }

    fn deepest_level(&self) -> u8 {
        self.index.entries().last().map_or(0, |entry| entry.key.level())
    }

    fn brick(&self, key: NodeKey) -> Result<Arc<Brick>> {
        self.cached(self.entry_of(key)?).map_err(|what| self.record_error(key, what))
    }

    fn ahead(&self, keys: &[NodeKey]) -> usize {
        let wanted = |key: &NodeKey| self.index.get(*key).filter(|_| !self.cache.holds(*key));
        let merging = if self.is_elsewhere() { Merging::Part } else { Merging::Gap };
        self.ahead.tell(keys.iter().map(wanted), merging, |offset, bytes| self.source.ahead(offset, bytes))
    }

    fn is_elsewhere(&self) -> bool {
        self.source.pieces().is_some()
    }

    fn brick_once(&self, key: NodeKey) -> Result<Arc<Brick>> {
        let entry = self.entry_of(key)?;
        let kept = self.cache.get(key).map_or_else(|| self.load(entry).map(Arc::new), Ok);
        kept.map_err(|what| self.record_error(key, what))
    }
}
