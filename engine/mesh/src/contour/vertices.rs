//! The vertices of a leaf as the mesh has them: those of its cells, or what is merged of them.

use super::adaptive::{MergedVertices, SharedVertex};
use super::cells::BrickCells;
use super::faces::FaceVertices;
use crate::lattice::Axis;
use std::sync::Arc;

/// The vertices of a leaf.
#[derive(Clone)]
pub(super) struct LeafVertices {
    leaf: u32,
    pub cells: Arc<BrickCells>,
    /// None where all stand for themselves.
    merged: Option<Arc<MergedVertices>>,
    faces: Arc<FaceVertices>,
}

impl LeafVertices {
    /// Of the cells of a leaf, the vertices on their faces, and what is merged of all these.
    pub(super) fn merged(
        leaf: u32,
        cells: Arc<BrickCells>,
        faces: Arc<FaceVertices>,
        merged: Arc<MergedVertices>,
    ) -> LeafVertices {
        // All vertices stand for themselves.
        let merged = Some(merged).filter(|merged| !merged.names.is_empty());
        LeafVertices { leaf, cells, merged, faces }
    }

    /// Of the cells of a leaf and the vertices on their faces.
    pub(super) fn new(leaf: u32, cells: Arc<BrickCells>, faces: Arc<FaceVertices>) -> LeafVertices {
        LeafVertices { leaf, cells, merged: None, faces }
    }

    /// As [`FaceVertices::splits`], whatever is merged.
    #[inline]
    pub(super) fn splits(&self, axis: Axis, cell: [usize; 3]) -> bool {
        self.faces.splits(axis, cell)
    }

    /// World positions of the vertices on faces that come after those of [`LeafVertices::positions`].
    pub(super) fn on_faces(&self) -> &[[f32; 3]] {
        if self.merged.is_some() { &[] } else { &self.faces.positions }
    }

    /// How many vertices of [`super::faces`] there are.
    pub(super) fn face_vertices(&self) -> usize {
        self.merged.as_ref().map_or(self.faces.positions.len(), |merged| merged.face_vertices)
    }

    /// What is merged, unless all vertices stand for themselves.
    pub(super) fn what_is_merged(&self) -> Option<&MergedVertices> {
        self.merged.as_deref()
    }

    /// World positions of those that the leaf has.
    #[inline]
    pub(super) fn positions(&self) -> &[[f32; 3]] {
        self.merged.as_ref().map_or(&self.cells.positions, |merged| &merged.positions)
    }

    /// The vertex that stands for one, by the number with which its cell was made.
    #[inline]
    pub(super) fn vertex(&self, number: u32) -> SharedVertex {
        let leaf = self.leaf;
        let Some(merged) = &self.merged else {
            let at = number as usize;
            let on_face = || self.faces.positions[at - self.cells.len()];
            let position = self.cells.positions.get(at).copied().unwrap_or_else(on_face);
            return SharedVertex { leaf, number, position, ..SharedVertex::default() };
        };
        let number = merged.names[number as usize];
        match merged.positions.get(number as usize) {
            Some(&position) => {
                let (is_merged, is_wide) = (merged.is_merged(number), merged.is_wide(number));
                SharedVertex { leaf, number, position, is_merged, is_wide }
            }
            None => merged.shared[number as usize - merged.positions.len()],
        }
    }

    /// As [`BrickCells::extra`].
    pub(super) fn extra(&self, face: u32, edge: u64) -> Option<SharedVertex> {
        let vertex = self.number_on_face(face, edge)?;
        let is_dropped = |merged: &Arc<MergedVertices>| merged.names[vertex as usize] == MergedVertices::NONE;
        (!self.merged.as_ref().is_some_and(is_dropped)).then(|| self.vertex(vertex))
    }

    /// The number of such a vertex, those on faces counted on from those of cells, before any is merged.
    pub(super) fn number_on_face(&self, face: u32, edge: u64) -> Option<u32> {
        self.cells.extra(face, edge).or_else(|| self.faces.extra(face, edge))
    }

    /// Whether the leaf has any, before any is merged.
    pub(super) fn has_extras(&self) -> bool {
        !(self.cells.extras.is_empty() && self.faces.positions.is_empty())
    }

    /// Number of vertices of cells and on faces, before any is merged.
    pub(super) fn first_count(&self) -> usize {
        self.cells.len() + self.faces.positions.len()
    }

    /// Faces with extra vertices.
    pub(super) fn split_faces(&self) -> u64 {
        self.merged.as_ref().map_or(self.cells.split_faces, |merged| merged.split_faces)
    }
}
