//! Joining shards: from the files of several machines to the store that one would have built.
//!
//! Subtrees are copied record by record, along the Morton curve; nodes above them are made from their children as in a
//! build, or copied where a build evaluates them. So the bytes are those of a build without shards.

use super::assemble::{Assembler, Opening};
use crate::error::{Error, Result};
use crate::lattice::NodeKey;
use crate::progress::Progress;
use crate::store::{
    BrickTree, BuildCounts, CoarseSamples, Compression, IdentityEntry, IndexEntry, JoinedNode, Meta, Records,
    Shard, Stats, Store, StoreWriter, cell_key, check_target,
};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What to do about shards that do not fit.
const REMEDY: &str =
    "build all shards by the same program from the same input, named alike, with the same settings";

/// What joining shards has made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MergeSummary {
    /// Shards joined.
    pub shards: u32,
    /// Nodes in the tree.
    pub nodes: u64,
    /// Leaves among them.
    pub leaves: u64,
    /// Size of the store.
    pub file_bytes: u64,
}

/// A shard that is open, with what its metadata says of it.
struct Part {
    store: Store,
    shard: Shard,
}

/// Joins all shards of a store, in whatever order they are given, and writes `output`: the bytes that a build without
/// shards gives. Memory holds the index alone.
///
/// # Errors
/// Files that are not shards, do not belong together or are damaged; shards that are missing or given twice; an output
/// that cannot be written. Nothing is left under the final name unless all is joined.
pub fn merge(shards: &[PathBuf], output: &Path, progress: &dyn Progress) -> Result<MergeSummary> {
    check_target(output)?;
    let mut parts: Vec<Part> = shards.iter().map(|path| Part::open(path)).collect::<Result<_>>()?;
    parts.sort_by_key(|part| part.shard.id);
    let Some(first) = parts.first() else {
        return Err(Error::setting("there are no shards", "give all shards of a store"));
    };
    parts.iter().try_for_each(|part| first.require_same_build(part))?;
    require_all(&parts)?;
    // The writer fills in what differs from shard to shard.
    let meta = Meta { shard: None, ..first.store.meta().clone() };
    let records = parts.iter().map(|part| part.store.entries().len() as u64).sum();
    progress.phase("joining", Some(records), "records");
    let mut writer = StoreWriter::create(output, &meta)?.of_files(REMEDY);
    match first.shard.found.joined {
        true => join_subtrees(&parts, &mut writer, progress)?,
        false => copy_decided(&parts, &mut writer, progress)?,
    }
    copy_identity(&parts, &mut writer, progress)?;
    progress.phase("finishing", None, "bytes");
    let Stats { nodes, leaves, file_bytes, .. } = writer.finish(meta)?;
    Ok(MergeSummary { shards: parts.len() as u32, nodes, leaves, file_bytes })
}

impl Part {
    fn open(path: &Path) -> Result<Part> {
        let store = Store::open_any(path, 0)?;
        match store.meta().shard.clone() {
            Some(shard) => Ok(Part { store, shard }),
            None => {
                let remedy = "give the files that `brickfield build --shard I/N` has written";
                Err(Error::store(path, "header", "this is a whole store, not a shard of one", remedy))
            }
        }
    }

    fn mismatch(&self, what: impl ToString, remedy: &str) -> Error {
        Error::store(self.store.path(), format!("shard {}", self.shard.id), what, remedy)
    }

    /// Fails if another shard comes of another input, other settings or another program.
    fn require_same_build(&self, other: &Part) -> Result<()> {
        let (mine, theirs) = (facts(self.store.meta(), &self.shard), facts(other.store.meta(), &other.shard));
        let differ = mine.into_iter().zip(theirs).find(|(a, b)| a != b);
        let Some(((_, mine), (name, theirs))) = differ else { return Ok(()) };
        let path = self.store.path().display();
        Err(other.mismatch(format!("its {name} is {theirs}, that of {path} is {mine}"), REMEDY))
    }

