//! The leaves that are contoured, in Morton order, and who lies next to whom.

use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, MAX_LEVEL, NodeKey, Octant, Units};
use crate::store::BrickTree;

/// A leaf of the tree, or an interior node that stands for its descendants where the tree is truncated.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContourLeaf {
    pub key: NodeKey,
    /// False where an interior node stands for its descendants.
    pub is_tree_leaf: bool,
    /// True if the leaf has samples inside and samples outside.
    pub changes: bool,
    /// The sign of all samples unless the leaf `changes`.
    pub inside: bool,
}

/// What lies next to a leaf in one of 26 directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LeafNeighbour {
    /// Nothing: the root ends here.
    Outside,
    /// A leaf of a lower level.
    Coarser(u32),
    /// A leaf of the same level.
    Same(u32),
    /// Leaves of higher levels.
    Finer,
}

/// The sides of a leaf by [`direction_index`]; the middle one is the leaf itself.
pub(super) type LeafNeighbours = [LeafNeighbour; 27];

/// Index of a direction with components −1, 0 or 1 in [`LeafNeighbours`].
#[inline]
pub(super) fn direction_index(d: [i32; 3]) -> usize {
    ((d[2] + 1) * 9 + (d[1] + 1) * 3 + d[0] + 1) as usize
}

/// The 18 directions across faces and edges; across a corner nothing is shared but a point.
pub(super) fn directions() -> impl Iterator<Item = [i32; 3]> {
    (0..27)
        .map(|n| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1])
        .filter(|d: &[i32; 3]| (1..=2).contains(&d.iter().filter(|&&c| c != 0).count()))
}

/// All leaves, found by place.
pub(super) struct Leaves {
    leaves: Vec<ContourLeaf>,
    /// Code of each leaf's last descendant at the deepest level; ascending.
    last: Vec<u64>,
    /// The highest level of them all.
    deepest: u8,
}

impl Leaves {
    /// The leaves of `tree` truncated at `level`; a sample is inside from `threshold` on.
    pub(super) fn new(tree: &dyn BrickTree, level: Option<u8>, threshold: i32) -> Result<Leaves> {
        let limit = level.unwrap_or(MAX_LEVEL);
        let mut leaves = Vec::new();
        for key in tree.keys() {
            let Some(info) = tree.node(key) else { continue };
            if key.level() > limit || (!info.leaf && key.level() < limit) {
                continue;
            }
            let changes = i32::from(info.max) >= threshold && i32::from(info.min) < threshold;
            let inside = i32::from(info.min) >= threshold;
            leaves.push(ContourLeaf { key, is_tree_leaf: info.leaf, changes, inside });
        }
        leaves.sort_by_key(|leaf| leaf.key.post_order());
        let last: Vec<u64> = leaves.iter().map(|leaf| leaf.key.post_order().0).collect();
        let deepest = leaves.iter().map(|leaf| leaf.key.level()).max().unwrap_or(0);
        let this = Leaves { leaves, last, deepest };
        this.check_cover()?;
        Ok(this)
    }

    /// Leaves must follow each other without gap or overlap, or no closed surface could come out.
    fn check_cover(&self) -> Result<()> {
        let mut next = first_descendant(NodeKey::ROOT);
        for (leaf, &last) in self.leaves.iter().zip(&self.last) {
            if first_descendant(leaf.key) != next {
                return Err(broken(leaf.key));
            }
            next = last + 1;
        }
        if next != NodeKey::ROOT.post_order().0 + 1 {
            return Err(broken(NodeKey::ROOT));
        }
        Ok(())
    }

    pub(super) fn len(&self) -> usize {
        self.leaves.len()
    }

    #[inline]
    pub(super) fn get(&self, leaf: u32) -> &ContourLeaf {
        &self.leaves[leaf as usize]
    }

    /// The leaf that covers a node, or the first of the leaves below the node.
    pub(super) fn covering(&self, key: NodeKey) -> u32 {
        let code = first_descendant(key);
        self.last.partition_point(|&last| last < code) as u32
    }

    /// The leaf of exactly this key, if there is one.
    pub(super) fn exact(&self, key: NodeKey) -> Option<u32> {
        let leaf = self.covering(key);
        (self.get(leaf).key == key).then_some(leaf)
    }

    /// The leaf whose cells hold the lattice position `at`, counted from the root's first sample; `None`
    /// outside the root.
    pub(super) fn at(&self, at: Units) -> Option<u32> {
        NodeKey::deepest_at(at).map(|key| self.covering(key))
    }

