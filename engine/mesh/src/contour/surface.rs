//! The surface as one leaf sees it: signs at its 33³ samples and a Hermite edge on every sign change.

use super::leaves::ContourLeaf;
use super::planes::{EdgePlane, decode};
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, Ranks, Samples, SignChanges};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_POINTS, NodeKey, Octant};
use crate::store::{BrickTree, tell_below};
use std::sync::Arc;

/// Rows of samples along x in a brick.
const ROWS: usize = BRICK_POINTS * BRICK_POINTS;

/// Signs and Hermite edges of a leaf.
pub(super) enum LeafSurface {
    /// All samples lie inside, or all outside.
    Uniform(bool),
    /// Samples of both kinds.
    Changes(Box<HermiteSurface>),
}

/// By axis and row of lower samples, how many edges with a sign change come before.
pub(super) type EdgeRanks = [Box<Ranks>; 3];

/// Those of some signs.
pub(super) fn edge_ranks(signs: &SignChanges) -> EdgeRanks {
    let mut ranks = Axis::ALL.map(|axis| signs.ranks(axis));
    let mut before = 0;
    for ranks in &mut ranks {
        for rank in ranks.iter_mut() {
            *rank += before;
        }
        before = ranks[ROWS];
    }
    ranks
}

/// Signs and Hermite edges of a leaf with sign changes.
pub(super) struct HermiteSurface {
    pub signs: SignChanges,
    /// Hermite edges, those along x first, in the order of the linear index of the edge's lower sample.
    pub planes: Vec<EdgePlane>,
    ranks: Arc<EdgeRanks>,
}

/// Which level set of the samples is contoured.
#[derive(Clone, Copy, Debug)]
pub(super) struct IsoLevel {
    /// A sample, rounded to a whole number, is inside from this value on.
    pub threshold: i32,
    pub iso: f64,
}

impl IsoLevel {
    /// Stored Hermite edges belong to w = 0.5. Samples being integers, every level above 0 and up to 1 is
    /// the same surface.
    fn has_hermite(self) -> bool {
        self.threshold == 1
    }
}

impl LeafSurface {
    /// Reads a leaf's surface.
    pub(super) fn load(tree: &dyn BrickTree, leaf: &ContourLeaf, level: IsoLevel) -> Result<LeafSurface> {
        if !leaf.changes {
            return Ok(LeafSurface::Uniform(leaf.inside));
        }
        // The surface is what is kept.
        let brick = tree.brick_once(leaf.key)?;
        let (samples, hermite) = match &*brick {
            Brick::Counts { samples, hermite } => (samples, hermite),
            Brick::Uniform(w) => return Ok(LeafSurface::Uniform(i32::from(*w) >= level.threshold)),
        };
        let signs = signs(samples, level);
        let is_complete = hermite.edges.each_ref().map(Vec::len) == signs.counts();
        let planes = if !level.has_hermite() || (leaf.is_tree_leaf && !is_complete) {
            decoded(&from_samples(&signs, samples, level.iso))
        } else if leaf.is_tree_leaf {
            decoded(hermite)
        } else {
            tell_below(tree, leaf.key);
            decoded(&from_children(tree, leaf.key, &signs, level)?)
        };
        Ok(LeafSurface::Changes(Box::new(HermiteSurface::new(signs, planes))))
    }

    /// The edges that change sign, if any does.
    pub(super) fn changes(&self) -> Option<&HermiteSurface> {
        match self {
            LeafSurface::Uniform(_) => None,
            LeafSurface::Changes(changes) => Some(changes),
        }
    }

    /// True if the sample lies inside.
    pub(super) fn is_inside(&self, ijk: [usize; 3]) -> bool {
        match self {
            LeafSurface::Uniform(inside) => *inside,
            LeafSurface::Changes(changes) => changes.signs.is_inside(ijk),
        }
    }

    /// Corner mask of a cell: bit `c` is set where corner `c` is inside.
    pub(super) fn mask(&self, cell: [usize; 3]) -> u8 {
        match self {
            LeafSurface::Uniform(inside) => u8::from(*inside) * u8::MAX,
            LeafSurface::Changes(changes) => changes.mask(cell),
        }
    }

    /// Heap bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        match self {
            LeafSurface::Uniform(_) => 0,
            LeafSurface::Changes(c) => {
                ROWS * 8 + 3 * size_of::<Ranks>() + c.planes.capacity() * size_of::<EdgePlane>()
            }
        }
    }
}

impl HermiteSurface {
    /// One plane for each edge that changes sign.
    fn new(signs: SignChanges, planes: Vec<EdgePlane>) -> HermiteSurface {
        let ranks = Arc::new(edge_ranks(&signs));
        HermiteSurface { signs, planes, ranks }
    }

