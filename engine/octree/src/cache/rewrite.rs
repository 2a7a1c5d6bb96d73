//! A store written anew, in the order of a build and without gaps.

use super::boundary::boundary;
use super::lists::copy_lists;
use crate::brick::{Brick, Hermite};
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::store::{
    BrickTree, Compression, IndexEntry, Meta, PayloadHead, Scratch, Stats, Store, StoreWriter, Walk,
    build_order, encode_with,
};
use serde::Serialize;
use std::path::Path;

/// Records that a thread takes at once: some 200 KB of typical surface bricks, 3 MB where they are not compressed.
const RECORDS_AT_ONCE: usize = 32;
/// What to do about records that do not fit together.
const REMEDY: &str = "check the store with `brickfield verify`; restore it from a copy or build it again";

/// How payloads stand in a file. Readers do not mind; it decides how far from each other those lie that are read together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RecordOrder {
    /// As a build appends them: subtree by subtree, so that leaves which are neighbours lie near each other.
    #[default]
    Build,
    /// Level by level, coarse ones first, along the Morton curve within a level: a coarse picture needs a small part at the
    /// beginning of the file.
    Level,
}

/// What a store was and has become.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct RewriteSummary {
    /// Nodes in the tree that was read.
    pub nodes_before: u64,
    /// Size of the file that was read.
    pub file_bytes_before: u64,
    /// Nodes in the tree that was written.
    pub nodes: u64,
    /// Leaves among them.
    pub leaves: u64,
    /// Interior nodes that have become leaves.
    pub collapsed: u64,
    /// Size of the file that was written.
    pub file_bytes: u64,
}

/// Writes `store` to `output` without gaps and in the order of a build. Records stay as they are; a store that `build`
/// has written comes out with the same bytes.
///
/// # Errors
/// Records that are damaged; an output that cannot be written, under whose name nothing is left then;
/// [`crate::error::Error::Interrupted`].
pub fn compact(store: &Store, output: &Path, progress: &dyn Progress) -> Result<RewriteSummary> {
    reorder(store, output, RecordOrder::Build, None, progress)
}

/// Writes `store` to `output` without gaps, its payloads in another order and, if asked for, compressed in another way. The
/// bricks are the same.
///
/// # Errors
/// As [`compact`].
pub fn reorder(
    store: &Store,
    output: &Path,
    order: RecordOrder,
    compression: Option<Compression>,
    progress: &dyn Progress,
) -> Result<RewriteSummary> {
    let meta = store.meta().clone();
    Rewrite { store, meta, cut: Vec::new(), compression, order }.run(output, progress)
}

/// Writes `store` to `output` as [`compact`] does, with every payload compressed in the way asked for. The bricks are the
/// same; [`Compression::Lz4`] gives the bytes of a build by this program, from any other.
///
/// # Errors
/// As [`compact`].
pub fn repack(
    store: &Store,
    output: &Path,
    compression: Compression,
    progress: &dyn Progress,
) -> Result<RewriteSummary> {
    reorder(store, output, RecordOrder::Build, Some(compression), progress)
}

/// How a store is written anew.
pub(super) struct Rewrite<'a> {
    pub store: &'a Store,
    /// The metadata to write.
    pub meta: Meta,
    /// Interior nodes that become leaves, in key order; none lies below another.
    pub cut: Vec<NodeKey>,
    /// How payloads are compressed; `None` if they are copied.
    pub compression: Option<Compression>,
    /// How payloads stand in the file.
    pub order: RecordOrder,
}

/// Records that a thread has made.
#[derive(Default)]
struct RewrittenRecords {
    /// Key, leaf or not, head and end of the payload in `bytes`.
    nodes: Vec<(NodeKey, bool, PayloadHead, usize)>,
    bytes: Vec<u8>,
}

/// What a thread works with.
#[derive(Default)]
struct RewriteScratch {
    scratch: Scratch,
    payload: Vec<u8>,
}