    /// Of the leaves around the lower end of an edge along `axis` the finest, the upper one of several: it makes the polygon
    /// of the edge if it is its own. `leaf_at` does what [`Leaves::at`] does.
    pub(super) fn owner(
        &self,
        axis: Axis,
        lower: Units,
        mut leaf_at: impl FnMut(Units) -> Option<u32>,
    ) -> Option<u32> {
        let (u, v) = axis.others();
        let mut finest: Option<u32> = None;
        for quadrant in 0..4 {
            let mut probe = lower;
            probe[u.index()] -= quadrant & 1;
            probe[v.index()] -= quadrant >> 1;
            let is_finer = |leaf: u32, than: u32| self.get(leaf).key.level() > self.get(than).key.level();
            finest = match (leaf_at(probe), finest) {
                (Some(leaf), Some(best)) if !is_finer(leaf, best) => Some(best),
                (found, best) => found.or(best),
            };
        }
        finest
    }

    /// What lies around a leaf.
    pub(super) fn around(&self, leaf: u32) -> LeafNeighbours {
        let key = self.get(leaf).key;
        let mut sides = [LeafNeighbour::Outside; 27];
        sides[direction_index([0; 3])] = LeafNeighbour::Same(leaf);
        for d in directions() {
            let Some(neighbour) = key.neighbour(d) else { continue };
            let other = self.covering(neighbour);
            sides[direction_index(d)] = match self.get(other).key.level().cmp(&key.level()) {
                std::cmp::Ordering::Less => LeafNeighbour::Coarser(other),
                std::cmp::Ordering::Equal => LeafNeighbour::Same(other),
                std::cmp::Ordering::Greater => LeafNeighbour::Finer,
            };
        }
        sides
    }

    /// How many levels the coarsest leaf around one is above it; of a leaf without sign changes, which has no polygons, none.
    pub(super) fn levels_up(&self, leaf: u32) -> u8 {
        let ContourLeaf { key, changes, .. } = *self.get(leaf);
        let up = |side: &LeafNeighbour| match side {
            LeafNeighbour::Coarser(other) => key.level() - self.get(*other).key.level(),
            _ => 0,
        };
        if changes { self.around(leaf).iter().map(up).max().unwrap_or(0) } else { 0 }
    }

    /// Whether finer leaves lie around a leaf.
    pub(super) fn has_finer(&self, leaf: u32) -> bool {
        self.get(leaf).key.level() < self.deepest && self.around(leaf).contains(&LeafNeighbour::Finer)
    }

    /// True if a leaf across one of a cell's faces or edges is finer than the cell, which is counted from the
    /// first cell of `key` and may lie beyond it in a leaf of the same level.
    pub(super) fn touches_finer(&self, key: NodeKey, cell: [i32; 3]) -> bool {
        const LAST: i32 = BRICK_CELLS as i32 - 1;
        if key.level() >= self.deepest || cell.iter().all(|c| (1..LAST).contains(&(c & LAST))) {
            return false;
        }
        directions().any(|d| {
            let at = std::array::from_fn(|a| key.base()[a] + ((cell[a] + d[a]) << key.spacing_bits()));
            self.at(at).is_some_and(|leaf| self.get(leaf).key.level() > key.level())
        })
    }

    /// The leaves below the neighbour of `key` in direction `d` that touch `key`, in Morton order.
    pub(super) fn touching(&self, key: NodeKey, d: [i32; 3], found: &mut Vec<u32>) {
        if let Some(neighbour) = key.neighbour(d) {
            self.descend(neighbour, d, found);
        }
    }

    fn descend(&self, node: NodeKey, d: [i32; 3], found: &mut Vec<u32>) {
        let leaf = self.covering(node);
        if self.get(leaf).key.level() <= node.level() {
            found.push(leaf);
            return;
        }
        // A neighbour above touches with its lower children.
        let touches = |octant: &Octant| {
            octant.offset().iter().zip(d).all(|(&half, d)| d == 0 || (half == 0) == (d > 0))
        };
        for octant in Octant::all().filter(touches) {
            self.descend(node.child(octant), d, found);
        }
    }
}

/// The cell of `other`, a leaf that is no finer than `own`, that holds one counted from the first cell of `own`. Samples of
/// leaves of one level are counted alike.
pub(super) fn cell_in(other: NodeKey, own: NodeKey, cell: [i32; 3]) -> [usize; 3] {
    let shift = own.level() - other.level();
    let (own, first) = (own.first_sample(), other.first_sample());
    std::array::from_fn(|a| (((own[a] as i32 + cell[a]) >> shift) - first[a] as i32) as usize)
}

/// Code of a node's first descendant at the deepest level.
fn first_descendant(key: NodeKey) -> u64 {
    key.code() << (3 * u32::from(MAX_LEVEL - key.level()))
}

/// The error of a tree that contradicts itself at `key`.
pub(super) fn broken(key: NodeKey) -> Error {
    Error::setting(
        format!("the tree contradicts itself at brick {key}"),
        "check the store with `brickfield verify` and build it again",
    )
}
