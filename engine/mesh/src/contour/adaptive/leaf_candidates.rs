//! What a leaf's own planes and topology let be merged, before the leaves around it are looked at.

use super::edge::Edge;
use super::fit::CellNode;
use super::parts::SurfaceDisk;
use super::vertex_merge::NONE;
use std::ops::Range;

/// A vertex that may stand for others.
pub(super) struct Candidate {
    pub node: CellNode,
    /// In the node's unit cube.
    pub at: [f64; 3],
    /// The same in the world.
    pub position: [f32; 3],
    /// Which vertices, as a part of [`LeafCandidates::members`].
    pub(super) members: Range<u32>,
}

/// Which vertices of a leaf's cells may be merged.
#[derive(Default)]
pub(in super::super) struct LeafCandidates {
    /// From small nodes to large ones; those of a level have no vertex in common.
    pub(super) candidates: Vec<Candidate>,
    pub(super) members: Vec<u32>,
    /// For each vertex the candidate that stands for it, or [`NONE`], if only the leaf itself is looked at.
    pub(super) of_vertex: Vec<u32>,
    /// Candidates that fold the surface within the leaf.
    pub(super) barred: Vec<bool>,
    /// No edge within the leaf is left that would bar any.
    pub(super) is_settled: bool,
    pub(super) edges: Vec<Edge>,
    /// What may be merged with parts of the leaves around.
    pub(super) parts: Vec<SurfaceDisk>,
    /// For each vertex the number of its part, or [`NONE`]; empty if there is no part.
    pub(super) part_of: Vec<u32>,
}

impl LeafCandidates {
    /// The number of a vertex' part.
    pub(super) fn part_of(&self, vertex: u32) -> Option<usize> {
        self.part_of.get(vertex as usize).filter(|&&part| part != NONE).map(|&part| part as usize)
    }

    /// For each vertex the largest candidate that is not barred.
    pub(super) fn assigned(&self, barred: &[bool], vertices: usize) -> Vec<u32> {
        let mut of_vertex = vec![NONE; vertices];
        for (n, candidate) in self.candidates.iter().enumerate().filter(|(n, _)| !barred[*n]) {
            let Range { start, end } = candidate.members;
            for &vertex in &self.members[start as usize..end as usize] {
                of_vertex[vertex as usize] = n as u32;
            }
        }
        of_vertex
    }

    /// Heap bytes.
    pub(in super::super) fn heap_bytes(&self) -> usize {
        self.candidates.capacity() * size_of::<Candidate>()
            + 4 * (self.members.capacity() + self.of_vertex.capacity())
            + self.barred.capacity()
            + self.edges.capacity() * size_of::<Edge>()
            + self.parts.capacity() * size_of::<SurfaceDisk>()
            + self.parts.iter().map(SurfaceDisk::heap_bytes).sum::<usize>()
            + 4 * self.part_of.capacity()
    }
}
