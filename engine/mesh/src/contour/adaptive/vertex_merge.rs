//! What vertices become when they are merged, and when places are the same.

use crate::lattice::{BRICK_BITS, hash_bits};

/// Nodes of a leaf's cells are 2 to the power of 1 up to this many cells wide.
pub(super) const LEVELS: u8 = BRICK_BITS as u8;

/// Stands for a vertex that is not merged, or that is no more.
pub(super) const NONE: u32 = u32::MAX;

/// What a vertex becomes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum VertexMerge {
    /// Itself.
    Own,
    /// One of the leaf's candidates.
    Candidate(u32),
    /// One of several leaves'.
    Wide(u32),
}

/// A hash of a place.
pub(super) fn hash(place: &[u32; 3]) -> u64 {
    hash_bits(place.map(u64::from))
}

/// What tells a place from others: 0 and −0 are one.
pub(super) fn bits(position: &[f32; 3]) -> [u32; 3] {
    position.map(|c| (c + 0.0).to_bits())
}
