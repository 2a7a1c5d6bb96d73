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
