//! What a leaf's own planes and topology let be merged, before the leaves around it are looked at.

use super::super::cells::{BrickCells, Extra};
use super::super::field::{Field, Frame};
use super::super::qef::Qef;
use super::super::solve::{GROUP, Group};
use super::super::surface::Surface;
use super::crossings::{Crossings, FROZEN};
use super::fit::{self, Node};
use super::folds::{self, Edge};
use super::patches::Patches;
use super::{LEVELS, NONE};
use crate::error::Result;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// A vertex that may stand for others.
pub(super) struct Candidate {
    pub node: Node,
    /// In the node's unit cube.
    pub at: [f64; 3],
    /// The same in the world.
    pub position: [f32; 3],
    /// Which vertices, as a part of [`Draft::members`].
    members: Range<usize>,
}

/// A leaf's cells as first made, and which of their vertices may be merged.
#[derive(Default)]
pub(in super::super) struct Draft {
    pub(super) cells: BrickCells,
    /// From small nodes to large ones; those of a level have no vertex in common.
    pub(super) candidates: Vec<Candidate>,
    members: Vec<u32>,
    /// For each vertex the candidate that stands for it, or [`NONE`], if only the leaf itself is looked at.
    pub(super) of_vertex: Vec<u32>,
    /// Candidates that fold the surface within the leaf.
    pub(super) barred: Vec<bool>,
    pub(super) edges: Vec<Edge>,
}

impl Draft {
    /// Of the cells of a leaf whose vertices are placed; `tolerance` is in world units.
    pub(in super::super) fn of(field: &Field, leaf: u32, tolerance: f64, cells: BrickCells) -> Result<Draft> {
        let mut draft = Draft { cells, ..Draft::default() };
        if draft.cells.len() == 0 {
            return Ok(draft);
        }
        let surface = field.surface(leaf)?;
        let Surface::Changes(changes) = &*surface else { return Ok(draft) };
        let key = field.leaves.get(leaf).key;
        let frame = field.frame(key);
        let crossings = Crossings::of(field, leaf, changes, &draft.cells);
        draft.find(&crossings, &frame, tolerance / field.root.spacing(key.level()));
        if !draft.candidates.is_empty() {
            draft.edges = crossings.all.iter().map(Edge::of).collect();
        }
        draft.barred = vec![false; draft.candidates.len()];
        draft.of_vertex = draft.assigned(&draft.barred);
        let mut barred = std::mem::take(&mut draft.barred);
        draft.of_vertex = folds::without(&draft, &mut barred, |_, _, _| None);
        draft.barred = barred;
        Ok(draft)
    }

    fn find(&mut self, crossings: &Crossings, frame: &Frame, tolerance: f64) {
        let mut sums: Vec<Qef> = Vec::new();
        sums.resize_with(self.cells.len(), Qef::default);
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
                let parts: Vec<(&Qef, Node)> =
                    disks.iter().map(|root| (&patches.sums[*root], node(root))).collect();
                let points = fit::best_points(&mut group, &parts, frame.margin, tolerance);
                for ((&root, &(sums, node)), at) in disks.iter().zip(&parts).zip(points) {
                    let Some(at) = at else { continue };
                    let planes = || patches.members(root).flat_map(|vertex| crossings.at(vertex));
                    if fit::fits(node.point(at), sums.normal_sum, planes, tolerance) {
                        let start = self.members.len();
                        self.members.extend(patches.members(root));
                        let position = frame.world(node.corner, at.map(|c| c * node.size()));
                        let members = start..self.members.len();
                        self.candidates.push(Candidate { node, at, position, members });
                    }
                }
            }
        }
    }

    /// For each vertex the largest candidate that is not barred.
    pub(super) fn assigned(&self, barred: &[bool]) -> Vec<u32> {
        let mut of_vertex = vec![NONE; self.cells.len()];
        for (n, candidate) in self.candidates.iter().enumerate().filter(|(n, _)| !barred[*n]) {
            for &vertex in &self.members[candidate.members.clone()] {
                of_vertex[vertex as usize] = n as u32;
            }
        }
        of_vertex
    }

    /// A copy of the cells.
    pub(super) fn copied_cells(&self) -> BrickCells {
        let cells = &self.cells;
        let extras = cells.extras.iter().map(|e| Extra { face: e.face, edge: e.edge, vertex: e.vertex });
        BrickCells {
            signs: cells.signs.clone(),
            rows: cells.rows.clone(),
            masks: cells.masks.clone(),
            first: cells.first.clone(),
            mixed: cells.mixed.clone(),
            mixed_edges: cells.mixed_edges.clone(),
            extras: extras.collect(),
            quads: Mutex::new(cells.quads.lock().unwrap_or_else(PoisonError::into_inner).clone()),
            positions: cells.positions.clone(),
            split_faces: cells.split_faces,
            renamed: Vec::new(),
        }
    }

    /// Heap bytes.
    pub(in super::super) fn heap_bytes(&self) -> usize {
        self.cells.heap_bytes()
            + self.candidates.capacity() * size_of::<Candidate>()
            + 4 * (self.members.capacity() + self.of_vertex.capacity())
            + self.barred.capacity()
            + self.edges.capacity() * size_of::<Edge>()
    }
}
