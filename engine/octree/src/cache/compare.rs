//! The differences of two stores: of what they say of themselves, of their trees, and of what their bricks hold.

use crate::brick::{Brick, Hermite, SignChanges};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_POINTS, NodeKey, Units};
use crate::progress::Progress;
use crate::store::{BeadTables, IndexEntry, Scratch, Store};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeSet;

/// Differences that are named one by one.
const NAMED_MAX: usize = 10;
/// Nodes that a thread takes at once.
const NODES_AT_ONCE: usize = 64;

/// What [`compare`] found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Comparison {
    /// Where the metadata differ, but for numbers of nodes and places in the file.
    pub metadata: Vec<MetaDifference>,
    /// Whether the lattices lie in the same place of the world; if not, nodes are not compared.
    pub same_lattice: bool,
    /// Nodes in both.
    pub common: u64,
    /// Nodes in the first only.
    pub only_first: u64,
    /// Nodes in the second only.
    pub only_second: u64,
    /// Nodes that are a leaf in one of them and divided in the other.
    pub leaf_in_one: u64,
    /// What the bricks of common nodes hold.
    #[serde(flatten)]
    pub bricks: BrickDifferences,
    /// Leaves whose lists of beads differ, or that have one in one of the stores only; the tables of beads count as one.
    pub lists: u64,
    /// The first differences of nodes, by key.
    pub first: Vec<Difference>,
}

/// Something that two stores say differently of themselves.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MetaDifference {
    /// What it is about, as in "depth".
    pub name: String,
    /// What the first store says, if it says anything.
    pub first: Option<String>,
    /// What the second says.
    pub second: Option<String>,
}

/// How bricks of the same nodes differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct BrickDifferences {
    /// Bricks with samples that differ.
    pub bricks: u64,
    /// Those samples, aprons included.
    pub samples: u64,
    /// The largest difference of two winding numbers.
    pub max_difference: f64,
    /// Samples that are inside, w ≥ 0.5, in one of the stores only.
    pub signs: u64,
    /// Leaves of both stores with equal signs and other Hermite edges.
    pub hermite_bricks: u64,
    /// Hermite edges that differ there.
    pub hermite_edges: u64,
    /// Of them those whose crossing stands elsewhere.
    pub moved_edges: u64,
    /// The farthest of those, as a fraction of the edge.
    pub max_move: f64,
    /// Of them those with another normal.
    pub turned_edges: u64,
}

/// A node that differs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// The node, as in "L2(1,0,3)".
    pub node: String,
    /// What differs, one phrase.
    pub what: String,
    #[serde(skip)]
    key: u64,
}

impl Comparison {
    /// Whether nothing differs but how the records are compressed and where they lie. `metadata` asks for that of the
    /// metadata, too.
    pub fn is_equal(&self, metadata: bool) -> bool {
        let BrickDifferences { bricks, hermite_bricks, .. } = self.bricks;
        let nodes = [self.only_first, self.only_second, self.leaf_in_one, bricks, hermite_bricks, self.lists];
        self.same_lattice && nodes == [0; 6] && (!metadata || self.metadata.is_empty())
    }
}

/// Compares two stores, reading both record by record. Records with the same bytes are not decoded.
///
/// # Errors
/// Records that are damaged; [`crate::error::Error::Interrupted`].
pub fn compare(first: &Store, second: &Store, progress: &dyn Progress) -> Result<Comparison> {
    let metadata = facts_that_differ(first, second);
    let same_lattice = first.meta().root == second.meta().root;
    if !same_lattice {
        return Ok(Comparison { metadata, ..Comparison::default() });
    }
    let pairs = pairs(first.entries(), second.entries(), |entry| entry.key);
    progress.phase("comparing", Some(pairs.len() as u64), "nodes");
    let found = pairs
        .par_chunks(NODES_AT_ONCE)
        .map(|chunk| {
            let (mut found, mut desk) = (Comparison::default(), CompareScratch::default());
            for pair in chunk {
                progress.check()?;
                found.take(first, second, *pair, &mut desk)?;
            }
            progress.advance(chunk.len() as u64);
            Ok(found)
        })
        .try_reduce(Comparison::default, |a, b| Ok(a.and(b)))?;
    let mut all = found.and(lists(first, second, progress)?);
    all.metadata = metadata;
    all.same_lattice = true;
    Ok(all)
}

