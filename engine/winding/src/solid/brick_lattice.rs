//! The samples of a brick and the segments that touch it, as evaluation, Hermite edges and hidden walls see them.

use super::segment::Segment;
use crate::lattice::{BRICK_POINTS, NodeKey, Units};

/// Where a brick's samples lie.
#[derive(Clone, Copy)]
pub(super) struct BrickLattice {
    /// Position of sample (0, 0, 0).
    pub origin: Units,
    /// log₂ of the spacing.
    pub shift: u32,
}

impl BrickLattice {
    #[inline]
    pub fn of(key: NodeKey) -> BrickLattice {
        BrickLattice { origin: key.base().map(|b| b + 1), shift: key.spacing_bits() }
    }

    /// Coordinate of a sample along an axis, relative to a position.
    #[inline]
    pub fn offset(&self, from: Units, axis: usize, index: usize) -> f64 {
        f64::from(self.origin[axis] + ((index as i32) << self.shift) - from[axis])
    }

    /// Index of the first sample along an axis that is not below the coordinate `t`, relative to the first
    /// end of a segment: from 0 to 33, which stands for none.
    #[inline]
    pub fn first_from(&self, segment: &Segment, axis: usize, t: f64) -> usize {
        self.index_from(ceil(t) + segment.a[axis], axis)
    }

    /// Index of the first sample along an axis that is not below a position.
    #[inline]
    fn index_from(&self, position: i32, axis: usize) -> usize {
        let steps = (position - self.origin[axis] + (1 << self.shift) - 1) >> self.shift;
        steps.clamp(0, BRICK_POINTS as i32) as usize
    }

    /// Indices along an axis of the samples within bounds.
    #[inline]
    pub fn within(&self, axis: usize, (min, max): (Units, Units)) -> std::ops::Range<usize> {
        self.index_from(min[axis], axis)..self.index_from(max[axis] + 1, axis)
    }
}

/// Smallest integer not below `t`, for |t| < 2^30.
#[inline]
fn ceil(t: f64) -> i32 {
    let truncated = t as i32;
    truncated + i32::from(f64::from(truncated) < t)
}

/// The samples of one row that a segment covers.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowSpan {
    /// Position of the segment in the brick's list.
    pub position: u32,
    /// k·33 + j.
    pub row: u16,
    /// First sample inside and first one beyond.
    pub first: u8,
    pub end: u8,
    /// The interval of the row, relative to the segment's first end.
    pub interval: (f64, f64),
}

impl RowSpan {
    /// Its samples as bits.
    #[inline]
    pub fn mask(self) -> u64 {
        (1 << self.end) - (1 << self.first)
    }
}

/// The segments of a brick: some of an array, by index.
#[derive(Clone, Copy)]
pub struct SegmentList<'a> {
    /// All of them.
    pub array: &'a [Segment],
    /// Those that touch the brick.
    pub indices: &'a [u32],
}

impl<'a> SegmentList<'a> {
    #[inline]
    pub(super) fn get(&self, position: u32) -> &'a Segment {
        &self.array[self.indices[position as usize] as usize]
    }
}
