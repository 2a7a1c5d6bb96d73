//! Vertices on the faces of cells with several loops, and of cells whose vertex lies beyond them, where a mesh edge
//! leaves the part of the cell that its loop has for itself ([`super::loops`]).
//!
//! They are found when the cells of both sides are known, by the leaf that owns the face: that of the finer cell, or of the
//! upper one of two of one size. Here are faces between plain cells of one size; [`find`] has those next to leaves of other
//! levels.

mod find;

pub(super) use find::find;

use super::cells::CELL_ROWS;
use super::face_vertices::{FaceVertex, found_extra};
use crate::lattice::{Axis, BRICK_CELLS};

/// The vertices on faces that a leaf owns; numbered after those of its cells.
#[derive(Default)]
pub(super) struct FaceVertices {
    /// Sorted by face and edge.
    extras: Vec<FaceVertex>,
    pub positions: Vec<[f32; 3]>,
    /// For each of them the leaf and the vertex of the cell beyond the face, and the leaf's own vertex.
    pub sides: Vec<([u32; 2], u32)>,
    /// Lower faces of the leaf's cells with extra vertices, these or those of its cells.
    split: Faces,
}

/// A set of lower faces of the cells of a leaf.
#[derive(Default)]
struct Faces {
    /// For each row of cells and axis across the faces a bit per cell; empty if no face is in it.
    rows: Vec<[u32; 3]>,
}

impl Faces {
    fn insert(&mut self, axis: usize, [i, j, k]: [usize; 3]) {
        if self.rows.is_empty() {
            self.rows.resize(CELL_ROWS, [0; 3]);
        }
        self.rows[k * BRICK_CELLS + j][axis] |= 1 << i;
    }

    #[inline]
    fn holds(&self, axis: usize, [i, j, k]: [usize; 3]) -> bool {
        self.rows.get(k * BRICK_CELLS + j).is_some_and(|row| row[axis] >> i & 1 == 1)
    }

    fn iter(&self) -> impl Iterator<Item = (usize, [usize; 3])> {
        self.rows.iter().enumerate().flat_map(|(n, row)| {
            row.iter().enumerate().flat_map(move |(axis, &row)| {
                let mut bits = row;
                std::iter::from_fn(move || {
                    let i = (bits != 0).then(|| bits.trailing_zeros() as usize)?;
                    bits &= bits - 1;
                    Some((axis, [i, n % BRICK_CELLS, n / BRICK_CELLS]))
                })
            })
        })
    }
}

impl FaceVertices {
    /// As [`BrickCells::extra`].
    pub(super) fn extra(&self, face: u32, edge: u64) -> Option<u32> {
        found_extra(&self.extras, face, edge)
    }

    /// Whether the lower face across `axis` of a cell has extra vertices, these or those of the leaf's cells.
    #[inline]
    pub(super) fn splits(&self, axis: Axis, cell: [usize; 3]) -> bool {
        self.split.holds(axis.index(), cell)
    }

    /// Heap bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        self.extras.capacity() * size_of::<FaceVertex>()
            + self.positions.capacity() * size_of::<[f32; 3]>()
            + self.sides.capacity() * size_of::<([u32; 2], u32)>()
            + self.split.rows.capacity() * size_of::<[u32; 3]>()
    }

    /// Adds one on a cut, numbered after `before` others.
    fn push(&mut self, face: u32, edges: [u64; 2], at: [f32; 3], sides: ([u32; 2], u32), before: usize) {
        let vertex = (before + self.positions.len()) as u32;
        self.positions.push(at);
        self.sides.push(sides);
        self.extras.extend(edges.map(|edge| FaceVertex { face, edge, vertex }));
    }
}
