//! Fewer vertices where the surface is flat: those of a leaf's cells are merged, bottom-up, over the nodes of the octree
//! of its cells, 2, 4, 8, 16 and 32 cells wide (Schaefer, Ju & Warren 2007, *Manifold Dual Contouring*).
//!
//! What hangs together within a node becomes one vertex if
//! - it is a disk, by its Euler characteristic;
//! - it crosses every edge of the node at most once and every face along at most one line that ends on edges of the
//!   face (the paper's rule, for edges too), and no face of a cell on the node's border twice;
//! - the vertex fits its planes within the tolerance ([`fit`]);
//! - no cell of it is next to a leaf of another level.
//!
//! *Why the mesh stays manifold.* Think of the uniform mesh's dual: the surface cut into patches, one a vertex, by the
//! faces of cells. Merging joins patches to larger disks. The nodes of two neighbours lie beside each other, since
//! within a node everything that hangs together is one patch, so they share a part of one face, which is a face of the
//! smaller node. There the smaller patch has one line, and the larger patch has all of it or nothing: neighbours share
//! one line, and there is one mesh edge between their vertices. The smaller node may be a cell whose face is cut
//! twice; then its patch is on two lines, but the larger one is not, or both are cells, and extra vertices stand
//! between them as ever. A patch has lines on three faces at least, beyond each of which lies another node, so three
//! neighbours at least. Where four patches meet at an edge, opposite ones share but a part of an edge of the smaller
//! node, which is crossed once, so there is one diagonal between them.
//!
//! All of this is a matter of one leaf and of the levels of those around it ([`Draft`]), and it holds whichever of the
//! vertices that pass are taken. Some are given up because the surface would fold there ([`folds`]), which takes the
//! drafts of the leaves around.

mod crossings;
mod draft;
mod fit;
mod folds;
mod patches;

pub(super) use draft::Draft;
pub(super) use folds::turns;

use super::cells::{BrickCells, NO_VERTEX, edge_key, face_key};
use super::field::{Field, Frame};
use super::leaves::{Side, direction_index};
use super::topology::{SQUARE, edge_index};
use crate::error::Result;
use crate::lattice::{BRICK_BITS, BRICK_CELLS, NodeKey};
use crossings::FROZEN;
use draft::Candidate;
use folds::Edge;
use std::collections::HashSet;
use std::sync::{Arc, PoisonError};

/// Nodes of a leaf's cells are 2 to the power of 1 up to this many cells wide.
const LEVELS: u8 = BRICK_BITS as u8;

/// Stands for a vertex that is not merged, or that is no more.
const NONE: u32 = u32::MAX;

/// The cells of a leaf with its vertices merged.
pub(super) fn merged(field: &Field, leaf: u32) -> Result<BrickCells> {
    let draft = field.draft(leaf)?;
    let mut cells = draft.copied_cells();
    if draft.candidates.is_empty() {
        return Ok(cells);
    }
    let key = field.leaves.get(leaf).key;
    let around = field.leaves.around(leaf);
    let mut drafts: [Option<Arc<Draft>>; 27] = [const { None }; 27];
    for (direction, side) in around.iter().enumerate() {
        if let Side::Same(other) = side {
            drafts[direction] = Some(field.draft(*other)?);
        }
    }
    let mut barred = draft.barred.clone();
    let of_vertex = folds::without(&draft, &mut barred, |edge, quadrant, cell| {
        let direction = direction_index(cell.map(|c| c.div_euclid(BRICK_CELLS as i32)));
        let other = drafts[direction].as_deref()?;
        let cell = cell.map(|c| c.rem_euclid(BRICK_CELLS as i32) as usize);
        if other.cells.row(cell[1], cell[2]).mixed >> cell[0] & 1 == 1 {
            return None;
        }
        let [qu, qv] = SQUARE[quadrant];
        // Not mixed, so any name will do.
        let name = edge_key([0; 3], edge.axis, key.level());
        let vertex = other.cells.vertex(cell, edge_index(edge.axis, 1 - qu, 1 - qv), name)?;
        Some(other.corner(direction, vertex, &other.of_vertex))
    });
    let dropped = match cells.extras.is_empty() {
        true => HashSet::new(),
        false => faces_within(&draft.edges, &of_vertex, key),
    };
    rename(&mut cells, &field.frame(key), &draft.candidates, &of_vertex, &dropped);
    Ok(cells)
}

