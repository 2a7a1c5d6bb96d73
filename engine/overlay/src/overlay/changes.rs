//! What a cut, or another Boolean, has made of a surface: what is as it was, what is new, and voids that have opened.
//!
//! A store does not tell which of its crossings came from a cut. But Booleans keep those of their operands bit by bit, so the
//! store as it was before tells: a crossing that it has on the same lattice edge is as it was, any other is new.

use super::{Met, Tint, VoidTint};
use crate::brick::{Brick, Hermite, HermiteEdge, Ranks, SignChanges};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, NodeKey, RootCube};
use crate::store::{BrickCache, BrickTree, LeafOrder};
use std::sync::Arc;

/// What a point of the surface is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// As it was.
    Kept,
    /// New.
    New,
    /// As it was, but around a void that was closed.
    Opened,
    /// Bricks of different levels do not tell.
    Untold,
}

impl Change {
    /// All that a legend has.
    pub const ALL: [Change; 4] = [Change::Kept, Change::New, Change::Opened, Change::Untold];

    /// Its colour, sRGB.
    pub fn colour(self) -> [u8; 3] {
        match self {
            Change::Kept => [188, 190, 194],
            Change::New => [72, 140, 203],
            Change::Opened => [222, 60, 40],
            Change::Untold => [236, 220, 150],
        }
    }

    /// Its name in legends.
    pub fn name(self) -> &'static str {
        match self {
            Change::Kept => "as it was",
            Change::New => "new",
            Change::Opened => "opened void",
            Change::Untold => "not told",
        }
    }
}

/// Colours a surface by what has changed since an earlier store on the same lattice.
pub struct ChangesTint<'a> {
    after: Crossings<'a>,
    before: Crossings<'a>,
    /// The voids that there were.
    voids: VoidTint<'a>,
    root: RootCube,
}

impl<'a> ChangesTint<'a> {
    /// Of two stores on one lattice, and the voids of the earlier one. What is read is kept in so many bytes.
    ///
    /// # Errors
    /// If the leaves of a tree do not cover its root.
    pub fn new(
        after: &'a dyn BrickTree,
        before: &'a dyn BrickTree,
        voids: VoidTint<'a>,
        cache_bytes: u64,
    ) -> Result<ChangesTint<'a>> {
        let of = |tree| Crossings::new(tree, cache_bytes / 2);
        Ok(ChangesTint { after: of(after)?, before: of(before)?, voids, root: after.root() })
    }

    /// What a point of the surface is, of which this is the outward unit normal.
    ///
    /// # Errors
    /// What reading gives.
    pub fn change(&self, world: [f64; 3], normal: [f64; 3]) -> Result<Change> {
        let at = self.root.from_first_sample(world);
        let Some((key, edge, found)) = self.after.nearest(at)? else { return Ok(Change::Untold) };
        match self.before.on(key, edge)? {
            None => Ok(Change::Untold),
            Some(before) if before != Some(found) => Ok(Change::New),
            Some(_) => {
                let is_void = self.voids.beyond(key, world, normal)? > 0;
                Ok(if is_void { Change::Opened } else { Change::Kept })
            }
        }
    }
}

impl Tint for ChangesTint<'_> {
    fn colour(&self, met: Met) -> Result<Option<[u8; 3]>> {
        Ok(Some(self.change(met.at, met.normal)?.colour()))
    }

    fn is_slow(&self) -> bool {
        false
    }

    fn is_plain(&self, _: NodeKey) -> bool {
        // Only leaves have crossings.
        false
    }
}

/// A lattice edge of a brick: its axis and lower sample.
type Edge = (Axis, [usize; 3]);

/// The crossings of a tree by lattice edge.
struct Crossings<'a> {
    tree: &'a dyn BrickTree,
    order: LeafOrder,
    cache: BrickCache<Leaf>,
}

/// A leaf with its crossings in order.
struct Leaf {
    signs: SignChanges,
    ranks: [Box<Ranks>; 3],
    hermite: Hermite,
}

