//! Which beads each leaf counts: a pass over the finished tree.
//!
//! It follows the segments down the tree once more, beside the build, because most builds do without it and
//! because it costs a few per cent of one.

use super::bins::Binner;
use super::field::PieceField;
use crate::brick::Count;
use crate::error::Result;
use crate::lattice::{NodeKey, Octant};
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::solid::{Segment, Solids};
use crate::store::{BeadSegment, Shard, StoreWriter, cell_key, cells_of, encode_segments};
use crate::toolpath::Toolpath;
use rayon::prelude::*;

/// Level at which nodes become jobs: at most 4,096 of them.
const JOB_LEVEL: u8 = 4;

/// The nodes that get lists: the leaves, and in a shard those that may become leaves when shards are joined.
pub(super) struct ListedNodes<'a> {
    /// Of the tree, in key order, and which of them are leaves.
    nodes: Vec<(NodeKey, bool)>,
    shard: Option<&'a Shard>,
    /// Nodes above a shard's cubes whose cubes, as far as they are the shard's, are empty and alike; sorted.
    alike: Vec<NodeKey>,
}

/// What is done with a node that segments touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// It gets a list.
    Leaf,
    /// It gets a list, and so may nodes below it.
    Perhaps,
    /// Nodes below it may get lists.
    Interior,
    /// It is another shard's.
    Elsewhere,
}

impl ListedNodes<'_> {
    /// Of the nodes of a store, in key order, or of a shard of one.
    pub fn of(nodes: Vec<(NodeKey, bool)>, shard: Option<&Shard>) -> ListedNodes<'_> {
        let mut alike: Vec<NodeKey> = shard.map_or(Vec::new(), |shard| {
            (0..shard.level).flat_map(|level| nodes_that_are_alike(shard, level)).collect()
        });
        alike.sort_unstable();
        ListedNodes { nodes, shard, alike }
    }

    fn role(&self, key: NodeKey) -> Role {
        if let Ok(at) = self.nodes.binary_search_by_key(&key, |(key, _)| *key) {
            return if self.nodes[at].1 { Role::Leaf } else { Role::Interior };
        }
        let Some(shard) = self.shard else { return Role::Interior };
        let its = cells_of(key, shard.level);
        if key.level() < shard.level {
            return match shard.meets(key) {
                true if self.alike.binary_search(&key).is_ok() => Role::Perhaps,
                true => Role::Interior,
                false => Role::Elsewhere,
            };
        }
        let empty = shard.found.empty.binary_search_by_key(&its.start, |(cell, _)| *cell).is_ok();
        if key.level() == shard.level && empty { Role::Leaf } else { Role::Elsewhere }
    }
}

/// Nodes of a level above the cubes that a shard owns, if all their cubes of the shard are empty and have one value.
fn nodes_that_are_alike(shard: &Shard, level: u8) -> impl Iterator<Item = NodeKey> {
    let down = 3 * u32::from(shard.level - level);
    let empty = &shard.found.empty;
    let is_alike = move |at: usize| {
        let (first, w) = empty[at];
        let count = (1u64 << down).min(shard.cells().end - first) as usize;
        let alike = empty.get(at..at + count);
        // They are in order and unlike, so as many as there can be are all.
        alike.is_some_and(|all| {
            all.iter().all(|(_, other)| *other == w)
                && all.last().is_some_and(|(c, _)| *c - first + 1 == count as u64)
        })
    };
    let begins_node = move |&at: &usize| empty[at].0 & ((1 << down) - 1) == 0 && is_alike(at);
    (0..empty.len()).filter(begins_node).filter_map(move |at| cell_key(level, empty[at].0 >> down))
}

/// What lists name.
pub(super) struct ListSources<'a> {
    pub solids: &'a Solids,
    pub paths: &'a [&'a Toolpath],
    /// With passes a list names the lines of its segments, too.
    pub count: Count,
}

impl ListSources<'_> {
    /// The line of each segment, of all toolpaths.
    pub fn lines(&self) -> impl Iterator<Item = u64> {
        self.paths.iter().copied().flat_map(|path| {
            (0..path.len()).flat_map(move |bead| {
                (0..path.points(bead).len() - 1).map(move |segment| path.line(bead, segment))
            })
        })
    }
}

