//! The index of a store in memory: sorted by key and known to be a complete octree, or the part of one that is in a shard.

use super::layout::{IndexEntry, TreeError};
use super::shard::Shard;
use crate::lattice::{MAX_LEVEL, NodeKey, Octant};

/// Entries of a complete octree in key order, which is breadth first: the nodes of a level follow each other
/// along the Morton curve.
#[derive(Debug)]
pub struct Index {
    entries: Vec<IndexEntry>,
    /// Where each level begins, and the number of all entries at the end.
    level_starts: Vec<usize>,
}

impl Index {
    /// Takes entries in key order; they must be one octree from the root, complete, without repetition and no
    /// deeper than `depth`.
    ///
    /// In breadth-first order the children of the interior nodes, one after the other, are all nodes but the
    /// root in that same order. So one walk along both proves order, uniqueness and completeness.
    pub fn new(entries: Vec<IndexEntry>, depth: u8) -> Result<Index, TreeError> {
        let mut level_starts = vec![0];
        let mut expected = ExpectedKeys::new(&entries);
        for (position, entry) in entries.iter().enumerate() {
            let level = entry.key.level();
            match expected.next(position) {
                Some(key) if key == entry.key => {}
                Some(key) if key < entry.key => return Err((key, "the node is missing")),
                _ => return Err((entry.key, "the node is out of order, repeated or below a leaf")),
            }
            if level > depth || (!entry.leaf && level == MAX_LEVEL.min(depth)) {
                return Err((entry.key, "the node is deeper than the depth limit allows"));
            }
            if usize::from(level) == level_starts.len() {
                level_starts.push(position);
            }
        }
        match expected.next(entries.len()) {
            Some(key) => Err((key, "the node is missing")),
            None => {
                level_starts.push(entries.len());
                Ok(Index { entries, level_starts })
            }
        }
    }

    /// Takes the entries of a shard in key order; see [`Shard::check_entries`].
    pub fn of_shard(entries: Vec<IndexEntry>, depth: u8, shard: &Shard) -> Result<Index, TreeError> {
        shard.check_entries(&entries, depth)?;
        let levels = entries.last().map_or(1, |entry| entry.key.level() + 1);
        let start = |level| entries.partition_point(|entry| entry.key.level() < level);
        let level_starts = (0..=levels).map(start).collect();
        Ok(Index { entries, level_starts })
    }

    /// Takes the entries of an unfinished store in key order: whatever stands above, below an interior node all is there.
    pub fn of_unfinished(entries: Vec<IndexEntry>, depth: u8) -> Result<Index, TreeError> {
        if let Some(pair) = entries.windows(2).find(|pair| pair[0].key >= pair[1].key) {
            return Err((pair[1].key, "the node is repeated"));
        }
        let levels = entries.last().map_or(1, |entry| entry.key.level() + 1);
        let start = |level| entries.partition_point(|entry| entry.key.level() < level);
        let index = Index { level_starts: (0..=levels).map(start).collect(), entries };
        for entry in &index.entries {
            if entry.key.level() + u8::from(!entry.leaf) > depth.min(MAX_LEVEL) {
                return Err((entry.key, "the node is deeper than the depth limit allows"));
            }
            let child = |octant| index.get(entry.key.child(octant)).is_some();
            if !entry.leaf && !Octant::all().all(child) {
                return Err((entry.key, "the node lacks a child"));
            }
            if entry.key.parent().and_then(|parent| index.get(parent)).is_some_and(|parent| parent.leaf) {
                return Err((entry.key, "the node is below a leaf"));
            }
        }
        Ok(index)
    }

    /// All entries, in key order.
    pub fn entries(&self) -> &[IndexEntry] {
        &self.entries
    }

    /// The node's entry.
    pub fn get(&self, key: NodeKey) -> Option<&IndexEntry> {
        let level = self.level(key.level());
        level.binary_search_by_key(&key, |entry| entry.key).ok().map(|at| &level[at])
    }

