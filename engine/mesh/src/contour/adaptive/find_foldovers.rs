//! The search for folds of the surface, leaf by leaf, given what each leaf and the leaves around it would merge.

use super::super::cells::BrickCells;
use super::super::field::LevelSet;
use super::super::leaves::{LeafNeighbour, direction_index};
use super::super::topology::{SQUARE, edge_index};
use super::cross_leaf::{CrossLeafMerges, MergeTarget};
use super::crossings::FROZEN;
use super::edge::{ACROSS, Corner, Edge, OWN};
use super::foldovers::{corners, is_folded, without};
use super::leaf_candidates::LeafCandidates;
use crate::error::Result;
use crate::lattice::BRICK_CELLS;
use std::sync::Arc;

/// What folds the surface at an edge of a leaf and is the largest there: candidates of the leaf, and what stands for parts
/// of several leaves.
pub(super) fn found(field: &LevelSet, leaf: u32, across: &CrossLeafMerges) -> Result<Vec<MergeTarget>> {
    let seen = Neighbourhood::of(field, leaf, across)?;
    let MergedLeaf { cells, draft, wide, .. } = &seen.own;
    let of_vertex = seen.own.of_vertex();
    let own = (&**draft, &**cells, &wide[..]);
    let mut found = Vec::new();
    let has_wide = |edge: &Edge| {
        let is_wide = |vertex: &u32| {
            *vertex < FROZEN
                && draft.part_of(*vertex).is_some_and(|part| wide.get(part).is_some_and(Option::is_some))
        };
        !wide.is_empty() && edge.vertices.iter().any(is_wide)
    };
    for edge in draft.edges.iter().filter(|edge| has_wide(edge)) {
        let beyond = &mut |edge: &Edge, quadrant, cell| seen.beyond(edge, quadrant, cell);
        let Some(corners) = corners(own, edge, of_vertex, beyond) else { continue };
        let most = corners.iter().map(|corner| corner.level).max().unwrap_or(0);
        if is_folded(edge.axis, &corners) {
            let largest = corners.iter().filter(|corner| corner.level == most && corner.name.0 == ACROSS);
            found.extend(largest.map(|corner| MergeTarget::Wide(corner.name.2)));
        }
    }
    let before = across.barred(leaf, draft);
    let mut barred = before.clone();
    // The draft has seen to the others.
    let is_known = draft.is_settled && seen.own.less.is_none();
    let asked = |edge: &Edge| !is_known || edge.is_outer() || has_wide(edge);
    let beyond = |edge: &Edge, quadrant, cell| seen.beyond(edge, quadrant, cell);
    without(own, &mut barred, of_vertex.to_vec(), asked, beyond);
    let is_new = |n: &usize| barred[*n] && !before[*n];
    found.extend((0..barred.len()).filter(is_new).map(|n| MergeTarget::Candidate(leaf, n as u32)));
    found.sort_unstable();
    found.dedup();
    Ok(found)
}

/// A leaf as merging sees it.
pub(super) struct MergedLeaf {
    pub cells: Arc<BrickCells>,
    pub draft: Arc<LeafCandidates>,
    /// What stands for its parts.
    pub wide: Vec<Option<Corner>>,
    /// As [`CrossLeafMerges::of_vertex`].
    less: Option<Vec<u32>>,
}

impl MergedLeaf {
    /// As [`LeafCandidates::of_vertex`], without what was given up.
    fn of_vertex(&self) -> &[u32] {
        self.less.as_ref().unwrap_or(&self.draft.of_vertex)
    }
}

/// A leaf and those of its level around it.
pub(super) struct Neighbourhood {
    pub own: MergedLeaf,
    others: [Option<MergedLeaf>; 27],
}

impl Neighbourhood {
    pub(super) fn of(field: &LevelSet, leaf: u32, across: &CrossLeafMerges) -> Result<Neighbourhood> {
        let see = |leaf| {
            let (cells, draft) = (field.cells(leaf)?, field.draft(leaf)?);
            let wide = across.corners(leaf, &draft);
            let less = across.of_vertex(leaf, &draft, cells.len());
            Ok(MergedLeaf { cells, draft, wide, less })
        };
        let mut others = [const { None }; 27];
        for (direction, side) in field.leaves.around(leaf).iter().enumerate() {
            if let LeafNeighbour::Same(other) = side
                && direction != OWN
            {
                others[direction] = Some(see(*other)?);
            }
        }
        Ok(Neighbourhood { own: see(leaf)?, others })
    }

    /// The corner in a quadrant around an edge, in a cell beyond the leaf; `None` in a leaf of another level or next
    /// to it.
    pub(super) fn beyond(&self, edge: &Edge, quadrant: usize, cell: [i32; 3]) -> Option<Corner> {
        let direction = direction_index(cell.map(|c| c.div_euclid(BRICK_CELLS as i32)));
        let other = self.others[direction].as_ref()?;
        let MergedLeaf { cells, draft, wide, .. } = other;
        let cell = cell.map(|c| c.rem_euclid(BRICK_CELLS as i32) as usize);
        let [qu, qv] = SQUARE[quadrant];
        let vertex = cells.plain_vertex(cell, edge_index(edge.axis, 1 - qu, 1 - qv))?;
        Some(draft.corner((cells, wide), direction, vertex, other.of_vertex()))
    }
}