    /// Corner mask of a cell, as in [`LeafSurface::mask`].
    #[inline(always)]
    pub(super) fn mask(&self, [i, j, k]: [usize; 3]) -> u8 {
        let pair = |j, k| (self.signs.row(j, k) >> i) as u8 & 3;
        pair(j, k) | pair(j + 1, k) << 2 | pair(j, k + 1) << 4 | pair(j + 1, k + 1) << 6
    }

    pub(super) fn ranks(&self) -> &Arc<EdgeRanks> {
        &self.ranks
    }

    /// The Hermite edge along `axis` that starts at sample (i, j, k), which changes sign.
    pub(super) fn plane(&self, axis: Axis, ijk: [usize; 3]) -> &EdgePlane {
        &self.planes[self.slot(axis, ijk)]
    }

    /// How many planes come before those of the edges along `axis` in a row of lower samples.
    #[inline(always)]
    pub(super) fn before(&self, axis: Axis, j: usize, k: usize) -> u32 {
        self.ranks[axis.index()][k * BRICK_POINTS + j]
    }

    /// Place in `planes` of the edge along `axis` that starts at sample (i, j, k).
    #[inline(always)]
    pub(super) fn slot(&self, axis: Axis, ijk: [usize; 3]) -> usize {
        self.signs.rank(axis, ijk, &self.ranks[axis.index()])
    }
}

fn signs(samples: &Samples, level: IsoLevel) -> SignChanges {
    if level.threshold == 1 {
        return SignChanges::of(samples);
    }
    SignChanges::from_fn(|index| i32::from(samples.whole(samples.0[index])) >= level.threshold)
}

/// Hermite edges of a level set that the store keeps none for: the crossing where the samples interpolate
/// to `iso`, the normal from −∇w by central differences, one-sided at the border of the brick.
fn from_samples(signs: &SignChanges, samples: &Samples, iso: f64) -> Hermite {
    let iso = iso * f64::from(1u32 << samples.1);
    let edges = Axis::ALL.map(|axis| {
        let mut edges = Vec::new();
        signs.for_edges(axis, |low| {
            let mut high = low;
            high[axis.index()] += 1;
            let (w0, w1) = (f64::from(samples.at(low)), f64::from(samples.at(high)));
            let fraction = ((iso - w0) / (w1 - w0)).clamp(0.0, 1.0);
            let offset = (fraction * 65536.0).min(65535.0) as u16;
            let mut normal =
                std::array::from_fn(|a| -(gradient(samples, low, a) + gradient(samples, high, a)));
            if normal == [0; 3] {
                normal[axis.index()] = if w0 > w1 { 1 } else { -1 };
            }
            edges.push(HermiteEdge { offset, normal: OctNormal::from_integer(normal) });
        });
        edges
    });
    Hermite { edges }
}

/// Twice ∂w/∂axis at a sample, per sample spacing.
fn gradient(samples: &Samples, at: [usize; 3], axis: usize) -> i64 {
    let (mut low, mut high) = (at, at);
    low[axis] = at[axis].saturating_sub(1);
    high[axis] = (at[axis] + 1).min(BRICK_POINTS - 1);
    let difference = i64::from(samples.at(high)) - i64::from(samples.at(low));
    if high[axis] - low[axis] == 2 { difference } else { 2 * difference }
}

/// The edges of all axes.
fn decoded(hermite: &Hermite) -> Vec<EdgePlane> {
    let mut planes = Vec::with_capacity(hermite.len());
    hermite.edges.iter().for_each(|edges| decode(edges, &mut planes));
    planes
}

/// Hermite edges of an interior node from its children's.
fn from_children(
    tree: &dyn BrickTree,
    key: NodeKey,
    signs: &SignChanges,
    level: IsoLevel,
) -> Result<Hermite> {
    let mut children = [const { None }; 8];
    for (octant, child) in Octant::all().zip(&mut children) {
        *child = edges_of(tree, key.child(octant), level)?;
    }
    Hermite::from_children(signs, &children).ok_or_else(|| super::leaves::broken(key))
}

/// Signs and Hermite edges of a node; `None` where all samples lie inside, or all outside.
fn edges_of(tree: &dyn BrickTree, key: NodeKey, level: IsoLevel) -> Result<Option<(SignChanges, Hermite)>> {
    let info = tree.node(key).ok_or_else(|| super::leaves::broken(key))?;
    if i32::from(info.max) < level.threshold || i32::from(info.min) >= level.threshold {
        return Ok(None);
    }
    let brick = tree.brick(key)?;
    let Brick::Counts { samples, hermite } = &*brick else { return Ok(None) };
    let signs = signs(samples, level);
    let edges = match info.leaf {
        true if hermite.edges.each_ref().map(Vec::len) == signs.counts() => hermite.clone(),
        true => from_samples(&signs, samples, level.iso),
        false => from_children(tree, key, &signs, level)?,
    };
    Ok(Some((signs, edges)))
}