/// A node with the segments that touch it, in the order of the toolpath.
struct TouchedNode {
    key: NodeKey,
    segments: Vec<Segment>,
    /// Their lines, or none.
    lines: Vec<u64>,
    /// Whether it only gets a list, and what is below it is seen to elsewhere.
    only_listed: bool,
}

/// Appends to the store, for each of its leaves, the list of the segments that touch it.
pub(super) fn write_identity(
    named: &ListSources<'_>,
    segments: Vec<Segment>,
    leaves: &ListedNodes<'_>,
    writer: &mut StoreWriter,
    progress: &dyn Progress,
) -> Result<()> {
    let ListSources { solids, count, .. } = *named;
    let is_solid = |segment: &Segment| !solids.is_void(segment);
    let lines = match count {
        Count::Passes => {
            let lines = segments.iter().zip(named.lines()).filter(|(segment, _)| is_solid(segment));
            lines.map(|(_, line)| line).collect()
        }
        Count::Beads => Vec::new(),
    };
    let segments = segments.into_iter().filter(is_solid).collect();
    let mut jobs = vec![TouchedNode { key: NodeKey::ROOT, segments, lines, only_listed: false }];
    for _ in 0..JOB_LEVEL {
        jobs = jobs.into_par_iter().flat_map_iter(|node| divide(solids, node, leaves)).collect();
        progress.check()?;
    }
    progress.phase("telling beads apart", Some(jobs.len() as u64), "subtrees");
    let kept = writer.kept();
    let work = |(): &mut (), number: usize| {
        progress.check()?;
        let mut lists = Lists::default();
        if !kept.as_ref().is_some_and(|kept| kept.has_lists_behind(jobs[number].key)) {
            lists.add((solids, count), &jobs[number], leaves);
        }
        Ok(lists)
    };
    run_ordered(
        jobs.len(),
        2 * rayon::current_num_threads(),
        || (),
        work,
        |lists: Lists| {
            progress.advance(1);
            let mut from = 0;
            for (key, end) in lists.ends {
                writer.append_identity(key, &lists.bytes[from..end])?;
                from = end;
            }
            writer.commit_if_due()
        },
    )
}

/// A node's children that segments touch, if it has any.
fn divide(solids: &Solids, node: TouchedNode, leaves: &ListedNodes<'_>) -> Vec<TouchedNode> {
    match leaves.role(node.key) {
        _ if node.only_listed => vec![node],
        Role::Leaf => vec![node],
        Role::Elsewhere => Vec::new(),
        Role::Interior => children(solids, &node).collect(),
        Role::Perhaps => {
            let below: Vec<TouchedNode> = children(solids, &node).collect();
            std::iter::once(TouchedNode { only_listed: true, ..node }).chain(below).collect()
        }
    }
}

/// The children that segments touch.
fn children(solids: &Solids, node: &TouchedNode) -> impl Iterator<Item = TouchedNode> {
    let lists = Binner::new(node.key, 1).sort_indices(solids, &node.segments);
    let child = move |octant: Octant| {
        let indices = lists.of(octant.index());
        TouchedNode {
            key: node.key.child(octant),
            segments: indices.iter().map(|&i| node.segments[i as usize]).collect(),
            lines: indices.iter().filter_map(|&i| node.lines.get(i as usize).copied()).collect(),
            only_listed: false,
        }
    };
    Octant::all().map(child).filter(|child| !child.segments.is_empty())
}

/// Encoded lists of some leaves.
#[derive(Default)]
struct Lists {
    ends: Vec<(NodeKey, usize)>,
    bytes: Vec<u8>,
}

impl Lists {
    fn add(&mut self, (solids, count): (&Solids, Count), node: &TouchedNode, leaves: &ListedNodes<'_>) {
        let role = if node.only_listed { Role::Leaf } else { leaves.role(node.key) };
        if matches!(role, Role::Leaf | Role::Perhaps) {
            let lines = node.lines.iter().copied().chain(std::iter::repeat(0));
            let stored = |(s, line): (&Segment, u64)| BeadSegment {
                a: s.a,
                b: s.b,
                section: s.profile,
                pass: s.pass,
                line,
            };
            let segments: Vec<BeadSegment> = node.segments.iter().zip(lines).map(stored).collect();
            encode_segments(&segments, count, &mut self.bytes);
            self.ends.push((node.key, self.bytes.len()));
        }
        if matches!(role, Role::Interior | Role::Perhaps) {
            children(solids, node).for_each(|child| self.add((solids, count), &child, leaves));
        }
    }
}