    /// Entries of one level, in Morton order; none below the deepest.
    pub fn level(&self, level: u8) -> &[IndexEntry] {
        match self.level_starts.get(usize::from(level)..usize::from(level) + 2) {
            Some(&[start, end]) => &self.entries[start..end],
            _ => &[],
        }
    }

    /// Levels that have nodes; at least one.
    pub fn level_count(&self) -> u8 {
        (self.level_starts.len() - 1) as u8
    }

    /// Number of nodes on each level, the root's first.
    pub fn nodes_per_level(&self) -> Vec<u64> {
        self.level_starts.windows(2).map(|w| (w[1] - w[0]) as u64).collect()
    }
}

/// The keys that entries must have, if those before each are right: the root, then the children of each
/// interior entry.
struct ExpectedKeys<'a> {
    entries: &'a [IndexEntry],
    /// Entries up to here had their children expected.
    parents: usize,
    /// Children of the last parent that are still to come.
    pending: std::vec::IntoIter<NodeKey>,
}

impl ExpectedKeys<'_> {
    fn new(entries: &[IndexEntry]) -> ExpectedKeys<'_> {
        ExpectedKeys { entries, parents: 0, pending: vec![NodeKey::ROOT].into_iter() }
    }

    /// The key after `checked` entries that were found right.
    fn next(&mut self, checked: usize) -> Option<NodeKey> {
        if self.pending.len() == 0 {
            let ahead = &self.entries[self.parents..checked];
            let skipped = ahead.iter().position(|entry| !entry.leaf)?;
            let parent = ahead[skipped].key;
            self.parents += skipped + 1;
            self.pending = Octant::all().map(|octant| parent.child(octant)).collect::<Vec<_>>().into_iter();
        }
        self.pending.next()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::codec::{PayloadHead, PayloadKind};

    fn entry(key: NodeKey, leaf: bool) -> IndexEntry {
        let head = PayloadHead { kind: PayloadKind::UNIFORM, min: 0, max: 0 };
        IndexEntry { key, offset: 0, length: 0, crc: 0, leaf, head }
    }

    /// The root, its children, and the children of child 5.
    fn two_levels() -> Vec<IndexEntry> {
        let children = |key: NodeKey| Octant::all().map(move |o| key.child(o));
        let divided = children(NodeKey::ROOT).nth(5).unwrap();
        let mut entries = vec![entry(NodeKey::ROOT, false)];
        entries.extend(children(NodeKey::ROOT).map(|key| entry(key, key != divided)));
        entries.extend(children(divided).map(|key| entry(key, true)));
        entries
    }

    #[test]
    fn a_complete_tree_is_indexed() {
        let index = Index::new(two_levels(), 2).unwrap();
        assert_eq!(index.nodes_per_level(), [1, 8, 8]);
        assert_eq!(index.level_count(), 3);
        assert_eq!(index.level(1).len(), 8);
        assert_eq!(index.level(3), []);
        for entry in two_levels() {
            assert_eq!(index.get(entry.key), Some(&entry));
        }
        assert_eq!(index.get(NodeKey::new(2, [0, 0, 0]).unwrap()), None);
        assert_eq!(index.get(NodeKey::new(9, [0, 0, 0]).unwrap()), None);
    }

    #[test]
    fn every_other_set_of_nodes_is_refused() {
        assert!(Index::new(vec![], 2).is_err());
        assert!(Index::new(two_levels(), 1).is_err());
        for at in 0..two_levels().len() {
            let mut missing = two_levels();
            missing.remove(at);
            assert!(Index::new(missing, 2).is_err(), "without {at}");
            let mut repeated = two_levels();
            repeated.insert(at, repeated[at]);
            assert!(Index::new(repeated, 2).is_err(), "{at} twice");
            let mut flipped = two_levels();
            flipped[at].leaf = !flipped[at].leaf;
            assert!(Index::new(flipped, 3).is_err(), "{at} as another sort of node");
        }
        let deepest = NodeKey::new(MAX_LEVEL, [0; 3]).unwrap();
        assert!(Index::new(vec![entry(NodeKey::ROOT, true), entry(deepest, false)], MAX_LEVEL).is_err());
    }
}