    /// Appends records in post-order.
    fn copy<'a>(
        &self,
        entries: impl Iterator<Item = &'a IndexEntry>,
        writer: &mut StoreWriter,
        progress: &dyn Progress,
    ) -> Result<()> {
        let mut payload = Vec::new();
        for entry in entries {
            progress.check()?;
            self.store.read_payload(entry, &mut payload)?;
            writer.append(entry.key, entry.leaf, entry.head, &payload)?;
            progress.advance(1);
        }
        Ok(())
    }

    /// Entries at the shared cubes and below, in post-order.
    fn subtrees(&self) -> Vec<&IndexEntry> {
        let below = |entry: &&IndexEntry| entry.key.level() >= self.shard.level;
        let mut entries: Vec<&IndexEntry> = self.store.entries().iter().filter(below).collect();
        entries.sort_unstable_by_key(|entry| entry.key.post_order());
        entries
    }

    /// The node of a cube, as its parent sees it.
    fn top_of(&self, cell: u64) -> Result<JoinedNode> {
        let key = cell_key(self.shard.level, cell).unwrap_or(NodeKey::ROOT);
        Ok(JoinedNode::Stored(CoarseSamples::of(&*self.store.brick(key)?)))
    }
}

/// What all shards of a store have in common, by name: what decides them, and what they found.
fn facts(meta: &Meta, shard: &Shard) -> Vec<(String, String)> {
    let mut facts = meta.facts();
    let mut fact = |name: &str, value: String| facts.push((name.to_owned(), value));
    let BuildCounts { facets, degenerate_facets, .. } = meta.numbers;
    fact("number of facets", format!("{facets} ({degenerate_facets} without area)"));
    fact("number of segments", meta.beads.as_ref().map_or(0, |beads| beads.segments).to_string());
    // Toolpaths are swept and filtered by settings that leave no other trace.
    fact("sum over all pieces", format!("{:016x}", shard.found.pieces));
    fact("level of cubes", shard.level.to_string());
    fact("way of building", if shard.found.joined { "from leaves" } else { "from the root" }.to_owned());
    facts
}

/// Fails unless every shard is there once and all together have every cube. They are sorted.
fn require_all(parts: &[Part]) -> Result<()> {
    if let Some(pair) = parts.windows(2).find(|pair| pair[0].shard.id == pair[1].shard.id) {
        let what = format!("{} is the same shard", pair[0].store.path().display());
        return Err(pair[1].mismatch(what, "give every shard once"));
    }
    let Some(first) = parts.first() else { return Ok(()) };
    let of = first.shard.id.of;
    let is_there = |number: &u32| parts.binary_search_by_key(number, |part| part.shard.id.number).is_ok();
    let missing: Vec<u32> = (1..=of).filter(|number| !is_there(number)).collect();
    if !missing.is_empty() {
        let what = format!(
            "of {of} shards {} {} missing",
            list(&missing),
            if missing.len() == 1 { "is" } else { "are" }
        );
        return Err(Error::setting(
            what,
            "build them with the same input and settings, and give all shards at once",
        ));
    }
    let mut next = 0;
    for part in parts {
        if part.shard.cells().start != next {
            return Err(part.mismatch("its cubes do not begin where those of the shard before end", REMEDY));
        }
        next = part.shard.cells().end;
    }
    match parts.last() {
        Some(last) if next != 1 << (3 * u32::from(last.shard.level)) => {
            Err(last.mismatch("its cubes end before the last", REMEDY))
        }
        _ => Ok(()),
    }
}

/// Numbers as a person would name them: "2, 5 to 7 and 9".
fn list(numbers: &[u32]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b).map(|run| match run {
        [first, .., last] if run.len() > 2 => format!("{first} to {last}"),
        _ => run.iter().map(u32::to_string).collect::<Vec<_>>().join(", "),
    });
    let runs: Vec<String> = runs.collect();
    match runs.split_last() {
        Some((last, before)) if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        _ => runs.concat(),
    }
}

