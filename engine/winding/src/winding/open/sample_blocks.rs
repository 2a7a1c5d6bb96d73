//! The samples of a brick in blocks that are answered together.

use crate::lattice::{BRICK_POINTS, NodeKey, Units};

/// Samples along a row.
const P: usize = BRICK_POINTS;
/// log₂ of the samples along a block, which are answered together.
pub(super) const BLOCK_BITS: u32 = 3;

/// Calls `block` with the samples of a brick, those of one block at a time: log₂ of their distance, and their positions
/// with their linear indices.
pub(super) fn for_blocks(key: NodeKey, mut block: impl FnMut(u32, &[(Units, u16)])) {
    let mut samples = Vec::new();
    let (base, bits) = (key.base(), key.spacing_bits());
    for up in 0..=u32::from(key.level()) {
        let axes = key.first_sample().map(|first| blocks_along(first, up));
        for z in &axes[2] {
            for y in &axes[1] {
                for x in &axes[0] {
                    samples.clear();
                    for_own(key, up, [x, y, z], |index| {
                        samples.push((position(base, bits, index), index as u16))
                    });
                    block(key.spacing_bits() + up, &samples);
                }
            }
        }
    }
}

/// The samples 0..=32 along an axis, the first of which has the number `first` on its level's lattice, that lie on the
/// lattice `up` levels above, by the block there.
fn blocks_along(first: u32, up: u32) -> Vec<Vec<u32>> {
    let on_lattice: Vec<u32> = (0..P as u32).filter(|i| (first + i) & ((1 << up) - 1) == 0).collect();
    let block = |i: &u32| (first + i) >> (up + BLOCK_BITS);
    on_lattice.chunk_by(|a, b| block(a) == block(b)).map(<[u32]>::to_vec).collect()
}

/// Calls `sample` with the linear index of each sample of a block that lies on no coarser lattice.
fn for_own(key: NodeKey, up: u32, [xs, ys, zs]: [&[u32]; 3], mut sample: impl FnMut(usize)) {
    let first = key.first_sample();
    let is_top = up == u32::from(key.level());
    let even = |axis: usize, i: u32| ((first[axis] + i) >> up) & 1 == 0;
    for &k in zs {
        for &j in ys {
            let coarser = !is_top && even(2, k) && even(1, j);
            for &i in xs {
                if !(coarser && even(0, i)) {
                    sample(((k as usize * P) + j as usize) * P + i as usize);
                }
            }
        }
    }
}

/// Lattice position of a sample by its linear index, in a brick with this lower corner and log₂ of the spacing.
#[inline]
fn position(base: Units, bits: u32, index: usize) -> Units {
    let ijk = [index % P, index / P % P, index / (P * P)];
    std::array::from_fn(|a| base[a] + ((ijk[a] as i32) << bits) + 1)
}
