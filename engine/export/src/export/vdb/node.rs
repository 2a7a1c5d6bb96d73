//! A node of 16³ leaves, from the bricks that it spans.

use super::pack::{Inactive, Mask, put_values};
use crate::export::compress::Zlib;

/// Leaves of a node along an axis.
const LEAVES: usize = 16;
/// Leaves of a brick along an axis.
const BRICK_LEAVES: usize = 4;
/// Voxels of a leaf along an axis.
const LEAF: usize = 8;

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
    zlib: Zlib,
}

impl NodeBuilder {
    /// With the bits of the background, and in level sets those of its opposite.
    pub(super) fn new(outer: u32, inner: Option<u32>) -> NodeBuilder {
        let entries = vec![Entry::Empty; LEAVES.pow(3)];
        NodeBuilder { outer, inner, entries, packed: Vec::new(), zlib: Zlib::new() }
    }

    /// Adds a brick of one value, which is not the background.
    pub(super) fn add_uniform(&mut self, place: [u32; 3], value: u32) {
        let entry = if self.inner == Some(value) { Entry::Inner } else { Entry::Tile(value) };
        for leaf in brick_leaves() {
            self.entries[index(place, leaf)] = entry;
        }
    }

    /// Adds a brick by the bits of its samples.
    pub(super) fn add(&mut self, place: [u32; 3], sample: impl Fn([usize; 3]) -> u32) {
        let mut values = Vec::with_capacity(LEAF.pow(3));
        for leaf in brick_leaves() {
            let (mut mask, mut inactive) = (Mask::<64>::new(), Inactive::<64>::new());
            values.clear();
            for n in 0..LEAF.pow(3) {
                let within = [n / LEAF / LEAF, n / LEAF % LEAF, n % LEAF];
                let value = sample(std::array::from_fn(|a| leaf[a] * LEAF + within[a]));
                if value == self.outer {
                    inactive.outer.set(n);
                } else if Some(value) == self.inner {
                    inactive.inner.set(n);
                } else {
                    mask.set(n);
                    values.push(value);
                }
            }
            self.entries[index(place, leaf)] = self.entry(&mask, &values, &inactive);
        }
    }

    fn entry(&mut self, mask: &Mask<64>, values: &[u32], inactive: &Inactive<64>) -> Entry {
        match values.first() {
            None if inactive.inner.is_empty() => Entry::Empty,
            None if inactive.outer.is_empty() => Entry::Inner,
            Some(&first) if values.len() == LEAF.pow(3) && values.iter().all(|&value| value == first) => {
                Entry::Tile(first)
            }
            _ => {
                let start = self.packed.len();
                self.packed.extend(mask.bytes());
                put_values(&mut self.packed, values, inactive, &mut self.zlib);
                Entry::Leaf(start, self.packed.len())
            }
        }
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
        put_values(&mut topology, &tiles, &inactive, &mut self.zlib);
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
