//! The numbers of voids as a dense grid of the deepest level, those behind throats as well if they were asked for.

use super::components::Components;
use super::find::Voids;
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey};
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
                match (labelling.of(number, run.label), &found.pores) {
                    (None, Some(pores)) => own.for_each(|i| {
                        let pore = pores.at(sample_of(leaf.key, [i, j, k]));
                        let void = pore.map_or(0, |pore| numbers[labelling.components.len() + pore]);
                        row.extend(void.to_le_bytes().repeat(step));
                    }),
                    (component, _) => {
                        let void = component.map_or(0, |c| numbers[c]);
                        row.extend(void.to_le_bytes().repeat(own.len() * step));
                    }
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

/// Where a sample lies, in units from the root's first sample.
fn sample_of(key: NodeKey, at: [usize; 3]) -> [f64; 3] {
    let spacing = f64::from(1u32 << key.spacing_bits());
    std::array::from_fn(|a| f64::from(key.base()[a]) + at[a] as f64 * spacing)
}
