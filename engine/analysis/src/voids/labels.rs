//! The numbers of voids as a dense grid of the deepest level, those behind throats as well if they were asked for.

use super::components::Components;
use super::find::Voids;
use super::pores::{component_at, place_of};
use crate::error::Result;
use crate::lattice::BRICK_CELLS;
use crate::progress::Progress;
use crate::store::{BrickTree, Leaf};

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
                let own = usize::from(run.from)..usize::from(run.to).min(BRICK_CELLS);
                let void = |i: usize| {
                    let place = || place_of(leaf.key, [i, j, k]);
                    let component = component_at(labelling, found.pores.as_ref(), (number, run.label), place);
                    component.map_or(0, |c| numbers[c]).to_le_bytes()
                };
                // Samples outside may belong to several pores.
                if found.pores.is_some() && labelling.of(number, run.label).is_none() {
                    own.for_each(|i| row.extend(void(i).repeat(step)));
                } else {
                    row.extend(void(own.start).repeat(own.len() * step));
                }
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