/// Names of faces and edges, as extra vertices have them, where both cells at the face are merged with each other.
fn faces_within(edges: &[Edge], of_vertex: &[u32], key: NodeKey) -> HashSet<(u32, u64)> {
    let mut found = HashSet::new();
    for edge in edges {
        let (u, v) = edge.axis.others();
        for n in 0..4 {
            let [a, b] = [edge.vertices[n], edge.vertices[(n + 1) % 4]];
            let is_merged = |vertex: u32| vertex < FROZEN && of_vertex[vertex as usize] != NONE;
            if !(is_merged(a) && is_merged(b)) || of_vertex[a as usize] != of_vertex[b as usize] {
                continue;
            }
            // Quadrants 0, 1 and 2, 3 differ along the first axis, the others along the second.
            let (across, along) = if n.is_multiple_of(2) { (u, v) } else { (v, u) };
            let is_upper = [false, true, true, false][n];
            let mut corner = edge.low.map(usize::from);
            let mut relative = [0; 3];
            if !is_upper {
                corner[along.index()] -= 1;
                relative[along.index()] = 1 << key.spacing_bits();
            }
            found.insert((face_key(across, corner), edge_key(relative, edge.axis, key.level())));
        }
    }
    found
}

/// Puts the merged vertices in the place of the first one that each stands for.
fn rename(
    cells: &mut BrickCells,
    frame: &Frame,
    merged: &[Candidate],
    of_vertex: &[u32],
    dropped: &HashSet<(u32, u64)>,
) {
    let mut renamed = vec![0; cells.len()];
    for extra in &cells.extras {
        if dropped.contains(&(extra.face, extra.edge)) {
            renamed[extra.vertex as usize] = NONE;
        }
    }
    let faces = cells.extras.iter().map(|e| (e.face, renamed[e.vertex as usize] == NONE));
    let faces: HashSet<u32> = faces.filter(|(_, is_dropped)| *is_dropped).map(|(face, _)| face).collect();
    cells.split_faces -= faces.len() as u64;
    let mut numbers = vec![NONE; merged.len()];
    let mut positions = Vec::with_capacity(cells.len());
    let mut taken: HashSet<[u32; 3]> = HashSet::new();
    let kept = |vertex: &usize| of_vertex[*vertex] == NONE && renamed[*vertex] != NONE;
    taken.extend((0..cells.len()).filter(kept).map(|vertex| bits(cells.positions[vertex])));
    for vertex in 0..cells.len() {
        let number = positions.len() as u32;
        match (of_vertex[vertex], renamed[vertex]) {
            (_, NONE) => continue,
            (NONE, _) => positions.push(cells.positions[vertex]),
            (of, _) if numbers[of as usize] == NONE => {
                numbers[of as usize] = number;
                positions.push(free_place(frame, &merged[of as usize], &mut taken));
            }
            _ => {}
        }
        renamed[vertex] =
            if of_vertex[vertex] == NONE { number } else { numbers[of_vertex[vertex] as usize] };
    }
    positions.shrink_to_fit();
    cells.positions = positions;
    cells.extras.retain_mut(|extra| {
        extra.vertex = renamed[extra.vertex as usize];
        extra.vertex != NONE
    });
    for vertex in cells.quads.get_mut().unwrap_or_else(PoisonError::into_inner).iter_mut().flatten() {
        if *vertex != NO_VERTEX {
            *vertex = renamed[usize::from(*vertex)] as u16;
        }
    }
    cells.renamed = renamed;
}

impl BrickCells {
    /// The number of a vertex by the one with which it was made.
    #[inline]
    pub(super) fn name_of(&self, vertex: u32) -> u32 {
        self.renamed.get(vertex as usize).copied().unwrap_or(vertex)
    }
}

fn bits(position: [f32; 3]) -> [u32; 3] {
    position.map(|c| (c + 0.0).to_bits())
}

/// World position of a merged vertex, or near it where another vertex is: two sheets in one node may have their vertices
/// at the same point.
fn free_place(frame: &Frame, merged: &Candidate, taken: &mut HashSet<[u32; 3]>) -> [f32; 3] {
    let Candidate { node, mut at, .. } = *merged;
    let place = |at: [f64; 3]| frame.world(node.corner, at.map(|c| c * node.size()));
    let margin = frame.margin / node.size();
    let mut tries = 0;
    while !taken.insert(bits(place(at))) && tries < 48 {
        let axis = tries % 3;
        let step = (1.0 / 64.0 / node.size()).max(margin) * (1 + tries / 3) as f64;
        at[axis] = (at[axis] + if at[axis] < 0.5 { step } else { -step }).clamp(margin, 1.0 - margin);
        tries += 1;
    }
    place(at)
}