/// Facts of the same name next to each other, those that differ.
fn facts_that_differ(first: &Store, second: &Store) -> Vec<MetaDifference> {
    let (mine, theirs) = (first.meta().facts(), second.meta().facts());
    let value_in = |facts: &[(String, String)], name: &str| {
        facts.iter().find(|(other, _)| other == name).map(|(_, value)| value.clone())
    };
    let absent_here = theirs.iter().filter(|(name, _)| value_in(&mine, name).is_none());
    let names = mine.iter().chain(absent_here).map(|(name, _)| name);
    let both = |name: &String| MetaDifference {
        name: name.clone(),
        first: value_in(&mine, name),
        second: value_in(&theirs, name),
    };
    let mut differ: Vec<MetaDifference> = names.map(both).filter(|fact| fact.first != fact.second).collect();
    let shard = |store: &Store| store.meta().shard.as_ref().map(|shard| shard.id.to_string());
    if shard(first) != shard(second) {
        differ.push(MetaDifference { name: "shard".to_owned(), first: shard(first), second: shard(second) });
    }
    differ
}

/// A node's entries in the two stores, of which one may lack it.
type EntryPair<'a, T> = (Option<&'a T>, Option<&'a T>);

/// All nodes of either, in key order.
fn pairs<'a, T>(first: &'a [T], second: &'a [T], key: impl Fn(&T) -> NodeKey) -> Vec<EntryPair<'a, T>> {
    let (mut first, mut second) = (first.iter().peekable(), second.iter().peekable());
    let mut pairs = Vec::new();
    while let Some(next) = [first.peek(), second.peek()].into_iter().flatten().map(|&entry| key(entry)).min()
    {
        pairs.push((first.next_if(|&entry| key(entry) == next), second.next_if(|&entry| key(entry) == next)));
    }
    pairs
}

impl Comparison {
    /// Of this and what comes behind it, by node.
    fn and(mut self, other: Comparison) -> Comparison {
        self.common += other.common;
        self.only_first += other.only_first;
        self.only_second += other.only_second;
        self.leaf_in_one += other.leaf_in_one;
        self.bricks = self.bricks.and(other.bricks);
        self.lists += other.lists;
        self.first.extend(other.first);
        self.first.sort_by_key(|difference| difference.key);
        self.first.truncate(NAMED_MAX);
        self
    }

    fn name(&mut self, key: NodeKey, what: String) {
        if self.first.len() < NAMED_MAX {
            self.first.push(Difference { node: key.to_string(), what, key: key.code() });
        }
    }

    fn take(
        &mut self,
        first: &Store,
        second: &Store,
        pair: EntryPair<'_, IndexEntry>,
        desk: &mut CompareScratch,
    ) -> Result<()> {
        let (a, b) = match pair {
            (Some(a), Some(b)) => (a, b),
            (Some(a), None) => {
                self.only_first += 1;
                self.name(a.key, "only the first store has it".to_owned());
                return Ok(());
            }
            (None, Some(b)) => {
                self.only_second += 1;
                self.name(b.key, "only the second store has it".to_owned());
                return Ok(());
            }
            (None, None) => return Ok(()),
        };
        self.common += 1;
        if a.leaf != b.leaf {
            self.leaf_in_one += 1;
            let (leaf, divided) = if a.leaf { ("first", "second") } else { ("second", "first") };
            self.name(a.key, format!("it is a leaf in the {leaf} store and divided in the {divided}"));
        }
        let CompareScratch { mine, theirs, scratch } = desk;
        first.read_payload(a, mine)?;
        second.read_payload(b, theirs)?;
        if a.head == b.head && mine == theirs {
            return Ok(());
        }
        let (mine, theirs) = (first.decode(a, mine, scratch)?, second.decode(b, theirs, scratch)?);
        let found = differences(&mine, &theirs, a.leaf && b.leaf);
        if let Some(what) = found.phrase() {
            self.name(a.key, what);
        }
        self.bricks = self.bricks.and(found);
        Ok(())
    }
}

/// What a thread works with: the payloads of both stores, and the decoder's buffers.
#[derive(Default)]
struct CompareScratch {
    mine: Vec<u8>,
    theirs: Vec<u8>,
    scratch: Scratch,
}

impl BrickDifferences {
    fn and(self, other: BrickDifferences) -> BrickDifferences {
        BrickDifferences {
            bricks: self.bricks + other.bricks,
            samples: self.samples + other.samples,
            max_difference: self.max_difference.max(other.max_difference),
            signs: self.signs + other.signs,
            hermite_bricks: self.hermite_bricks + other.hermite_bricks,
            hermite_edges: self.hermite_edges + other.hermite_edges,
            moved_edges: self.moved_edges + other.moved_edges,
            max_move: self.max_move.max(other.max_move),
            turned_edges: self.turned_edges + other.turned_edges,
        }
    }

