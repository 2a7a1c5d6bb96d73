//! What a leaf's own planes and topology let be merged, before the leaves around it are looked at.

use super::super::cells::BrickCells;
use super::super::field::{Field, Frame};
use super::super::qef::Qef;
use super::super::solve::{GROUP, Group};
use super::super::surface::Surface;
use super::crossings::{Crossings, FROZEN};
use super::fit::{self, Node};
use super::folds::{self, Edge};
use super::parts::{self, Part};
use super::patches::Patches;
use super::{LEVELS, NONE};
use crate::error::Result;
use std::ops::Range;

/// A vertex that may stand for others.
pub(super) struct Candidate {
    pub node: Node,
    /// In the node's unit cube.
    pub at: [f64; 3],
    /// The same in the world.
    pub position: [f32; 3],
    /// Which vertices, as a part of [`Draft::members`].
    members: Range<u32>,
}

/// Which vertices of a leaf's cells may be merged.
#[derive(Default)]
pub(in super::super) struct Draft {
    /// From small nodes to large ones; those of a level have no vertex in common.
    pub(super) candidates: Vec<Candidate>,
    members: Vec<u32>,
    /// For each vertex the candidate that stands for it, or [`NONE`], if only the leaf itself is looked at.
    pub(super) of_vertex: Vec<u32>,
    /// Candidates that fold the surface within the leaf.
    pub(super) barred: Vec<bool>,
    /// No edge within the leaf is left that would bar any.
    pub(super) is_settled: bool,
    pub(super) edges: Vec<Edge>,
    /// What may be merged with parts of the leaves around.
    pub(super) parts: Vec<Part>,
    /// For each vertex the number of its part, or [`NONE`]; empty if there is no part.
    pub(super) part_of: Vec<u32>,
}

impl Draft {
    /// Of the cells of a leaf; `tolerance` is in world units.
    pub(in super::super) fn of(field: &Field, leaf: u32, tolerance: f64) -> Result<Draft> {
        let mut draft = Draft::default();
        let cells = field.cells(leaf)?;
        if cells.len() == 0 {
            return Ok(draft);
        }
        let surface = field.surface(leaf)?;
        let Surface::Changes(changes) = &*surface else { return Ok(draft.alone(&cells)) };
        let key = field.leaves.get(leaf).key;
        let frame = field.frame(key);
        let crossings = Crossings::of(field, leaf, changes, &cells);
        let mut patches =
            draft.find(&crossings, &frame, tolerance / field.root.spacing(key.level()), cells.len());
        (draft.parts, draft.part_of) = parts::of_leaf(&mut patches, &crossings, key);
        let largest = draft.assigned(&vec![false; draft.candidates.len()], cells.len());
        let is_merged = |vertex: &u32| {
            *vertex < FROZEN && (largest[*vertex as usize] != NONE || draft.part_of(*vertex).is_some())
        };
        let edges = crossings.all.iter().filter(|crossing| crossing.vertices.iter().any(is_merged));
        draft.edges = edges.map(Edge::of).collect::<Vec<_>>();
        draft.edges.shrink_to_fit();
        let mut barred = vec![false; draft.candidates.len()];
        let view = (&draft, &*cells, &[][..]);
        (draft.of_vertex, draft.is_settled) =
            folds::without(view, &mut barred, largest, |edge| !edge.is_outer(), |_, _, _| None);
        draft.barred = barred;
        draft.candidates.shrink_to_fit();
        draft.members.shrink_to_fit();
        Ok(draft)
    }

    /// Of cells none of whose vertices may be merged.
    fn alone(mut self, cells: &BrickCells) -> Draft {
        self.of_vertex = vec![NONE; cells.len()];
        self
    }

    /// The number of a vertex' part.
    pub(super) fn part_of(&self, vertex: u32) -> Option<usize> {
        self.part_of.get(vertex as usize).filter(|&&part| part != NONE).map(|&part| part as usize)
    }

    /// Finds the candidates and returns what hangs together in the leaf.
    fn find(&mut self, crossings: &Crossings, frame: &Frame, tolerance: f64, vertices: usize) -> Patches {
        let mut sums: Vec<Qef> = Vec::new();
        sums.resize_with(vertices, Qef::default);
        for crossing in &crossings.all {
            for vertex in crossing.vertices.into_iter().filter(|&vertex| vertex < FROZEN) {
                sums[vertex as usize].add_crossing(crossing);
            }
        }
        let mut patches = Patches::new(sums);
        let mut group = Group::default();
        for level in 1..=LEVELS {
            let disks = patches.join(crossings, level);
            for disks in disks.chunks(GROUP) {
                let node = |&root: &usize| Node::around(crossings.cell_of(root as u32), level);
                let parts: Vec<Qef> =
                    disks.iter().map(|root| patches.sums[*root].within(&node(root))).collect();
                let size = f64::from(1u32 << level);
                let points = fit::best_points(&mut group, &parts, (size, frame.margin), tolerance);
                for (&root, at) in disks.iter().zip(points) {
                    let Some(at) = at else { continue };
                    let node = node(&root);
                    let planes = || patches.members(root).flat_map(|vertex| crossings.at(vertex));
                    if fit::fits(node.point(at), patches.sums[root].normal_sum, planes, tolerance) {
                        let start = self.members.len() as u32;
                        self.members.extend(patches.members(root));
                        let position = frame.world(node.corner(), at.map(|c| c * node.size()));
                        let members = start..self.members.len() as u32;
                        self.candidates.push(Candidate { node, at, position, members });
                    }
                }
            }
        }
        patches
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
            + self.parts.capacity() * size_of::<Part>()
            + self.parts.iter().map(Part::heap_bytes).sum::<usize>()
            + 4 * self.part_of.capacity()
    }
}
