//! Which void a place belongs to, for whoever draws voids.

use super::components::Components;
use super::find::Voids;
use super::pores::{component_at, place_of};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey};
use crate::store::{BrickCache, BrickTree};
use std::sync::Arc;

/// The voids of a tree by place, those that open through a throat as well if they were asked for.
pub struct VoidPlaces<'a> {
    tree: &'a dyn BrickTree,
    found: &'a Voids,
    /// By component, and behind them by pore, the number of its void; 0 of all that are none.
    numbers: Vec<u32>,
    /// By leaf, how many before it hold a part of a void; the last number is that of all.
    before: Vec<u32>,
    cache: BrickCache<Components>,
}

impl<'a> VoidPlaces<'a> {
    /// Of the voids that were found in a tree. The components of leaves are kept in so many bytes.
    pub fn new(tree: &'a dyn BrickTree, found: &'a Voids, cache_bytes: u64) -> VoidPlaces<'a> {
        let (labelling, numbers) = (&found.labelling, found.numbers());
        let has_pore = |leaf: usize| {
            let key = labelling.order.keys()[leaf];
            let [low, high] = [0, BRICK_CELLS].map(|end| place_of(key, [end; 3]));
            found.pores.as_ref().is_some_and(|pores| pores.any_in(low, high))
        };
        let has_outer = |leaf: usize| labelling.in_leaf(leaf).any(|c| c.is_none());
        let has_void = |leaf: usize| {
            labelling.in_leaf(leaf).flatten().any(|c| numbers[c] > 0) || (has_outer(leaf) && has_pore(leaf))
        };
        let mut before = vec![0];
        let mut count = 0;
        for leaf in 0..labelling.order.keys().len() {
            count += u32::from(has_void(leaf));
            before.push(count);
        }
        VoidPlaces { tree, found, numbers, before, cache: BrickCache::new(cache_bytes) }
    }

    /// Whether a node, or a leaf below it, or the leaf around it, holds a part of a void.
    pub fn any_in(&self, key: NodeKey) -> bool {
        let order = &self.found.labelling.order;
        let from = order.covering(key);
        let to = order.keys().partition_point(|leaf| leaf.post_order().0 <= key.post_order().0);
        self.before[to.max(from + 1)] > self.before[from]
    }

    /// The number of the void at a place in units from the root's first sample: that of the nearest sample of void among the
    /// corners of its cell. 0 where there is none, and outside of the part.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub fn number(&self, at: [f64; 3]) -> Result<u32> {
        let labelling = &self.found.labelling;
        let Some(deepest) = NodeKey::deepest_holding(at) else { return Ok(0) };
        let leaf = labelling.order.covering(deepest);
        if self.before[leaf + 1] == self.before[leaf] {
            return Ok(0);
        }
        let key = labelling.order.keys()[leaf];
        if self.tree.node(key).is_some_and(|node| node.uniform().is_some()) {
            return Ok(self.number_of(leaf, 0, at));
        }
        let components = match self.cache.get(key) {
            Some(components) => components,
            None => {
                let components = Arc::new(labelling.components_of(self.tree, leaf)?);
                self.cache.insert(key, &components, components.heap_bytes());
                components
            }
        };
        let (base, spacing) = (key.base().map(f64::from), f64::from(1u32 << key.spacing_bits()));
        let local: [f64; 3] = std::array::from_fn(|a| (at[a] - base[a]) / spacing);
        Ok(nearest_void(&components, local)
            .map_or(0, |(label, sample)| self.number_of(leaf, label, place_of(key, sample))))
    }

    /// The number of the void that a place with a label in a leaf belongs to.
    fn number_of(&self, leaf: usize, label: u16, place: [f64; 3]) -> u32 {
        let Voids { labelling, pores, .. } = self.found;
        let component = component_at(labelling, pores.as_ref(), (leaf, label), || place);
        component.map_or(0, |component| self.numbers[component])
    }
}

/// The component of the nearest sample of void among the corners of the cell that holds a place, in cells from the first sample,
/// and that sample.
fn nearest_void(components: &Components, at: [f64; 3]) -> Option<(u16, [usize; 3])> {
    let low = at.map(|c| (c.max(0.0) as usize).min(BRICK_CELLS - 1));
    let mut best = (f64::INFINITY, None);
    for corner in 0..8 {
        let sample: [usize; 3] = std::array::from_fn(|a| low[a] + (corner >> a & 1));
        let label = components.at(sample);
        let squared = (0..3).map(|a| (at[a] - sample[a] as f64).powi(2)).sum::<f64>();
        if !components.solid[usize::from(label)] && squared < best.0 {
            best = (squared, Some((label, sample)));
        }
    }
    best.1
}
