//! Shards of a store: what one of several machines has built, to be joined with the others.
//!
//! A shard is a file of its own version, so that nothing takes it for a whole store. Its metadata says which cubes of
//! the tree it holds; `FORMAT.md` shows the bytes.

use super::layout::{IndexEntry, TreeError};
use crate::lattice::{MAX_LEVEL, NodeKey, Octant};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Range;

/// Which of how many shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct ShardId {
    /// From 1.
    pub number: u32,
    /// How many there are; at most [`ShardId::MAX`].
    pub of: u32,
}

impl ShardId {
    /// Most shards: more than the cubes that can be shared out.
    pub const MAX: u32 = 1 << 16;

    /// `None` unless 1 ≤ `number` ≤ `of` ≤ [`ShardId::MAX`].
    pub fn new(number: u32, of: u32) -> Option<ShardId> {
        (1 <= number && number <= of && of <= ShardId::MAX).then_some(ShardId { number, of })
    }
}

impl fmt::Display for ShardId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {}", self.number, self.of)
    }
}

/// What a shard's metadata has beside a whole store's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shard {
    /// Which one.
    pub id: ShardId,
    /// Level of the cubes that are shared out.
    pub level: u8,
    /// Largest error of samples that was asked for. Shards of open input must agree in it.
    pub gwn_error: f64,
    /// What else the build found.
    pub found: ShardNumbers,
}

/// What the build of a shard found. Known at its end only, so not part of the file's identity.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShardNumbers {
    /// A sum over all pieces of the whole input on the lattice: shards of other pieces do not fit.
    pub pieces: u64,
    /// True if nodes above the cubes' level follow from those below, so that no shard holds any; false if each of
    /// them is in the shard that holds its first cube.
    pub joined: bool,
    /// Numbers of the cubes along the Morton curve: the first, and the first of the next shard.
    pub cells: (u64, u64),
    /// Cubes of `joined` shards that no surface touches, which are not among the nodes, with the value of all their
    /// samples; ascending.
    pub empty: Vec<(u64, i16)>,
}

/// Numbers, along the Morton curve, of the cubes of `level` that lie in a node above them, or in which one below lies.
pub fn cells_of(key: NodeKey, level: u8) -> Range<u64> {
    let morton = key.code() ^ (1 << (3 * u32::from(key.level())));
    match level.checked_sub(key.level()) {
        Some(down) => morton << (3 * u32::from(down))..(morton + 1) << (3 * u32::from(down)),
        None => {
            let cell = morton >> (3 * u32::from(key.level() - level));
            cell..cell + 1
        }
    }
}

/// The key of a cube by its number; `None` if there is no such cube.
pub fn cell_key(level: u8, cell: u64) -> Option<NodeKey> {
    (level <= MAX_LEVEL && cell >> (3 * u32::from(level)) == 0)
        .then(|| NodeKey::from_code(1 << (3 * u32::from(level)) | cell))?
}

impl Shard {
    /// The cubes of the shard.
    pub fn cells(&self) -> Range<u64> {
        self.found.cells.0..self.found.cells.1
    }

    /// Whether a node has a cube of the shard, or lies in one.
    pub fn meets(&self, key: NodeKey) -> bool {
        let (mine, its) = (self.cells(), cells_of(key, self.level));
        !mine.is_empty() && its.start < mine.end && mine.start < its.end
    }

    /// Whether a node belongs to the shard: its first cube does.
    pub fn owns(&self, key: NodeKey) -> bool {
        self.cells().contains(&cells_of(key, self.level).start)
    }

    /// Values that the rest of the program may rely on.
    pub(super) fn check(&self, depth: u8) -> Result<(), String> {
        let Shard { id, level, found, .. } = self;
        if ShardId::new(id.number, id.of) != Some(*id) {
            return Err(format!("there is no shard {id}"));
        }
        if *level > depth || depth > MAX_LEVEL {
            return Err("the shared cubes are below the depth limit".into());
        }
        let (first, end) = found.cells;
        if first > end || end > 1 << (3 * u32::from(*level)) {
            return Err("the shard's cubes lie outside the root".into());
        }
        let ordered = found.empty.is_sorted_by(|a, b| a.0 < b.0);
        if !ordered || found.empty.iter().any(|(cell, _)| !self.cells().contains(cell)) {
            return Err("the shard's empty cubes are out of order or those of another shard".into());
        }
        Ok(())
    }

