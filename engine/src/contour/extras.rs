//! Vertices on faces, and the names by which they are found.

use super::topology::edge_lower;
use crate::brick::{POINTS, point_index};
use crate::lattice::{Axis, BRICK_POINTS, NodeKey};

/// Name, relative to a corner `from` that it shares its cell or face with, of a minimal edge: `relative` is
/// its lower end minus the corner in units.
#[inline]
pub(super) fn edge_key(relative: [i32; 3], axis: Axis, level: u8) -> u64 {
    // Spacings are multiples of 8 units, and no cell is larger than 2^19.
    let [x, y, z] = relative.map(|r| (r >> 3) as u64);
    x | y << 17 | z << 34 | (axis.index() as u64) << 51 | u64::from(level) << 53
}

/// Name, relative to the lower corner of a face across `axis`, of edge number `edge` of a plain cell of `leaf`, which
/// bounds the face.
pub(super) fn plain_edge_key(edge: usize, axis: Axis, leaf: NodeKey) -> u64 {
    let (along, mut offset) = edge_lower(edge);
    offset[axis.index()] = 0;
    edge_key(offset.map(|o| (o as i32) << leaf.spacing_bits()), along, leaf.level())
}

/// Name within a leaf of the face across `axis` with this lower corner.
#[inline]
pub(super) fn face_key(axis: Axis, corner: [usize; 3]) -> u32 {
    (axis.index() * POINTS + point_index(corner)) as u32
}

/// What [`face_key`] names.
#[inline]
pub(super) fn face_of(face: u32) -> (Axis, [usize; 3]) {
    let (axis, at) = (face as usize / POINTS, face as usize % POINTS);
    (
        Axis::ALL[axis],
        [at % BRICK_POINTS, at / BRICK_POINTS % BRICK_POINTS, at / (BRICK_POINTS * BRICK_POINTS)],
    )
}

/// The vertex on one cut of a split face, found from either edge that the cut joins.
pub(super) struct Extra {
    pub face: u32,
    pub edge: u64,
    pub vertex: u32,
}

/// The vertex on the cut of a face that ends at a minimal edge, in a list sorted by both.
pub(super) fn found_extra(extras: &[Extra], face: u32, edge: u64) -> Option<u32> {
    if extras.is_empty() {
        return None;
    }
    let found = extras.binary_search_by_key(&(face, edge), |e| (e.face, e.edge));
    found.ok().map(|n| extras[n].vertex)
}