    /// Of one brick; `None` if nothing differs.
    fn phrase(&self) -> Option<String> {
        if self.samples > 0 {
            let (samples, most) = (self.samples, self.max_difference);
            return Some(format!("{samples} of its samples differ, by up to {most}"));
        }
        let (edges, moved, farthest) = (self.hermite_edges, self.moved_edges, self.max_move);
        let turned = self.turned_edges;
        (edges > 0).then(|| {
            format!("{edges} Hermite edges differ, {moved} in place by up to {farthest:.6}, {turned} in their normal")
        })
    }
}

/// How two bricks of one node differ; their Hermite edges if asked for, and if each stands for one of the other's.
fn differences(a: &Brick, b: &Brick, hermite: bool) -> BrickDifferences {
    let mut found = BrickDifferences::default();
    for (k, j) in (0..BRICK_POINTS).flat_map(|k| (0..BRICK_POINTS).map(move |j| (k, j))) {
        for i in 0..BRICK_POINTS {
            let (w, v) = (a.value([i, j, k]), b.value([i, j, k]));
            if w != v {
                found.samples += 1;
                found.max_difference = found.max_difference.max((w - v).abs());
                found.signs += u64::from((w >= 0.5) != (v >= 0.5));
            }
        }
    }
    found.bricks = u64::from(found.samples > 0);
    if hermite && found.signs == 0 {
        compare_edges(hermite_of(a), hermite_of(b), &mut found);
    }
    found
}

fn hermite_of(brick: &Brick) -> Option<(&Hermite, [usize; 3])> {
    match brick {
        Brick::Uniform(_) => None,
        Brick::Counts { samples, hermite } => Some((hermite, SignChanges::of(samples).counts())),
    }
}

/// Of two bricks with the same signs. A brick that lacks its edges has none that is equal.
fn compare_edges(
    a: Option<(&Hermite, [usize; 3])>,
    b: Option<(&Hermite, [usize; 3])>,
    found: &mut BrickDifferences,
) {
    let (Some((a, counts)), Some((b, _))) = (a, b) else { return };
    for axis in Axis::ALL {
        let (mine, theirs) = (&a.edges[axis.index()], &b.edges[axis.index()]);
        let both = mine.len().min(theirs.len());
        if mine.len() != theirs.len() {
            found.hermite_edges += (counts[axis.index()].max(both) - both) as u64;
        }
        for (a, b) in mine.iter().zip(theirs).filter(|(a, b)| a != b) {
            found.hermite_edges += 1;
            found.moved_edges += u64::from(a.offset != b.offset);
            found.turned_edges += u64::from(a.normal != b.normal);
            found.max_move = found.max_move.max(f64::from(a.offset.abs_diff(b.offset)) / 65536.0);
        }
    }
    found.hermite_bricks = u64::from(found.hermite_edges > 0);
}

/// What is known of beads.
fn lists(first: &Store, second: &Store, progress: &dyn Progress) -> Result<Comparison> {
    let mut found = Comparison::default();
    if first.bead_tables()? != second.bead_tables()? {
        found.lists += 1;
        found.name(NodeKey::ROOT, "the tables of beads differ".to_owned());
    }
    let (mine, theirs) = (first.identity_entries(), second.identity_entries());
    let tables = first.bead_tables()?.filter(|_| found.lists == 0);
    for (a, b) in pairs(mine, theirs, |list| list.key) {
        progress.check()?;
        let is_equal = match (a, b) {
            (Some(a), Some(b)) => {
                let equal_bytes =
                    a.length == b.length && first.read_identity(a)? == second.read_identity(b)?;
                let same = |tables| Ok(segments(first, a.key, tables)? == segments(second, b.key, tables)?);
                equal_bytes || tables.as_ref().map_or(Ok(false), same)?
            }
            _ => false,
        };
        if !is_equal {
            found.lists += 1;
            let keys = [a, b].into_iter().flatten().map(|list| list.key);
            keys.take(1).for_each(|key| found.name(key, "its lists of beads differ".to_owned()));
        }
    }
    Ok(found)
}

/// Pass or bead, section, ends and line of a segment.
type SegmentIdentity = (u32, u32, Units, Units, u64);

/// The segments of a leaf's list. In which order it names those of a bead says nothing, nor does naming one twice.
fn segments(store: &Store, key: NodeKey, tables: &BeadTables) -> Result<BTreeSet<SegmentIdentity>> {
    let segments = store.segments(key, tables)?;
    Ok(segments.iter().map(|s| (s.pass, s.section, s.a, s.b, s.line)).collect())
}