impl Rewrite<'_> {
    pub fn run(self, output: &Path, progress: &dyn Progress) -> Result<RewriteSummary> {
        let store = self.store;
        let mut writer = StoreWriter::create(output, &self.meta)?.of_files(REMEDY);
        let kept = store.entries().iter().filter(|entry| !self.is_below_cut(entry.key));
        let ordered = match self.order {
            RecordOrder::Build => build_order(kept, self.meta.subtree_level()),
            // Entries are in key order.
            RecordOrder::Level => kept.collect(),
        };
        progress.phase("rewriting", Some(ordered.len() as u64), "records");
        let chunks: Vec<&[&IndexEntry]> = ordered.chunks(RECORDS_AT_ONCE).collect();
        let walk = Walk::new(store, ordered.len(), |number| Some(ordered[number].key));
        let make = |desk: &mut RewriteScratch, number: usize| {
            walk.at(number * RECORDS_AT_ONCE);
            let mut made = RewrittenRecords::default();
            for entry in chunks[number] {
                progress.check()?;
                self.make(entry, desk, &mut made)?;
            }
            Ok(made)
        };
        let window = 2 * rayon::current_num_threads();
        run_ordered(chunks.len(), window, RewriteScratch::default, make, |made: RewrittenRecords| {
            let mut from = 0;
            for &(key, leaf, head, end) in &made.nodes {
                writer.append(key, leaf, head, &made.bytes[from..end])?;
                from = end;
            }
            progress.advance(made.nodes.len() as u64);
            Ok(())
        })?;
        copy_lists(store, |key| self.leaf_over(key), &mut writer, progress)?;
        progress.phase("finishing", None, "bytes");
        let collapsed = self.cut.len() as u64;
        let Stats { nodes, leaves, file_bytes, .. } = writer.finish(self.meta)?;
        Ok(RewriteSummary {
            nodes_before: store.entries().len() as u64,
            file_bytes_before: store.file_bytes(),
            nodes,
            leaves,
            collapsed,
            file_bytes,
        })
    }

    /// Adds the record of a node as it will be.
    fn make(&self, entry: &IndexEntry, desk: &mut RewriteScratch, made: &mut RewrittenRecords) -> Result<()> {
        let RewriteScratch { scratch, payload } = desk;
        let is_cut = self.cut.binary_search(&entry.key).is_ok();
        let head = if !is_cut && self.compression.is_none() {
            self.store.read_payload(entry, payload)?;
            made.bytes.extend_from_slice(payload);
            entry.head
        } else {
            let brick = self.store.brick(entry.key)?;
            let as_it_was =
                if entry.head.kind.is_range_coded() { Compression::Range } else { Compression::Lz4 };
            let compression = self.compression.unwrap_or(as_it_was);
            match is_cut.then(|| boundary(self.store, entry.key)).flatten().transpose()? {
                Some((_, hermite)) => {
                    encode_with(&with_hermite(&brick, hermite), compression, scratch, &mut made.bytes)
                }
                None => encode_with(&brick, compression, scratch, &mut made.bytes),
            }
        };
        made.nodes.push((entry.key, entry.leaf || is_cut, head, made.bytes.len()));
        Ok(())
    }

    /// Whether a node goes with the one that becomes a leaf above it.
    fn is_below_cut(&self, key: NodeKey) -> bool {
        self.leaf_over(key) != key
    }

    /// The node that holds what the leaf `key` held: the one above it that becomes a leaf, or itself.
    fn leaf_over(&self, key: NodeKey) -> NodeKey {
        let mut above = (0..key.level()).filter_map(|level| key.ancestor(level));
        above.find(|ancestor| self.cut.binary_search(ancestor).is_ok()).unwrap_or(key)
    }
}

/// The samples of a brick with other Hermite edges.
fn with_hermite(brick: &Brick, hermite: Hermite) -> Brick {
    match brick {
        Brick::Uniform(w) => Brick::Uniform(*w),
        Brick::Counts { samples, .. } => Brick::Counts { samples: samples.clone(), hermite },
    }
}
