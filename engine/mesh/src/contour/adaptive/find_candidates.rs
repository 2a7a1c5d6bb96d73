//! Finding what a leaf's own planes and topology let be merged.

use super::super::cells::BrickCells;
use super::super::field::LevelSet;
use super::super::frame::CellFrame;
use super::super::lanes::GROUP;
use super::super::qef::Qef;
use super::super::solve::LoopGroup;
use super::super::surface::LeafSurface;
use super::crossings::{FROZEN, LeafEdges};
use super::edge::Edge;
use super::fit::{self, CellNode};
use super::foldovers;
use super::leaf_candidates::{Candidate, LeafCandidates};
use super::parts;
use super::patches::LevelPatches;
use super::vertex_merge::{LEVELS, NONE};
use crate::error::Result;

/// What of a leaf may be merged; `tolerance` is in world units.
pub(in super::super) fn draft(field: &LevelSet, leaf: u32, tolerance: f64) -> Result<LeafCandidates> {
    let mut draft = LeafCandidates::default();
    let cells = field.cells(leaf)?;
    if cells.len() == 0 {
        return Ok(draft);
    }
    let surface = field.surface(leaf)?;
    let LeafSurface::Changes(changes) = &*surface else { return Ok(draft.alone(&cells)) };
    let key = field.leaves.get(leaf).key;
    let frame = field.frame(key);
    let crossings = LeafEdges::of(&field.leaves, leaf, changes, &cells);
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
        foldovers::without(view, &mut barred, largest, |edge| !edge.is_outer(), |_, _, _| None);
    draft.barred = barred;
    draft.candidates.shrink_to_fit();
    draft.members.shrink_to_fit();
    Ok(draft)
}

impl LeafCandidates {
    /// Of cells none of whose vertices may be merged.
    fn alone(mut self, cells: &BrickCells) -> LeafCandidates {
        self.of_vertex = vec![NONE; cells.len()];
        self
    }

    /// Finds the candidates and returns what hangs together in the leaf.
    fn find(
        &mut self,
        crossings: &LeafEdges,
        frame: &CellFrame,
        tolerance: f64,
        vertices: usize,
    ) -> LevelPatches {
        let mut sums: Vec<Qef> = Vec::new();
        sums.resize_with(vertices, Qef::default);
        for crossing in &crossings.all {
            for vertex in crossing.vertices.into_iter().filter(|&vertex| vertex < FROZEN) {
                sums[vertex as usize].add_crossing(crossing);
            }
        }
        let mut patches = LevelPatches::new(sums);
        let mut group = LoopGroup::default();
        for level in 1..=LEVELS {
            let disks = patches.join(crossings, level);
            for disks in disks.chunks(GROUP) {
                let node = |&root: &usize| CellNode::around(crossings.cell_of(root as u32), level);
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
}
