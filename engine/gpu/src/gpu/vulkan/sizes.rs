//! How large a batch may be, and where its parts lie in the buffers.

use super::exchange::BufferLayout;
use super::memory::in_a_row;
use brickfield_shaders::{BRICK_BUFFERS, Batch, Brick, JUMP_WORDS, PAIR_WORDS, ROWS, TABLE_WORDS, WORKGROUP};

/// What a batch has room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BatchCapacity {
    pub bricks: u32,
    pub pairs: u32,
    pub edges: u32,
    /// Spans on the way to a sample.
    pub way_spans: u32,
    /// Other spans.
    pub other_spans: u32,
    /// Crossings of sign-changing edges behind their second.
    pub more: u32,
}

/// Pairs of a triangle and a brick for which a brick makes room. Leaves of a part have 100 to 2,000; those with more
/// share the room of others.
const PAIRS_OF_BRICK: u32 = 2048;
/// Sign-changing edges for which a brick makes room: a plane through it has 3,000.
const EDGES_OF_BRICK: u32 = 8192;
/// Crossings of these edges behind their second. Beads that overlap have two to three on an edge.
const MORE_OF_BRICK: u32 = EDGES_OF_BRICK / 2;
/// Spans of lattice lines along x. A triangle that is larger than a cell has a span a row, a plane some 30 to 100.
const WAY_SPANS_OF_BRICK: u32 = 6144;
/// Spans along y and z.
const OTHER_SPANS_OF_BRICK: u32 = 10240;
/// Bricks of a batch at most: as many as the subtrees of the usual depths have leaves. Decoded they take 7 MB.
const BRICKS_MAX: u32 = 64;

/// Buffers that are uploaded, the first ones: batch, bricks, pairs.
pub(super) const UPLOADED: usize = 3;
/// Buffers that begin with zeros: jumps, counts, tables.
pub(super) const ZEROED: [usize; 3] = [3, 4, 6];
/// The buffer that begins with zeros and ends with them: chains.
pub(super) const CHAINS: usize = 7;
/// Buffers that are read back: bricks, jumps, rows, hermite.
pub(super) const READ: [usize; 4] = [1, 3, 5, 8];

impl BatchCapacity {
    /// For this many bricks.
    pub fn of(bricks: u32) -> BatchCapacity {
        let pairs = bricks * PAIRS_OF_BRICK;
        BatchCapacity {
            bricks,
            pairs,
            edges: bricks * EDGES_OF_BRICK,
            way_spans: bricks * WAY_SPANS_OF_BRICK,
            other_spans: bricks * OTHER_SPANS_OF_BRICK,
            more: bricks * MORE_OF_BRICK,
        }
    }

    /// The most that fits in `bytes`, all buffers of a slot taken together, those for copies only if it `stages`; at least
    /// one brick. No buffer is longer than `range_max`.
    pub fn within(bytes: u64, range_max: u64, stages: bool) -> BatchCapacity {
        let fits = |bricks: &u32| {
            let sizes = BatchCapacity::of(*bricks);
            let layout = sizes.layout();
            layout.total_bytes(stages) <= bytes
                && layout.is_seen(range_max)
                && sizes.pairs / WORKGROUP < 1 << 16
        };
        (2..=BRICKS_MAX).rev().find(fits).map_or(BatchCapacity::of(1), BatchCapacity::of)
    }

    /// Bytes of each buffer.
    pub fn lengths(&self) -> [u64; BRICK_BUFFERS.len()] {
        let words = |count: u32, words: u32| u64::from(count) * u64::from(words) * 4;
        [
            size_of::<Batch>() as u64,
            u64::from(self.bricks) * size_of::<Brick>() as u64,
            words(self.pairs, PAIR_WORDS),
            words(self.bricks, JUMP_WORDS),
            words(self.edges.div_ceil(2), 1),
            words(self.bricks, 2 * ROWS),
            words(self.bricks, TABLE_WORDS),
            words(self.edges, 1),
            words(self.edges, 2),
            words(self.way_spans + self.other_spans, 2),
            words(self.more, 4),
            words(self.pairs, 1),
            words(self.edges, 2),
            words(self.edges, 2),
        ]
    }

    /// Where the parts of a buffer lie.
    pub fn layout(&self) -> BufferLayout<{ BRICK_BUFFERS.len() }> {
        BufferLayout { ranges: in_a_row(self.lengths()), written: UPLOADED, read: &READ }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slot_fits_its_memory() {
        let cases = [(0, 1 << 27), (1 << 24, 1 << 27), (1 << 26, 1 << 22), (1 << 40, 1 << 40)];
        for ((bytes, range_max), stages) in cases.into_iter().flat_map(|case| [(case, false), (case, true)]) {
            let sizes = BatchCapacity::within(bytes, range_max, stages);
            let BufferLayout { ranges, .. } = sizes.layout();
            assert!(sizes.bricks == 1 || sizes.layout().total_bytes(stages) <= bytes, "{sizes:?}");
            assert!(sizes.bricks == 1 || ranges.iter().all(|(_, length)| *length <= range_max));
            assert!((1..=BRICKS_MAX).contains(&sizes.bricks));
            assert!(ranges.windows(2).all(|pair| pair[0].0 + pair[0].1 <= pair[1].0));
        }
        assert_eq!(BatchCapacity::within(1 << 40, 1 << 40, true).bricks, BRICKS_MAX);
    }
}
