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
pub(super) use folds::{OWN, turns};

use super::cells::{BrickCells, edge_key, face_key};
use super::field::{Field, Frame};
use super::leaves::{Side, direction_index};
use super::topology::{SQUARE, edge_index};
use crate::error::Result;
use crate::lattice::{BRICK_BITS, BRICK_CELLS, NodeKey};
use crossings::FROZEN;
use draft::Candidate;
use folds::Edge;
use std::collections::HashSet;
use std::sync::Arc;

/// Nodes of a leaf's cells are 2 to the power of 1 up to this many cells wide.
const LEVELS: u8 = BRICK_BITS as u8;

/// Stands for a vertex that is not merged, or that is no more.
const NONE: u32 = u32::MAX;

/// What is merged of the vertices of a leaf's cells.
#[derive(Default)]
pub(super) struct Merged {
    /// By number as first made, the number of each vertex or [`Merged::NONE`]; empty if nothing is merged.
    pub names: Vec<u32>,
    /// World positions by the new numbers.
    pub positions: Vec<[f32; 3]>,
    /// Faces with extra vertices.
    pub split_faces: u64,
}

impl Merged {
    /// The number of an extra vertex that is no more.
    pub(super) const NONE: u32 = NONE;

    /// Heap bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        4 * self.names.capacity() + self.positions.capacity() * size_of::<[f32; 3]>() + size_of::<Merged>()
    }
}

/// Merges the vertices of a leaf's cells.
pub(super) fn merged(field: &Field, leaf: u32) -> Result<Merged> {
    let draft = field.draft(leaf)?;
    if draft.candidates.is_empty() {
        return Ok(Merged::default());
    }
    let key = field.leaves.get(leaf).key;
    let cells = field.cells(leaf)?;
    let around = field.leaves.around(leaf);
    let mut others: [Option<(Arc<BrickCells>, Arc<Draft>)>; 27] = [const { None }; 27];
    for (direction, side) in around.iter().enumerate() {
        if let Side::Same(other) = side {
            others[direction] = Some((field.cells(*other)?, field.draft(*other)?));
        }
    }
    let mut barred = draft.barred.clone();
    let of_vertex =
        folds::without((&draft, &cells), &mut barred, draft.of_vertex.clone(), |edge, quadrant, cell| {
            let direction = direction_index(cell.map(|c| c.div_euclid(BRICK_CELLS as i32)));
            let (cells, other) = others[direction].as_ref()?;
            let cell = cell.map(|c| c.rem_euclid(BRICK_CELLS as i32) as usize);
            let [qu, qv] = SQUARE[quadrant];
            let vertex = cells.unmixed_vertex(cell, edge_index(edge.axis, 1 - qu, 1 - qv))?;
            Some(other.corner(cells, direction, vertex, &other.of_vertex))
        });
    let dropped = match cells.extras.is_empty() {
        true => HashSet::new(),
        false => faces_within(&draft.edges, &of_vertex, key),
    };
    Ok(renamed(&cells, &field.frame(key), &draft.candidates, &of_vertex, &dropped))
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
fn renamed(
    cells: &BrickCells,
    frame: &Frame,
    candidates: &[Candidate],
    of_vertex: &[u32],
    dropped: &HashSet<(u32, u64)>,
) -> Merged {
    let mut names = vec![0; cells.len()];
    let mut joined_faces: HashSet<u32> = HashSet::new();
    for extra in cells.extras.iter().filter(|extra| dropped.contains(&(extra.face, extra.edge))) {
        names[extra.vertex as usize] = NONE;
        joined_faces.insert(extra.face);
    }
    let mut numbers = vec![NONE; candidates.len()];
    let mut positions = Vec::with_capacity(cells.len());
    let mut taken: HashSet<[u32; 3]> = HashSet::new();
    let is_kept = |vertex: &usize| of_vertex[*vertex] == NONE && names[*vertex] != NONE;
    taken.extend((0..cells.len()).filter(is_kept).map(|vertex| bits(&cells.positions[vertex])));
    for vertex in 0..cells.len() {
        let number = positions.len() as u32;
        match (of_vertex[vertex], names[vertex]) {
            (_, NONE) => continue,
            (NONE, _) => positions.push(cells.positions[vertex]),
            (of, _) if numbers[of as usize] == NONE => {
                let Candidate { node, at, .. } = candidates[of as usize];
                numbers[of as usize] = number;
                let block = (node.corner, node.size());
                positions.push(frame.free_place(block, at, |position| !taken.insert(bits(position))));
            }
            _ => {}
        }
        names[vertex] = if of_vertex[vertex] == NONE { number } else { numbers[of_vertex[vertex] as usize] };
    }
    positions.shrink_to_fit();
    Merged { names, positions, split_faces: cells.split_faces - joined_faces.len() as u64 }
}

fn bits(position: &[f32; 3]) -> [u32; 3] {
    position.map(|c| (c + 0.0).to_bits())
}