    /// Checks entries in key order: at the shared cubes and below they are complete subtrees, one in each cube that is
    /// not empty if the nodes above are to be joined; nodes above are there only if they are not.
    pub(super) fn check_entries(&self, entries: &[IndexEntry], depth: u8) -> Result<(), TreeError> {
        if let Some(pair) = entries.windows(2).find(|pair| pair[0].key >= pair[1].key) {
            return Err((pair[1].key, "the node is out of order or repeated"));
        }
        let deepest = |entry: &IndexEntry| entry.key.level() + u8::from(!entry.leaf) > depth;
        if let Some(entry) = entries.iter().find(|entry| deepest(entry)) {
            return Err((entry.key, "the node is deeper than the depth limit allows"));
        }
        let above = |entry: &IndexEntry| self.found.joined && entry.key.level() < self.level;
        if let Some(entry) = entries.iter().find(|entry| !self.owns(entry.key) || above(entry)) {
            return Err((entry.key, "the node is not one of this shard"));
        }
        if self.found.joined {
            self.check_cells(level_of(entries, self.level))?;
        }
        (self.level..depth).try_for_each(|level| {
            let interior = level_of(entries, level).iter().filter(|entry| !entry.leaf);
            let children = interior.flat_map(|entry| Octant::all().map(|octant| entry.key.child(octant)));
            check_children(children, level_of(entries, level + 1))
        })
    }

    /// Every cube is either a node or empty.
    fn check_cells(&self, nodes: &[IndexEntry]) -> Result<(), TreeError> {
        // Before a walk along the cubes, of which there may be any number.
        let (first, end) = self.found.cells;
        if end - first != (nodes.len() + self.found.empty.len()) as u64 {
            return Err((NodeKey::ROOT, "the shard has other cubes than it says"));
        }
        let mut nodes = nodes.iter().map(|entry| entry.key).peekable();
        let mut empty = self.found.empty.iter().map(|&(cell, _)| cell).peekable();
        for cell in self.cells() {
            let Some(key) = cell_key(self.level, cell) else { break };
            let is_node = nodes.next_if_eq(&key).is_some();
            if is_node == empty.next_if_eq(&cell).is_some() {
                return Err((
                    key,
                    if is_node { "the node is said to be empty" } else { "the node is missing" },
                ));
            }
        }
        Ok(())
    }
}

/// Entries of one level, of all in key order.
fn level_of(entries: &[IndexEntry], level: u8) -> &[IndexEntry] {
    let start = entries.partition_point(|entry| entry.key.level() < level);
    &entries[start..entries.partition_point(|entry| entry.key.level() <= level)]
}

/// The nodes of a level are the children of the interior nodes of the level above.
fn check_children(
    mut expected: impl Iterator<Item = NodeKey>,
    nodes: &[IndexEntry],
) -> Result<(), TreeError> {
    for entry in nodes {
        match expected.next() {
            Some(key) if key == entry.key => {}
            Some(key) if key < entry.key => return Err((key, "the node is missing")),
            _ => return Err((entry.key, "the node has no parent")),
        }
    }
    expected.next().map_or(Ok(()), |key| Err((key, "the node is missing")))
}

#[cfg(test)]
mod tests {
    use super::super::index::Index;
    use super::super::layout::Version;
    use super::super::meta::Meta;
    use super::super::testing::{meta_of_shard, nodes_of_shard};
    use super::*;
    use crate::brick::codec::{PayloadHead, PayloadKind};
    use proptest::prelude::*;

    fn entries() -> Vec<IndexEntry> {
        let head = PayloadHead { kind: PayloadKind::UNIFORM, min: 0, max: 0 };
        let entry = |(key, leaf)| IndexEntry { key, offset: 0, length: 0, crc: 0, leaf, head };
        nodes_of_shard().into_iter().map(entry).collect()
    }

