//! The numbers of voids at the samples, those behind throats as well if they were asked for: as a dense grid of the deepest level,
//! or as a tree for the formats of volumes.

use super::components::Components;
use super::find::Voids;
use super::pores::for_stretches;
use crate::brick::{Brick, Hermite, Samples};
use crate::error::{Error, Result};
use crate::lattice::{BRICK_CELLS, BRICK_POINTS, NodeKey, RootCube};
use crate::progress::Progress;
use crate::store::{BrickTree, Leaf, NodeInfo};
use std::sync::Arc;

/// Bytes of a label.
const LABEL_BYTES: usize = 4;

/// Writes the number of the void at each sample of the deepest level, 4 bytes, little-endian, indexed `[z][y][x]`, except
/// zeros, which whoever takes the bytes must have put there. `write_at` gets byte offsets from the first sample, from any
/// thread. Samples of leaves above the deepest level stand for their cells.
///
/// # Errors
/// What reading the tree and `write_at` give; [`crate::error::Error::Interrupted`].
pub fn write_labels(
    tree: &dyn BrickTree,
    found: &Voids,
    progress: &dyn Progress,
    write_at: &(dyn Fn(u64, &[u8]) -> Result<()> + Sync),
) -> Result<()> {
    let labelling = &found.labelling;
    let numbers = found.numbers();
    let keys = labelling.order.keys();
    let deepest = keys.iter().map(|key| key.level()).max().unwrap_or(0);
    let is_void = |leaf: usize| {
        let is_void = |component: Option<usize>| component.map_or(found.pores.is_some(), |c| numbers[c] > 0);
        labelling.in_leaf(leaf).any(is_void)
    };
    let axis = (BRICK_CELLS as u64) << deepest;
    let make = |number: usize, leaf: &Leaf<'_>, components: &Components| {
        let step = 1usize << (deepest - leaf.key.level());
        let first = leaf.key.position().map(|p| u64::from(p) * (BRICK_CELLS * step) as u64);
        for (j, k) in (0..BRICK_CELLS).flat_map(|k| (0..BRICK_CELLS).map(move |j| (j, k))) {
            let mut row: Vec<u8> = Vec::with_capacity(BRICK_CELLS * step * LABEL_BYTES);
            for run in components.row(j, k) {
                let voids = (labelling, found.pores.as_ref());
                for_stretches(voids, (number, leaf.key), (*run, j, k), |some, component| {
                    let count =
                        usize::from(some.end).min(BRICK_CELLS).saturating_sub(usize::from(some.start));
                    let void = component.map_or(0, |c| numbers[c]);
                    row.extend(void.to_le_bytes().repeat(count * step));
                });
            }
            if row.iter().all(|byte| *byte == 0) {
                continue;
            }
            for (y, z) in (0..step).flat_map(|z| (0..step).map(move |y| (y, z))) {
                let [y, z] = [first[1] + (j * step + y) as u64, first[2] + (k * step + z) as u64];
                write_at(((z * axis + y) * axis + first[0]) * LABEL_BYTES as u64, &row)?;
            }
        }
        Ok(())
    };
    labelling.visit_some(tree, is_void, ("labels of voids", progress), make, |()| Ok(()))
}

/// The numbers of voids as the samples of a tree; 0 at all others. It has the leaves of the tree that they were found in.
pub struct VoidNumbers<'a> {
    tree: &'a dyn BrickTree,
    found: &'a Voids,
    /// By component and pore.
    numbers: Vec<i16>,
}

impl<'a> VoidNumbers<'a> {
    /// Of the voids of a tree.
    ///
    /// # Errors
    /// [`Error::Setting`] if there are more than samples of 16 bits can tell apart, 32,767.
    pub fn new(tree: &'a dyn BrickTree, found: &'a Voids) -> Result<VoidNumbers<'a>> {
        let number = |number: u32| {
            i16::try_from(number).map_err(|_| {
                let what = format!("{} voids are more than 16 bits tell apart", found.voids.len());
                Error::setting(what, "leave small ones out with `min_volume`, or write .npy, which has 32")
            })
        };
        let numbers = found.numbers().into_iter().map(number).collect::<Result<Vec<i16>>>()?;
        Ok(VoidNumbers { tree, found, numbers })
    }

    fn numbered(&self, key: NodeKey, brick: &Brick) -> Brick {
        let labelling = &self.found.labelling;
        let leaf = labelling.order.covering(key);
        if labelling.order.keys()[leaf] != key {
            return Brick::Uniform(0);
        }
        let components = Components::of(brick, labelling.connectivity).0;
        let mut samples = Samples::filled(0);
        for (row, numbers) in samples.0.chunks_exact_mut(BRICK_POINTS).enumerate() {
            let (j, k) = (row % BRICK_POINTS, row / BRICK_POINTS);
            for run in components.row(j, k) {
                let voids = (labelling, self.found.pores.as_ref());
                for_stretches(voids, (leaf, key), (*run, j, k), |some, component| {
                    let void = component.map_or(0, |c| self.numbers[c]);
                    numbers[usize::from(some.start)..usize::from(some.end)].fill(void);
                });
            }
        }
        Brick::from_samples(samples, Hermite::default())
    }
}

impl BrickTree for VoidNumbers<'_> {
    fn root(&self) -> RootCube {
        self.tree.root()
    }

    fn node(&self, key: NodeKey) -> Option<NodeInfo> {
        let leaf = self.tree.node(key)?.leaf;
        let (mut min, mut max) = (0, i16::MAX);
        if leaf {
            let labelling = &self.found.labelling;
            // What is outside may have pores.
            let number = |component: Option<usize>| match component {
                Some(component) => [self.numbers[component]; 2],
                None if self.found.pores.is_none() => [0; 2],
                None => [0, i16::MAX],
            };
            let numbers = labelling.in_leaf(labelling.order.covering(key)).map(number);
            [min, max] = numbers.fold([i16::MAX, 0], |[low, high], [a, b]| [low.min(a), high.max(b)]);
        }
        Some(NodeInfo { leaf, min, max, fractions: false })
    }

    fn keys(&self) -> Vec<NodeKey> {
        self.tree.keys()
    }

    fn deepest_level(&self) -> u8 {
        self.tree.deepest_level()
    }

    fn brick(&self, key: NodeKey) -> Result<Arc<Brick>> {
        Ok(Arc::new(self.numbered(key, &*self.tree.brick(key)?)))
    }

    fn brick_once(&self, key: NodeKey) -> Result<Arc<Brick>> {
        Ok(Arc::new(self.numbered(key, &*self.tree.brick_once(key)?)))
    }

    fn ahead(&self, keys: &[NodeKey]) -> usize {
        self.tree.ahead(keys)
    }

    fn is_elsewhere(&self) -> bool {
        self.tree.is_elsewhere()
    }
}
