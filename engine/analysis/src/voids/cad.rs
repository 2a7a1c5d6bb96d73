//! What of each void lies inside another tree on the same lattice, as that of a CAD part.

use super::components::Components;
use super::labelling::Labelling;
use crate::brick::Brick;
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey};
use crate::progress::Progress;
use crate::store::{BrickTree, Leaf};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A brick of the other tree for the samples of a node: of the node itself, or of a leaf above it.
pub(super) struct CadBrick {
    brick: Arc<Brick>,
    /// Levels between the two.
    up: u32,
    /// The node's first sample, in the node's steps from the brick's first one.
    first: [usize; 3],
}

impl CadBrick {
    /// The brick for a node's samples; `None` outside the tree, which does not happen.
    pub fn of(tree: &dyn BrickTree, key: NodeKey) -> Result<Option<CadBrick>> {
        let above = (0..=key.level()).rev().filter_map(|level| key.ancestor(level));
        let Some(node) = above.into_iter().find(|above| tree.node(*above).is_some()) else { return Ok(None) };
        let bits = key.spacing_bits();
        let first = [0, 1, 2].map(|a| ((key.base()[a] - node.base()[a]) >> bits) as usize);
        Ok(Some(CadBrick { brick: tree.brick(node)?, up: u32::from(key.level() - node.level()), first }))
    }

    pub fn is_solid(&self, at: [usize; 3]) -> bool {
        self.brick.sample([0, 1, 2].map(|a| (self.first[a] + at[a]) >> self.up)) >= 1
    }
}

/// The share of the samples of each void, by component, at which `cad` is solid. Where a leaf of `cad` ends above the void's level, its
/// nearest sample that is not above along any axis counts.
///
/// # Errors
/// What reading the trees gives; [`crate::error::Error::Interrupted`].
pub(super) fn cad_shares(
    tree: &dyn BrickTree,
    cad: &dyn BrickTree,
    labelling: &Labelling,
    is_void: &(dyn Fn(usize) -> bool + Sync),
    progress: &dyn Progress,
) -> Result<BTreeMap<usize, f64>> {
    let is_wanted = |leaf: usize| labelling.in_leaf(leaf).flatten().any(is_void);
    let make = |number: usize, leaf: &Leaf<'_>, components: &Components| {
        let mut counts: BTreeMap<usize, [u128; 2]> = BTreeMap::new();
        let Some(held) = CadBrick::of(cad, leaf.key)? else { return Ok(counts) };
        let cells = 3 * leaf.key.spacing_bits();
        for (j, k) in (0..BRICK_CELLS).flat_map(|k| (0..BRICK_CELLS).map(move |j| (j, k))) {
            for run in components.row(j, k) {
                let void = labelling.of(number, run.label).filter(|component| is_void(*component));
                let Some(component) = void else { continue };
                let own = usize::from(run.from)..usize::from(run.to).min(BRICK_CELLS);
                let inside = own.clone().filter(|&i| held.is_solid([i, j, k])).count();
                let count = counts.entry(component).or_default();
                count[0] += (inside as u128) << cells;
                count[1] += (own.len() as u128) << cells;
            }
        }
        Ok(counts)
    };
    let mut all: BTreeMap<usize, [u128; 2]> = BTreeMap::new();
    labelling.visit_some(tree, is_wanted, ("voids in the CAD part", progress), make, |counts| {
        for (component, [inside, samples]) in counts {
            let count = all.entry(component).or_default();
            *count = [count[0] + inside, count[1] + samples];
        }
        Ok(())
    })?;
    Ok(all.into_iter().map(|(c, [inside, all])| (c, inside as f64 / all.max(1) as f64)).collect())
}