    fn shard() -> Shard {
        meta_of_shard().shard.expect("it is one")
    }

    #[test]
    fn cubes_are_counted_along_the_curve() {
        let key = |level, position| NodeKey::new(level, position).unwrap();
        assert_eq!(cells_of(NodeKey::ROOT, 3), 0..512);
        assert_eq!(cells_of(key(1, [1, 0, 1]), 2), 40..48);
        assert_eq!(cells_of(key(3, [5, 1, 4]), 1), 5..6);
        for cell in 0..64 {
            assert_eq!(cells_of(cell_key(2, cell).unwrap(), 2), cell..cell + 1);
        }
        assert_eq!((cell_key(2, 64), cell_key(17, 0)), (None, None));
        assert_eq!(ShardId::new(3, 3).unwrap().to_string(), "3 of 3");
        assert!([(0, 3), (4, 3), (1, ShardId::MAX + 1)].iter().all(|&(i, n)| ShardId::new(i, n).is_none()));
    }

    #[test]
    fn every_other_set_of_nodes_is_refused() {
        Index::of_shard(entries(), 2, &shard()).unwrap();
        for at in 0..entries().len() {
            let mut other = entries();
            other.remove(at);
            assert!(Index::of_shard(other, 2, &shard()).is_err(), "without {at}");
            let mut other = entries();
            other.insert(at, other[at]);
            assert!(Index::of_shard(other, 2, &shard()).is_err(), "{at} twice");
            let mut other = entries();
            other[at].leaf = !other[at].leaf;
            assert!(Index::of_shard(other, 2, &shard()).is_err(), "{at} as another sort of node");
        }
        let found = shard().found;
        for found in [
            ShardNumbers { cells: (0, 4), ..found.clone() },
            ShardNumbers { cells: (0, 6), ..found.clone() },
            ShardNumbers { empty: vec![], ..found.clone() },
            ShardNumbers { empty: vec![(2, 0)], ..found.clone() },
            ShardNumbers { empty: vec![(2, 0), (3, 0)], ..found.clone() },
        ] {
            assert!(Index::of_shard(entries(), 2, &Shard { found, ..shard() }).is_err());
        }
        let nothing = ShardNumbers { cells: (5, 5), empty: vec![], ..found };
        let index = Index::of_shard(vec![], 2, &Shard { found: nothing, ..shard() }).unwrap();
        assert_eq!((index.level_count(), index.nodes_per_level()), (1, vec![0]));
    }

    #[test]
    fn nodes_above_the_cubes_belong_to_shards_that_are_not_joined() {
        let root = IndexEntry { key: NodeKey::ROOT, leaf: false, ..entries()[0] };
        let with_root: Vec<IndexEntry> = std::iter::once(root).chain(entries()).collect();
        assert!(Index::of_shard(with_root.clone(), 2, &shard()).is_err());
        let decided = ShardNumbers { joined: false, empty: vec![], ..shard().found };
        let mine = Shard { found: decided.clone(), ..shard() };
        assert_eq!(Index::of_shard(with_root.clone(), 2, &mine).unwrap().nodes_per_level(), [1, 4, 8]);
        let other = Shard { found: ShardNumbers { cells: (1, 5), ..decided }, ..shard() };
        assert!(Index::of_shard(with_root, 2, &other).is_err());
    }

    proptest! {
        #[test]
        fn any_metadata_is_read_or_refused(at in any::<prop::sample::Index>(), value in any::<u64>(), bits in 0u32..64) {
            let mut bytes = meta_of_shard().encode().unwrap();
            let at = at.index(bytes.len() - 8);
            bytes[at..at + 8].copy_from_slice(&(value >> bits).to_le_bytes());
            if let Ok(Meta { depth, shard: Some(shard), .. }) = Meta::decode(&bytes, Version::Three) {
                let _ = Index::of_shard(entries(), depth, &shard);
            }
            prop_assert!(Meta::decode(&bytes[..at], Version::Three).is_err());
        }
    }
}
