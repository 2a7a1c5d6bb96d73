//! Shares of a store: what one of several machines has built, to be joined with the others.
//!
//! A share is a file of its own version, so that nothing takes it for a whole store. Its metadata says which cubes of
//! the tree it holds; `FORMAT.md` shows the bytes.

use super::index::TreeError;
use super::layout::IndexEntry;
use crate::lattice::{MAX_LEVEL, NodeKey, Octant};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Range;

/// Which of how many shares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct ShareId {
    /// From 1.
    pub number: u32,
    /// How many there are; at most [`ShareId::MAX`].
    pub of: u32,
}

impl ShareId {
    /// Most shares: more than the cubes that can be shared out.
    pub const MAX: u32 = 1 << 16;

    /// `None` unless 1 ≤ `number` ≤ `of` ≤ [`ShareId::MAX`].
    pub fn new(number: u32, of: u32) -> Option<ShareId> {
        (1 <= number && number <= of && of <= ShareId::MAX).then_some(ShareId { number, of })
    }
}

impl fmt::Display for ShareId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {}", self.number, self.of)
    }
}

/// What a share's metadata has beside a whole store's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Share {
    /// Which one.
    pub id: ShareId,
    /// Level of the cubes that are shared out.
    pub level: u8,
    /// Largest error of samples that was asked for. Shares of open input must agree in it.
    pub gwn_error: f64,
    /// What else the build found.
    pub found: ShareNumbers,
}

/// What the build of a share found. Known at its end only, so not part of the file's identity.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShareNumbers {
    /// A sum over all pieces of the whole input on the lattice: shares of other pieces do not fit.
    pub pieces: u64,
    /// True if nodes above the cubes' level follow from those below, so that no share holds any; false if each of
    /// them is in the share that holds its first cube.
    pub joined: bool,
    /// Numbers of the cubes along the Morton curve: the first, and the first of the next share.
    pub cells: (u64, u64),
    /// Cubes of `joined` shares that no surface touches, which are not among the nodes, with the value of all their
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

impl Share {
    /// The cubes of the share.
    pub fn cells(&self) -> Range<u64> {
        self.found.cells.0..self.found.cells.1
    }

    /// Whether a node has a cube of the share, or lies in one.
    pub fn meets(&self, key: NodeKey) -> bool {
        let (mine, its) = (self.cells(), cells_of(key, self.level));
        !mine.is_empty() && its.start < mine.end && mine.start < its.end
    }

    /// Whether a node belongs to the share: its first cube does.
    pub fn owns(&self, key: NodeKey) -> bool {
        self.cells().contains(&cells_of(key, self.level).start)
    }

    /// Values that the rest of the program may rely on.
    pub(super) fn check(&self, depth: u8) -> Result<(), String> {
        let Share { id, level, found, .. } = self;
        if ShareId::new(id.number, id.of) != Some(*id) {
            return Err(format!("there is no share {id}"));
        }
        if *level > depth || depth > MAX_LEVEL {
            return Err("the shared cubes are below the depth limit".into());
        }
        let (first, end) = found.cells;
        if first > end || end > 1 << (3 * u32::from(*level)) {
            return Err("the share's cubes lie outside the root".into());
        }
        let ordered = found.empty.is_sorted_by(|a, b| a.0 < b.0);
        if !ordered || found.empty.iter().any(|(cell, _)| !self.cells().contains(cell)) {
            return Err("the share's empty cubes are out of order or those of another share".into());
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
            return Err((entry.key, "the node is not one of this share"));
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
            return Err((NodeKey::ROOT, "the share has other cubes than it says"));
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
    use super::super::testing::{meta_of_share, nodes_of_share};
    use super::*;
    use crate::brick::codec::{PayloadHead, PayloadKind};
    use proptest::prelude::*;

    fn entries() -> Vec<IndexEntry> {
        let head = PayloadHead { kind: PayloadKind::UNIFORM, min: 0, max: 0 };
        let entry = |(key, leaf)| IndexEntry { key, offset: 0, length: 0, crc: 0, leaf, head };
        nodes_of_share().into_iter().map(entry).collect()
    }

    fn share() -> Share {
        meta_of_share().share.expect("it is one")
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
        assert_eq!(ShareId::new(3, 3).unwrap().to_string(), "3 of 3");
        assert!([(0, 3), (4, 3), (1, ShareId::MAX + 1)].iter().all(|&(i, n)| ShareId::new(i, n).is_none()));
    }

    #[test]
    fn every_other_set_of_nodes_is_refused() {
        Index::of_share(entries(), 2, &share()).unwrap();
        for at in 0..entries().len() {
            let mut other = entries();
            other.remove(at);
            assert!(Index::of_share(other, 2, &share()).is_err(), "without {at}");
            let mut other = entries();
            other.insert(at, other[at]);
            assert!(Index::of_share(other, 2, &share()).is_err(), "{at} twice");
            let mut other = entries();
            other[at].leaf = !other[at].leaf;
            assert!(Index::of_share(other, 2, &share()).is_err(), "{at} as another sort of node");
        }
        let found = share().found;
        for found in [
            ShareNumbers { cells: (0, 4), ..found.clone() },
            ShareNumbers { cells: (0, 6), ..found.clone() },
            ShareNumbers { empty: vec![], ..found.clone() },
            ShareNumbers { empty: vec![(2, 0)], ..found.clone() },
            ShareNumbers { empty: vec![(2, 0), (3, 0)], ..found.clone() },
        ] {
            assert!(Index::of_share(entries(), 2, &Share { found, ..share() }).is_err());
        }
        let nothing = ShareNumbers { cells: (5, 5), empty: vec![], ..found };
        let index = Index::of_share(vec![], 2, &Share { found: nothing, ..share() }).unwrap();
        assert_eq!((index.level_count(), index.nodes_per_level()), (1, vec![0]));
    }

    #[test]
    fn nodes_above_the_cubes_belong_to_shares_that_are_not_joined() {
        let root = IndexEntry { key: NodeKey::ROOT, leaf: false, ..entries()[0] };
        let with_root: Vec<IndexEntry> = std::iter::once(root).chain(entries()).collect();
        assert!(Index::of_share(with_root.clone(), 2, &share()).is_err());
        let decided = ShareNumbers { joined: false, empty: vec![], ..share().found };
        let mine = Share { found: decided.clone(), ..share() };
        assert_eq!(Index::of_share(with_root.clone(), 2, &mine).unwrap().nodes_per_level(), [1, 4, 8]);
        let other = Share { found: ShareNumbers { cells: (1, 5), ..decided }, ..share() };
        assert!(Index::of_share(with_root, 2, &other).is_err());
    }

    proptest! {
        #[test]
        fn any_metadata_is_read_or_refused(at in any::<prop::sample::Index>(), value in any::<u64>(), bits in 0u32..64) {
            let mut bytes = meta_of_share().encode().unwrap();
            let at = at.index(bytes.len() - 8);
            bytes[at..at + 8].copy_from_slice(&(value >> bits).to_le_bytes());
            if let Ok(Meta { depth, share: Some(share), .. }) = Meta::decode(&bytes, Version::Three) {
                let _ = Index::of_share(entries(), depth, &share);
            }
            prop_assert!(Meta::decode(&bytes[..at], Version::Three).is_err());
        }
    }
}
