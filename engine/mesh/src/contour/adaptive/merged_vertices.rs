//! The vertices of a leaf as they are after merging.

use super::fit::CellNode;
use super::vertex_merge::NONE;

/// What is merged of the vertices of a leaf: those of its cells and those on its faces.
#[derive(Default)]
pub(in super::super) struct MergedVertices {
    /// By number as first made, the number of each vertex or [`MergedVertices::NONE`]; empty if nothing is merged. From
    /// `positions.len()` on they count in `shared`.
    pub names: Vec<u32>,
    /// World positions of the leaf's vertices by the new numbers.
    pub positions: Vec<[f32; 3]>,
    /// How many of them, the first ones, stand for vertices of several leaves.
    pub(super) several: u32,
    /// The candidates, with their nodes, that the next ones are.
    pub(super) candidates: Vec<(u32, CellNode)>,
    /// Vertices that other leaves have.
    pub shared: Vec<SharedVertex>,
    /// Faces with extra vertices.
    pub split_faces: u64,
    /// Vertices on faces that are left.
    pub face_vertices: usize,
    /// A merged vertex made room for another one.
    pub(super) has_moved: bool,
    /// Vertices of several leaves that are where one is that stays as it was: they are to be given up.
    pub(super) crowding: Vec<u32>,
}

impl MergedVertices {
    /// The number of an extra vertex that is no more.
    pub(in super::super) const NONE: u32 = NONE;

    /// Whether one of the leaf's vertices, by its new number, stands for others.
    #[inline]
    pub(in super::super) fn is_merged(&self, number: u32) -> bool {
        number < self.several + self.candidates.len() as u32
    }

    /// Whether it does so for vertices of several leaves.
    #[inline]
    pub(in super::super) fn is_wide(&self, number: u32) -> bool {
        number < self.several
    }

    /// The candidate that a vertex is, by its new number, and the node of that.
    pub(super) fn candidate(&self, number: u32) -> Option<(u32, CellNode)> {
        self.candidates.get(number.checked_sub(self.several)? as usize).copied()
    }

    /// Heap bytes.
    pub(in super::super) fn heap_bytes(&self) -> usize {
        4 * self.names.capacity()
            + self.positions.capacity() * size_of::<[f32; 3]>()
            + self.candidates.capacity() * size_of::<(u32, CellNode)>()
            + self.shared.capacity() * size_of::<SharedVertex>()
            + 4 * self.crowding.capacity()
            + size_of::<MergedVertices>()
    }
}

/// A vertex of several leaves, as the mesh has it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in super::super) struct SharedVertex {
    /// The leaf that has it: the first one in which it stands for something.
    pub leaf: u32,
    /// Its number there.
    pub number: u32,
    pub position: [f32; 3],
    /// It stands for others.
    pub is_merged: bool,
    /// For some of several leaves.
    pub is_wide: bool,
}