impl<'a> Crossings<'a> {
    fn new(tree: &'a dyn BrickTree, cache_bytes: u64) -> Result<Crossings<'a>> {
        Ok(Crossings { tree, order: LeafOrder::new(tree)?, cache: BrickCache::new(cache_bytes) })
    }

    /// The crossings of a leaf; `None` if it has none.
    fn leaf(&self, key: NodeKey) -> Result<Option<Arc<Leaf>>> {
        if self.tree.node(key).is_some_and(|node| node.uniform().is_some()) {
            return Ok(None);
        }
        if let Some(leaf) = self.cache.get(key) {
            return Ok(Some(leaf));
        }
        let brick = self.tree.brick_once(key)?;
        let Brick::Counts { samples, hermite } = &*brick else { return Ok(None) };
        let signs = SignChanges::of(samples);
        if hermite.edges.each_ref().map(Vec::len) != signs.counts() {
            return Ok(None);
        }
        let ranks = Axis::ALL.map(|axis| signs.ranks(axis));
        let bytes = size_of::<Leaf>()
            + 3 * size_of::<Ranks>()
            + hermite.edges.iter().map(|e| 8 * e.len()).sum::<usize>();
        let leaf = Arc::new(Leaf { signs, ranks, hermite: hermite.clone() });
        self.cache.insert(key, &leaf, bytes);
        Ok(Some(leaf))
    }

    /// The crossing on an edge of the cell around a place that is nearest to it, in units from the root's first sample, with
    /// its leaf.
    fn nearest(&self, at: [f64; 3]) -> Result<Option<(NodeKey, Edge, HermiteEdge)>> {
        let Some(deepest) = NodeKey::deepest_holding(at) else { return Ok(None) };
        let key = self.order.keys()[self.order.covering(deepest)];
        let Some(leaf) = self.leaf(key)? else { return Ok(None) };
        let (base, spacing) = (key.base().map(f64::from), f64::from(1u32 << key.spacing_bits()));
        let local: [f64; 3] = std::array::from_fn(|a| (at[a] - base[a]) / spacing);
        let low = local.map(|c| (c.max(0.0) as usize).min(BRICK_CELLS - 1));
        let mut best = (f64::INFINITY, None);
        for axis in Axis::ALL {
            let [u, v] = axis.others_in_order().map(Axis::index);
            for corner in 0..4 {
                let mut sample = low;
                sample[u] += corner & 1;
                sample[v] += corner >> 1;
                let Some(found) = leaf.on((axis, sample)) else { continue };
                let mut point = sample.map(|c| c as f64);
                point[axis.index()] += found.fraction();
                let squared = (0..3).map(|a| (point[a] - local[a]).powi(2)).sum::<f64>();
                if squared < best.0 {
                    best = (squared, Some((key, (axis, sample), found)));
                }
            }
        }
        Ok(best.1)
    }

    /// The crossing on a lattice edge of a leaf of the other tree, if there is one; `None` where that lies in leaves of another
    /// level.
    fn on(&self, key: NodeKey, edge: Edge) -> Result<Option<Option<HermiteEdge>>> {
        let own = self.order.keys()[self.order.covering(key)];
        if own == key {
            return Ok(Some(self.leaf(own)?.and_then(|leaf| leaf.on(edge))));
        }
        // A coarse leaf that is all of one class has no crossing at all.
        let is_uniform = self.tree.node(own).is_some_and(|node| node.uniform().is_some());
        Ok((own.level() < key.level() && is_uniform).then_some(None))
    }
}

impl Leaf {
    fn on(&self, (axis, [i, j, k]): Edge) -> Option<HermiteEdge> {
        if self.signs.edges(axis, j, k) >> i & 1 == 0 {
            return None;
        }
        let rank = self.signs.rank(axis, [i, j, k], &self.ranks[axis.index()]);
        self.hermite.edges[axis.index()].get(rank).copied()
    }
}
