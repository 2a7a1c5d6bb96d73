//! A tree as it would be without the surfaces that are not asked for: what contours it has less to do.

use super::components::Components;
use super::labelling::Labelling;
use crate::brick::{Brick, Hermite, Samples, SignChanges};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_POINTS, NodeKey, RootCube};
use crate::store::{BrickTree, NodeInfo};
use std::sync::Arc;

/// A tree whose only void is that of some components: what else is outside counts as solid, and has no crossings. Samples and
/// crossings of those components are as they were, and so are counts in the solid.
pub(super) struct WantedVoids<'a> {
    tree: &'a dyn BrickTree,
    labelling: &'a Labelling,
    /// By component.
    wanted: Vec<bool>,
}

impl<'a> WantedVoids<'a> {
    pub fn new(tree: &'a dyn BrickTree, labelling: &'a Labelling, wanted: Vec<bool>) -> WantedVoids<'a> {
        WantedVoids { tree, labelling, wanted }
    }

    /// Whether a part of a wanted component lies in a leaf.
    pub fn is_in(&self, leaf: usize) -> bool {
        self.labelling.in_leaf(leaf).flatten().any(|component| self.wanted[component])
    }

    /// Whether a component is wanted.
    pub fn is_wanted(&self, component: usize) -> bool {
        self.wanted[component]
    }

    /// The wanted component of which parts lie in a leaf, if it is the only one.
    pub fn only_in(&self, leaf: usize) -> Option<usize> {
        let mut wanted = self.labelling.in_leaf(leaf).flatten().filter(|component| self.wanted[*component]);
        let first = wanted.next()?;
        wanted.all(|other| other == first).then_some(first)
    }

    /// Whether each of the leaf's components belongs to a wanted one.
    fn kept(&self, leaf: usize) -> Vec<bool> {
        self.labelling.in_leaf(leaf).map(|component| component.is_some_and(|c| self.wanted[c])).collect()
    }

    fn only_wanted(&self, key: NodeKey, brick: Arc<Brick>) -> Arc<Brick> {
        let leaf = self.labelling.order.covering(key);
        let kept = self.kept(leaf);
        if self.labelling.order.keys()[leaf] != key || !kept.contains(&true) {
            return Arc::new(Brick::Uniform(1));
        }
        let Brick::Counts { samples, hermite } = &*brick else { return brick };
        let signs = SignChanges::of(samples);
        let components = Components::of_signs(&signs, self.labelling.connectivity);
        let (mut samples, mut inside) = (samples.clone(), signs.clone());
        for k in 0..BRICK_POINTS {
            for j in 0..BRICK_POINTS {
                let hidden = components.row(j, k).iter().filter(|run| {
                    let label = usize::from(run.label);
                    !components.solid[label] && !kept[label]
                });
                for run in hidden {
                    fill(&mut samples, (k * BRICK_POINTS + j) * BRICK_POINTS, (run.from, run.to));
                    inside.set_row(j, k, inside.row(j, k) | run.bits());
                }
            }
        }
        let hermite = crossings(hermite, &signs, &inside);
        Arc::new(Brick::from_samples(samples, hermite))
    }
}

impl BrickTree for WantedVoids<'_> {
    fn root(&self) -> RootCube {
        self.tree.root()
    }

    fn node(&self, key: NodeKey) -> Option<NodeInfo> {
        let node = self.tree.node(key)?;
        if node.leaf && !self.is_in(self.labelling.order.covering(key)) {
            return Some(NodeInfo { min: 1, max: 1, fractions: false, ..node });
        }
        Some(node)
    }

    fn keys(&self) -> Vec<NodeKey> {
        self.tree.keys()
    }

    fn deepest_level(&self) -> u8 {
        self.tree.deepest_level()
    }

    fn brick(&self, key: NodeKey) -> Result<Arc<Brick>> {
        Ok(self.only_wanted(key, self.tree.brick(key)?))
    }

    fn brick_once(&self, key: NodeKey) -> Result<Arc<Brick>> {
        Ok(self.only_wanted(key, self.tree.brick_once(key)?))
    }

    fn ahead(&self, keys: &[NodeKey]) -> usize {
        self.tree.ahead(keys)
    }

    fn is_elsewhere(&self) -> bool {
        self.tree.is_elsewhere()
    }
}

/// Makes a run of a row solid.
fn fill(samples: &mut Samples, row: usize, (from, to): (u8, u8)) {
    let solid = 1 << samples.1;
    samples.0[row + usize::from(from)..row + usize::from(to)].fill(solid);
}

/// The crossings of edges that still change sign. Void that is kept has only solid and its own component beside it, so no
/// edge is new.
fn crossings(hermite: &Hermite, signs: &SignChanges, kept: &SignChanges) -> Hermite {
    let mut out = Hermite::default();
    if hermite.edges.each_ref().map(Vec::len) != signs.counts() {
        return out;
    }
    for axis in Axis::ALL {
        signs.for_crossings(axis, hermite, |[i, j, k], edge| {
            if kept.edges(axis, j, k) >> i & 1 == 1 {
                out.edges[axis.index()].push(edge);
            }
        });
    }
    out
}