/// Copies subtrees, and joins their top nodes to those above.
fn join_subtrees(parts: &[Part], writer: &mut StoreWriter, progress: &dyn Progress) -> Result<()> {
    let Some(Part { shard: Shard { level, .. }, .. }) = parts.first() else { return Ok(()) };
    // Shards are built with it.
    let compression = Some(Compression::Lz4);
    let mut assembler = Assembler::new(None, compression);
    let mut joined = Records::new(compression);
    // Every cube comes, so no corner needs to be known.
    let (corners, coming) = (Arc::default(), 1 << (3 * u32::from(*level)));
    let opening = Opening { key: NodeKey::ROOT, stride: *level, corners, coming, cell: 0 };
    assembler.open(opening, &mut joined);
    for part in parts {
        let entries = part.subtrees();
        let (mut entries, mut empty) = (entries.as_slice(), part.shard.found.empty.iter().peekable());
        for cell in part.shard.cells() {
            let node = match empty.next_if(|(number, _)| *number == cell) {
                Some((_, w)) => JoinedNode::Empty(*w),
                None => {
                    let top = entries.iter().position(|entry| entry.key.level() == *level);
                    let (subtree, rest) = entries.split_at(top.map_or(0, |top| top + 1));
                    entries = rest;
                    part.copy(subtree.iter().copied(), writer, progress)?;
                    part.top_of(cell)?
                }
            };
            assembler.add(node, &mut joined);
        }
    }
    assembler.finish().0.write(writer).map(drop)
}

/// Copies the nodes of a tree that were decided from the root on: subtrees, then those above.
fn copy_decided(parts: &[Part], writer: &mut StoreWriter, progress: &dyn Progress) -> Result<()> {
    for part in parts {
        part.copy(part.subtrees().into_iter(), writer, progress)?;
    }
    let above = |part: &'_ Part| {
        let entries = part.store.entries().iter();
        entries.take_while(|entry| entry.key.level() < part.shard.level).count()
    };
    let of_part = |part| (0..above(part)).map(move |at| (part, &part.store.entries()[at]));
    let mut above: Vec<(&Part, &IndexEntry)> = parts.iter().flat_map(of_part).collect();
    above.sort_unstable_by_key(|(_, entry)| entry.key.post_order());
    above.into_iter().try_for_each(|(part, entry)| part.copy(std::iter::once(entry), writer, progress))
}

/// Copies the lists of beads of what has become a leaf.
fn copy_identity(parts: &[Part], writer: &mut StoreWriter, progress: &dyn Progress) -> Result<()> {
    let Some(first) = parts.first() else { return Ok(()) };
    let Some(tables) = first.store.bead_tables()? else { return Ok(()) };
    let nodes = writer.nodes();
    for part in parts {
        if part.store.bead_tables()?.as_ref() != Some(&tables) {
            let path = first.store.path().display();
            return Err(part.mismatch(format!("its tables of beads are not those of {path}"), REMEDY));
        }
    }
    writer.begin_identity(tables);
    for part in parts {
        let is_leaf = |key: NodeKey| nodes.binary_search(&(key, true)).is_ok();
        let entries = part.store.identity_entries().iter().filter(|entry| is_leaf(entry.key));
        let mut entries: Vec<&IdentityEntry> = entries.collect();
        // Leaves do not overlap, so this is their order along the Morton curve.
        entries.sort_unstable_by_key(|entry| entry.key.post_order());
        for entry in entries {
            progress.check()?;
            writer.append_identity(entry.key, &part.store.read_identity(entry)?)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::list;

    #[test]
    fn numbers_are_listed_in_runs() {
        assert_eq!(list(&[4]), "4");
        assert_eq!(list(&[1, 2]), "1, 2");
        assert_eq!(list(&[2, 5, 6, 7, 9]), "2, 5 to 7 and 9");
        assert_eq!(list(&[1, 3]), "1 and 3");
    }
}
