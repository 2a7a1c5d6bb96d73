//! Where merged vertices would fold the surface back onto itself, and which of them are given up for that.
//!
//! Seen along a sign-changing edge, the patches around it lie around a point, and the triangles between their
//! vertices should run around it the same way. Vertices of cells always do, or can be cut so. Those of larger nodes
//! may not, where only three meet: on the side of a large node, if its vertex is far along the side. Then the largest
//! of the three is given up, and what it is made of takes its place. The rules of [`super`] hold whichever candidates
//! are taken. A fold that meets nothing costs no more than a normal that points the wrong way, so the walks in search of
//! folds may end before there are none; what meets is for [`super::self_intersections`].

use super::super::cells::BrickCells;
use super::crossings::FROZEN;
use super::edge::{Corner, Edge, OWN, turns};
use super::leaf_candidates::LeafCandidates;
use super::vertex_merge::{LEVELS, NONE};
use crate::lattice::{Axis, BRICK_CELLS};

impl LeafCandidates {
    /// The corner that a vertex is, the candidates being assigned like this; `wide` are the corners that stand for
    /// parts of the leaf, where they are known.
    pub(super) fn corner(
        &self,
        (cells, wide): (&BrickCells, &[Option<Corner>]),
        direction: usize,
        vertex: u32,
        of_vertex: &[u32],
    ) -> Corner {
        if let Some(Some(corner)) = self.part_of(vertex).and_then(|part| wide.get(part)) {
            return *corner;
        }
        match of_vertex[vertex as usize] {
            NONE => Corner {
                name: (direction, false, vertex),
                position: cells.positions[vertex as usize],
                level: 0,
            },
            merged => {
                let candidate = &self.candidates[merged as usize];
                Corner {
                    name: (direction, true, merged),
                    position: candidate.position,
                    level: candidate.node.level,
                }
            }
        }
    }
}

/// Bars candidates until no edge is left that would fold and has a candidate of the leaf among the largest there, and
/// returns what stands for each vertex, and whether none is left; `of_vertex` is that at the beginning. `beyond` gives the
/// corner in a cell beyond the leaf: the edge, its quadrant and the cell. Edges that are not `asked` are known to bar nothing
/// as long as what stands for their vertices does not change.
pub(super) fn without(
    (draft, cells, wide): (&LeafCandidates, &BrickCells, &[Option<Corner>]),
    barred: &mut [bool],
    mut of_vertex: Vec<u32>,
    asked: impl Fn(&Edge) -> bool,
    mut beyond: impl FnMut(&Edge, usize, [i32; 3]) -> Option<Corner>,
) -> (Vec<u32>, bool) {
    let mut before: Option<Vec<u32>> = None;
    // What is given up is divided each time.
    for _ in 0..LEVELS {
        let mut is_done = true;
        for edge in &draft.edges {
            let is_asked = match &before {
                None => asked(edge),
                Some(before) => {
                    let is_changed = |n: u32| n < FROZEN && before[n as usize] != of_vertex[n as usize];
                    edge.vertices.into_iter().any(is_changed)
                }
            };
            if !is_asked {
                continue;
            }
            let Some(corners) = corners((draft, cells, wide), edge, &of_vertex, &mut beyond) else {
                continue;
            };
            let most = corners.iter().map(|corner| corner.level).max().unwrap_or(0);
            if most == 0 || !is_folded(edge.axis, &corners) {
                continue;
            }
            for corner in corners.iter().filter(|corner| corner.level == most && corner.name.0 == OWN) {
                is_done &= std::mem::replace(&mut barred[corner.name.2 as usize], true);
            }
        }
        if is_done {
            return (of_vertex, true);
        }
        let after = draft.assigned(barred, of_vertex.len());
        before = Some(std::mem::replace(&mut of_vertex, after));
    }
    (of_vertex, false)
}

/// The corners of the polygon around an edge; `None` where it is next to a leaf of another level.
pub(super) fn corners(
    (draft, cells, wide): (&LeafCandidates, &BrickCells, &[Option<Corner>]),
    edge: &Edge,
    of_vertex: &[u32],
    beyond: &mut impl FnMut(&Edge, usize, [i32; 3]) -> Option<Corner>,
) -> Option<[Corner; 4]> {
    let mut corners = [Corner::default(); 4];
    for (n, corner) in corners.iter_mut().enumerate() {
        let vertex = edge.vertices[n];
        if vertex < FROZEN {
            *corner = draft.corner((cells, wide), OWN, vertex, of_vertex);
            continue;
        }
        let cell = edge.cell(n);
        if cell.iter().all(|c| (0..BRICK_CELLS as i32).contains(c)) {
            // Next to a leaf of another level.
            return None;
        }
        *corner = beyond(edge, n, cell)?;
    }
    Some(corners)
}

/// Whether the polygon of four corners, of which equal ones follow each other, is folded back however it is cut.
pub(super) fn is_folded(axis: Axis, corners: &[Corner; 4]) -> bool {
    let mut distinct = [[0.0; 3]; 4];
    let mut count = 0;
    for n in 0..4 {
        if corners[n].name != corners[(n + 3) % 4].name {
            distinct[count] = corners[n].position;
            count += 1;
        }
    }
    match count {
        3 => !turns(axis, [distinct[0], distinct[1], distinct[2]]),
        4 => {
            let [a, b, c, d] = distinct;
            let [at_a, at_b, at_c, at_d] =
                [[d, a, b], [a, b, c], [b, c, d], [c, d, a]].map(|corners| turns(axis, corners));
            !(at_a && at_c || at_b && at_d)
        }
        _ => false,
    }
}
