//! A node of 16³ leaves, from the bricks that it spans.

use super::pack::{Inactive, Mask, ValueStreams, put_values};
use crate::lattice::BRICK_CELLS;

/// Leaves of a node along an axis.
const LEAVES: usize = 16;
/// Leaves of a brick along an axis.
const BRICK_LEAVES: usize = 4;
/// Voxels of a leaf along an axis.
const LEAF: usize = 8;
/// Voxels of a leaf.
const VOXELS: usize = LEAF * LEAF * LEAF;

/// A node's bytes.
pub(super) struct NodeBytes {
    /// Masks, tiles, and the masks of the leaves.
    pub(super) topology: Vec<u8>,
    /// Masks and values of the leaves.
    pub(super) voxels: Vec<u8>,
}

/// What a node has at a place.
#[derive(Clone, Copy)]
enum Entry {
    Empty,
    /// Inside of a level set, beyond its band.
    Inner,
    Tile(u32),
    /// Mask and values of a leaf, where they lie among the packed ones.
    Leaf(usize, usize),
}

/// Makes nodes, one after the other.
pub(super) struct NodeBuilder {
    /// Bits of the background, and of its opposite in level sets.
    outer: u32,
    inner: Option<u32>,
    entries: Vec<Entry>,
    packed: Vec<u8>,
    streams: ValueStreams,
    /// Bits of a brick's samples, x fastest.
    samples: Vec<[u32; BRICK_CELLS]>,
}

impl NodeBuilder {
    /// With the bits of the background, and in level sets those of its opposite.
    pub(super) fn new(outer: u32, inner: Option<u32>) -> NodeBuilder {
        let entries = vec![Entry::Empty; LEAVES.pow(3)];
        let samples = vec![[0; BRICK_CELLS]; BRICK_CELLS * BRICK_CELLS];
        NodeBuilder { outer, inner, entries, packed: Vec::new(), streams: ValueStreams::new(), samples }
    }

    /// Adds a brick of one value, which is not the background.
    pub(super) fn add_uniform(&mut self, place: [u32; 3], value: u32) {
        let entry = if self.inner == Some(value) { Entry::Inner } else { Entry::Tile(value) };
        for leaf in brick_leaves() {
            self.entries[index(place, leaf)] = entry;
        }
    }

    /// Adds a brick by the bits of its samples: `fill` puts in the row along x at `[y, z]`.
    pub(super) fn add(&mut self, place: [u32; 3], fill: impl Fn([usize; 2], &mut [u32; BRICK_CELLS])) {
        for (n, row) in self.samples.iter_mut().enumerate() {
            fill([n % BRICK_CELLS, n / BRICK_CELLS], row);
        }
        for leaf in brick_leaves() {
            let voxels = self.leaf(leaf);
            let first = voxels[0];
            self.entries[index(place, leaf)] =
                if voxels.iter().fold(0, |any, value| any | (value ^ first)) > 0 {
                    self.mixed(&voxels)
                } else if first == self.outer {
                    Entry::Empty
                } else if Some(first) == self.inner {
                    Entry::Inner
                } else {
                    Entry::Tile(first)
                };
        }
    }

    /// The voxels of a leaf, z fastest.
    fn leaf(&self, leaf: [usize; 3]) -> [u32; VOXELS] {
        let mut voxels = [0; VOXELS];
        let [first_x, first_y, first_z] = leaf.map(|l| l * LEAF);
        for z in 0..LEAF {
            for y in 0..LEAF {
                let row = &self.samples[(first_z + z) * BRICK_CELLS + first_y + y][first_x..first_x + LEAF];
                for (x, &value) in row.iter().enumerate() {
                    voxels[(x * LEAF + y) * LEAF + z] = value;
                }
            }
        }
        voxels
    }

    /// A leaf whose voxels are not all the same.
    fn mixed(&mut self, voxels: &[u32; VOXELS]) -> Entry {
        let (mut mask, mut inactive) = (Mask::<64>::new(), Inactive::<64>::new());
        let (mut values, mut count) = ([0; VOXELS], 0);
        // Never equal to a value that is not the background, where there is no inside.
        let inner_bits = self.inner.unwrap_or(self.outer);
        for (word, voxels) in voxels.as_chunks::<64>().0.iter().enumerate() {
            let (mut outer, mut inner) = (0, 0);
            for (bit, &value) in voxels.iter().enumerate() {
                outer |= u64::from(value == self.outer) << bit;
                inner |= u64::from(value == inner_bits) << bit;
                // What is inactive is written over by the next.
                values[count] = value;
                count += usize::from(value != self.outer && value != inner_bits);
            }
            inactive.outer.set_word(word, outer);
            inactive.inner.set_word(word, inner & !outer);
            mask.set_word(word, !(outer | inner));
        }
        let start = self.packed.len();
        self.packed.extend(mask.bytes());
        put_values(&mut self.packed, &values[..count], &inactive, &mut self.streams);
        Entry::Leaf(start, self.packed.len())
    }

    /// The node of what was added since the last one.
    pub(super) fn finish(&mut self) -> NodeBytes {
        let (mut children, mut active) = (Mask::<512>::new(), Mask::<512>::new());
        let mut inactive = Inactive::<512>::new();
        let (mut tiles, mut masks) = (Vec::new(), Vec::<u8>::new());
        let mut voxels = Vec::with_capacity(self.packed.len());
        for (n, entry) in self.entries.iter_mut().enumerate() {
            match std::mem::replace(entry, Entry::Empty) {
                Entry::Empty => inactive.outer.set(n),
                Entry::Inner => inactive.inner.set(n),
                Entry::Tile(value) => {
                    active.set(n);
                    tiles.push(value);
                }
                Entry::Leaf(start, end) => {
                    children.set(n);
                    masks.extend(&self.packed[start..start + 64]);
                    voxels.extend(&self.packed[start..end]);
                }
            }
        }
        self.packed.clear();
        let mut topology = [children.bytes(), active.bytes()].concat();
        put_values(&mut topology, &tiles, &inactive, &mut self.streams);
        topology.extend(masks);
        NodeBytes { topology, voxels }
    }
}

/// The leaves of a brick.
fn brick_leaves() -> impl Iterator<Item = [usize; 3]> {
    (0..BRICK_LEAVES.pow(3))
        .map(|n| [n / BRICK_LEAVES / BRICK_LEAVES, n / BRICK_LEAVES % BRICK_LEAVES, n % BRICK_LEAVES])
}

/// Index in the node of a leaf of the brick at `place`, x slowest.
fn index(place: [u32; 3], leaf: [usize; 3]) -> usize {
    let [x, y, z]: [usize; 3] =
        std::array::from_fn(|a| place[a] as usize % BRICK_LEAVES * BRICK_LEAVES + leaf[a]);
    (x * LEAVES + y) * LEAVES + z
}
