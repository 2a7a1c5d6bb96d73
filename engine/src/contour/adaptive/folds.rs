//! Where merged vertices would fold the surface back onto itself, and which of them are given up for that.
//!
//! Seen along a sign-changing edge, the patches around it lie around a point, and the triangles between their vertices
//! should run around it the same way. Vertices of cells always do, or can be cut so.
//!
//! Those of larger nodes may not, where only three meet: on the side of a large node, if its vertex is far along the
//! side. Then the largest of the three is given up, and what it is made of takes its place.
//!
//! The rules of [`super`] hold whichever candidates are taken. A fold that meets nothing costs no more than a normal
//! that points the wrong way, so the walks in search of folds may end before there are none; what meets is for
//! [`super::meetings`].

use super::super::cells::BrickCells;
use super::super::field::Field;
use super::super::leaves::{Side, direction_index};
use super::super::topology::{SQUARE, cell_around, edge_index};
use super::across::{Across, Taken};
use super::crossings::{Crossing, FROZEN};
use super::draft::Draft;
use super::{LEVELS, NONE};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS};
use std::sync::Arc;

/// A sign-changing edge of a leaf.
pub(super) struct Edge {
    pub axis: Axis,
    /// Its lower sample.
    pub low: [u8; 3],
    /// As [`Crossing::vertices`].
    pub vertices: [u32; 4],
}

/// A corner of a polygon.
#[derive(Clone, Copy, Default)]
pub(super) struct Corner {
    /// Leaf, as a direction, and what tells its vertices apart.
    pub name: (usize, bool, u32),
    pub position: [f32; 3],
    /// The level of its node, 0 for a cell.
    pub level: u8,
}

impl Edge {
    pub(super) fn of(crossing: &Crossing) -> Edge {
        Edge { axis: crossing.axis, low: crossing.low, vertices: crossing.vertices }
    }

    /// The cell in a quadrant, from -1 to 32 along each axis.
    fn cell(&self, quadrant: usize) -> [i32; 3] {
        cell_around(self.axis, self.low.map(i32::from), SQUARE[quadrant])
    }

    /// Whether a cell around it is frozen or beyond the leaf.
    pub(super) fn is_outer(&self) -> bool {
        self.vertices.iter().any(|vertex| *vertex >= FROZEN)
    }
}

impl Draft {
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
/// returns what stands for each vertex, and whether none is left; `of_vertex` is that at the beginning.
///
/// `beyond` gives the corner in a cell beyond the leaf: the edge, its quadrant and the cell. Edges that are not
/// `asked` are known to bar nothing as long as what stands for their vertices does not change.
pub(super) fn without(
    (draft, cells, wide): (&Draft, &BrickCells, &[Option<Corner>]),
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

/// The direction of the leaf itself.
pub(in super::super) const OWN: usize = 13;
/// Stands for the direction of what several leaves have.
pub(super) const ACROSS: usize = 27;

/// What folds the surface at an edge of a leaf and is the largest there: candidates of the leaf, and what stands for parts
/// of several leaves.
pub(super) fn found(field: &Field, leaf: u32, across: &Across) -> Result<Vec<Taken>> {
    let seen = Neighbourhood::of(field, leaf, across)?;
    let Seen { cells, draft, wide, .. } = &seen.own;
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
            found.extend(largest.map(|corner| Taken::Wide(corner.name.2)));
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
    found.extend((0..barred.len()).filter(is_new).map(|n| Taken::Candidate(leaf, n as u32)));
    found.sort_unstable();
    found.dedup();
    Ok(found)
}

/// A leaf as merging sees it.
pub(super) struct Seen {
    pub cells: Arc<BrickCells>,
    pub draft: Arc<Draft>,
    /// What stands for its parts.
    pub wide: Vec<Option<Corner>>,
    /// As [`Across::of_vertex`].
    less: Option<Vec<u32>>,
}

impl Seen {
    /// As [`Draft::of_vertex`], without what was given up.
    fn of_vertex(&self) -> &[u32] {
        self.less.as_ref().unwrap_or(&self.draft.of_vertex)
    }
}

/// A leaf and those of its level around it.
pub(super) struct Neighbourhood {
    pub own: Seen,
    others: [Option<Seen>; 27],
}

impl Neighbourhood {
    pub(super) fn of(field: &Field, leaf: u32, across: &Across) -> Result<Neighbourhood> {
        let see = |leaf| {
            let (cells, draft) = (field.cells(leaf)?, field.draft(leaf)?);
            let wide = across.corners(leaf, &draft);
            let less = across.of_vertex(leaf, &draft, cells.len());
            Ok(Seen { cells, draft, wide, less })
        };
        let mut others = [const { None }; 27];
        for (direction, side) in field.leaves.around(leaf).iter().enumerate() {
            if let Side::Same(other) = side
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
        let Seen { cells, draft, wide, .. } = other;
        let cell = cell.map(|c| c.rem_euclid(BRICK_CELLS as i32) as usize);
        let [qu, qv] = SQUARE[quadrant];
        let vertex = cells.plain_vertex(cell, edge_index(edge.axis, 1 - qu, 1 - qv))?;
        Some(draft.corner((cells, wide), direction, vertex, other.of_vertex()))
    }
}

fn corners(
    (draft, cells, wide): (&Draft, &BrickCells, &[Option<Corner>]),
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
fn is_folded(axis: Axis, corners: &[Corner; 4]) -> bool {
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

/// Whether a triangle runs counter-clockwise, seen from the upper end of `axis`.
#[inline]
pub(in super::super) fn turns(axis: Axis, [p, q, r]: [[f32; 3]; 3]) -> bool {
    let (u, v) = axis.others();
    // The way from one corner to the next, seen from there.
    let way = |from: [f32; 3], to: [f32; 3], axis: Axis| {
        f64::from(to[axis.index()]) - f64::from(from[axis.index()])
    };
    way(p, q, u) * way(q, r, v) - way(p, q, v) * way(q, r, u) > 0.0
}
