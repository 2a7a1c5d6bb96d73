//! The lists of beads of a store that is written anew.

use crate::error::Result;
use crate::lattice::NodeKey;
use crate::progress::Progress;
use crate::store::{BeadSegment, BeadTables, IdentityEntry, Store, StoreWriter, encode_segments};
use std::collections::HashSet;

/// Copies the lists, those of leaves that one node replaces joined to its own: what touches a node touches what is below
/// it.
pub(super) fn copy_lists(
    store: &Store,
    leaf_over: impl Fn(NodeKey) -> NodeKey,
    writer: &mut StoreWriter,
    progress: &dyn Progress,
) -> Result<()> {
    let Some(tables) = store.bead_tables()? else { return Ok(()) };
    writer.begin_identity(tables.clone());
    let lists = store.identity_entries().iter().map(|list| (leaf_over(list.key), list));
    let mut lists: Vec<(NodeKey, &IdentityEntry)> = lists.collect();
    // Leaves do not overlap, so this is their order along the Morton curve.
    lists.sort_unstable_by_key(|(leaf, list)| (leaf.post_order(), list.key.post_order()));
    for lists in lists.chunk_by(|a, b| a.0 == b.0) {
        progress.check()?;
        let record = match lists {
            [(leaf, list)] if *leaf == list.key => store.read_identity(list)?,
            _ => joined(store, &tables, lists)?,
        };
        writer.append_identity(lists[0].0, &record)?;
    }
    Ok(())
}

/// One list of all segments, each once: pass by pass, those of a pass in the order in which the leaves along the Morton
/// curve name them.
fn joined(store: &Store, tables: &BeadTables, lists: &[(NodeKey, &IdentityEntry)]) -> Result<Vec<u8>> {
    let mut seen = HashSet::new();
    let mut all: Vec<BeadSegment> = Vec::new();
    for (_, list) in lists {
        let segments = store.segments(list.key, tables)?;
        all.extend(segments.into_iter().filter(|s| seen.insert((s.a, s.b, s.section, s.pass, s.line))));
    }
    all.sort_by_key(|segment| segment.pass);
    let mut record = Vec::new();
    encode_segments(&all, tables.count(), &mut record);
    Ok(record)
}
