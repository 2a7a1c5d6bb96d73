//! The vertices of a leaf as the mesh has them: those of its cells, or what is merged of them.

use super::adaptive::Merged;
use super::cells::BrickCells;
use std::sync::Arc;

/// The vertices of a leaf.
pub(super) struct LeafVertices {
    pub cells: Arc<BrickCells>,
    merged: Option<Arc<Merged>>,
}

impl LeafVertices {
    /// Of the cells of a leaf and what is merged of them.
    pub(super) fn new(cells: Arc<BrickCells>, merged: Option<Arc<Merged>>) -> LeafVertices {
        // All vertices stand for themselves.
        LeafVertices { cells, merged: merged.filter(|merged| !merged.names.is_empty()) }
    }

    /// World positions.
    #[inline]
    pub(super) fn positions(&self) -> &[[f32; 3]] {
        self.merged.as_ref().map_or(&self.cells.positions, |merged| &merged.positions)
    }

    /// The number of a vertex by the one with which its cell was made.
    #[inline]
    pub(super) fn name_of(&self, vertex: u32) -> u32 {
        self.merged.as_ref().map_or(vertex, |merged| merged.names[vertex as usize])
    }

    /// As [`BrickCells::extra`].
    pub(super) fn extra(&self, face: u32, edge: u64) -> Option<u32> {
        self.cells.extra(face, edge).map(|vertex| self.name_of(vertex)).filter(|&name| name != Merged::NONE)
    }

    /// Faces with extra vertices.
    pub(super) fn split_faces(&self) -> u64 {
        self.merged.as_ref().map_or(self.cells.split_faces, |merged| merged.split_faces)
    }
}
