//! Fewer vertices where the surface is flat: those of cells are merged, bottom-up, over the nodes of the octree
//! (Schaefer, Ju & Warren 2007, *Manifold Dual Contouring*): 2, 4, 8, 16 and 32 cells wide within a leaf ([`draft`]),
//! and above it over the nodes of the tree, 64, 128, … cells wide ([`across`]).
//!
//! What hangs together within a node becomes one vertex if
//! - it is a disk, by its Euler characteristic;
//! - it crosses every edge of the node at most once and every face along at most one line that ends on edges of the
//!   face (the paper's rule, for edges too), and no face of a cell on the node's border twice;
//! - the vertex fits its planes within the tolerance ([`fit`]);
//! - no cell of it is next to a leaf of another level.
//!
//! *Why the mesh stays manifold.* Think of the uniform mesh's dual: the surface cut into patches, one a vertex, by
//! the faces of cells. Merging joins patches to larger disks. The nodes of two neighbours lie beside each other,
//! since within a node everything that hangs together is one patch, so they share a part of one face, which is a face
//! of the smaller node. There the smaller patch has one line, and the larger patch has all of it or nothing:
//! neighbours share one line, and there is one mesh edge between their vertices. The smaller node may be a cell whose
//! face is cut twice; then its patch is on two lines, but the larger one is not, or both are cells, and extra
//! vertices stand between them as ever. A patch has lines on three faces at least, beyond each of which lies another
//! node, so three neighbours at least. Where four patches meet at an edge, opposite ones share but a part of an edge
//! of the smaller node, which is crossed once, so there is one diagonal between them.
//!
//! *Across leaves* nothing of this changes, because the argument is about nodes of one octree: that of the cells of
//! one level, of which leaves are nodes like others. Leaves of other levels have their own, and no vertex next to
//! them is merged. Within a node above the leaves, too, everything that hangs together is one patch or none: what a
//! child does not hand on as a disk of its own freezes all that touches it. That gives up some patches, since several
//! parts, none of them a disk, may make one together; it never makes one of what is none. What a node knows of its
//! children are the crossings on their borders, and an Euler characteristic needs no more: those of the parts, less
//! the ends of the lines between them, and the edges in the inside where lines meet.
//!
//! All within a leaf is a matter of the leaf and of the levels of those around it ([`Draft`]), all above it a matter
//! of what leaves hand on, in the order of the tree; and the mesh is manifold whichever of the vertices that pass are
//! taken. Some are given up because the surface would fold there ([`folds`]), which takes the drafts of the leaves
//! around.

mod across;
mod crossings;
mod draft;
mod fit;
mod folds;
mod parts;
mod patches;

pub(super) use across::{Across, Shared};
pub(super) use draft::Draft;
pub(super) use folds::{OWN, turns};

use super::cells::BrickCells;
use super::extras::{edge_key, face_key};
use super::field::{Field, Frame};
use crate::error::Result;
use crate::lattice::{BRICK_BITS, BRICK_CELLS, NodeKey};
use crossings::FROZEN;
use draft::Candidate;
use folds::{Edge, Neighbourhood, Seen};
use std::collections::{HashMap, HashSet};

/// Nodes of a leaf's cells are 2 to the power of 1 up to this many cells wide.
const LEVELS: u8 = BRICK_BITS as u8;

/// Stands for a vertex that is not merged, or that is no more.
const NONE: u32 = u32::MAX;

/// What is merged of the vertices of a leaf's cells.
#[derive(Default)]
pub(super) struct Merged {
    /// By number as first made, the number of each vertex or [`Merged::NONE`]; empty if nothing is merged. From
    /// `positions.len()` on they count in `shared`.
    pub names: Vec<u32>,
    /// World positions of the leaf's vertices by the new numbers.
    pub positions: Vec<[f32; 3]>,
    /// Vertices that other leaves have.
    pub shared: Vec<Shared>,
    /// Faces with extra vertices.
    pub split_faces: u64,
}

impl Merged {
    /// The number of an extra vertex that is no more.
    pub(super) const NONE: u32 = NONE;

    /// Heap bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        4 * self.names.capacity()
            + self.positions.capacity() * size_of::<[f32; 3]>()
            + self.shared.capacity() * size_of::<Shared>()
            + size_of::<Merged>()
    }
}

/// Merges the vertices of a leaf's cells.
pub(super) fn merged(field: &Field, leaf: u32, across: &Across) -> Result<Merged> {
    let draft = field.draft(leaf)?;
    let (owned, hosted) = (across.owned(leaf), across.hosted(leaf));
    let is_plain = draft.candidates.is_empty() && across.corners(leaf, &draft).iter().all(Option::is_none);
    if is_plain && hosted.is_empty() {
        return Ok(Merged::default());
    }
    let seen = Neighbourhood::of(field, leaf, across)?;
    let Seen { cells, draft, wide } = &seen.own;
    let mut barred = draft.barred.clone();
    let beyond = |edge: &Edge, quadrant, cell| seen.beyond(edge, quadrant, cell);
    let of_vertex = folds::without((draft, cells, wide), &mut barred, draft.of_vertex.clone(), beyond);
    let names: Vec<Name> = (0..cells.len() as u32)
        .map(|vertex| {
            let wide = draft.part_of(vertex).and_then(|part| wide.get(part).copied().flatten());
            match (wide, of_vertex[vertex as usize]) {
                (Some(corner), _) => Name::Wide(corner.name.2),
                (None, NONE) => Name::Own,
                (None, candidate) => Name::Candidate(candidate),
            }
        })
        .collect();
    let key = field.leaves.get(leaf).key;
    let dropped = match cells.extras.is_empty() {
        true => HashSet::new(),
        false => faces_within(&draft.edges, &names, key),
    };
    let renaming = Renaming { leaf, cells, frame: field.frame(key), draft, across, owned, hosted };
    Ok(renaming.merged(&names, &dropped))
}

/// What a vertex becomes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Name {
    /// Itself.
    Own,
    /// One of the leaf's candidates.
    Candidate(u32),
    /// One of several leaves'.
    Wide(u32),
}

/// Names of faces and edges, as extra vertices have them, where both cells at the face are merged with each other.
fn faces_within(edges: &[Edge], names: &[Name], key: NodeKey) -> HashSet<(u32, u64)> {
    let mut found = HashSet::new();
    for edge in edges {
        let (u, v) = edge.axis.others();
        for n in 0..4 {
            let [a, b] = [edge.vertices[n], edge.vertices[(n + 1) % 4]];
            let name = |vertex: u32| if vertex < FROZEN { names[vertex as usize] } else { Name::Own };
            if name(a) == Name::Own || name(a) != name(b) {
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

/// Numbers the vertices of a leaf anew.
struct Renaming<'a> {
    leaf: u32,
    cells: &'a BrickCells,
    frame: Frame,
    draft: &'a Draft,
    across: &'a Across,
    owned: &'a [[f32; 3]],
    hosted: &'a [[f32; 3]],
}

impl Renaming<'_> {
    /// Vertices of several leaves come first, as far as the leaf has them; the merged ones then take the place of the
    /// first one that each stands for.
    fn merged(&self, names: &[Name], dropped: &HashSet<(u32, u64)>) -> Merged {
        let cells = self.cells;
        let mut numbers = vec![0; cells.len()];
        let mut joined_faces: HashSet<u32> = HashSet::new();
        for extra in cells.extras.iter().filter(|extra| dropped.contains(&(extra.face, extra.edge))) {
            numbers[extra.vertex as usize] = NONE;
            joined_faces.insert(extra.face);
        }
        let mut positions = Vec::with_capacity(self.owned.len() + cells.len());
        positions.extend_from_slice(self.owned);
        let mut taken: HashSet<[u32; 3]> = self.hosted.iter().map(bits).collect();
        let is_kept = |vertex: &usize| names[*vertex] == Name::Own && numbers[*vertex] != NONE;
        let kept: Vec<usize> = (0..cells.len()).filter(is_kept).collect();
        let mut moved = HashMap::new();
        for vertex in kept {
            let position = cells.positions[vertex];
            if !taken.insert(bits(&position)) && self.hosted.contains(&position) {
                moved.insert(vertex, self.beside(position, &mut taken));
            }
        }
        let mut of_candidate = vec![NONE; self.draft.candidates.len()];
        let mut elsewhere: Vec<(usize, Shared)> = Vec::new();
        for vertex in 0..cells.len() {
            if numbers[vertex] == NONE {
                continue;
            }
            let number = positions.len() as u32;
            numbers[vertex] = match names[vertex] {
                Name::Own => {
                    positions.push(moved.get(&vertex).copied().unwrap_or(cells.positions[vertex]));
                    number
                }
                Name::Candidate(candidate) => {
                    let place = &mut of_candidate[candidate as usize];
                    if *place == NONE {
                        let Candidate { node, at, .. } = self.draft.candidates[candidate as usize];
                        let block = (node.corner, node.size());
                        let is_taken = |position: &[f32; 3]| !taken.insert(bits(position));
                        positions.push(self.frame.free_place(block, at, is_taken));
                        *place = number;
                    }
                    *place
                }
                Name::Wide(wide) => {
                    let shared = self.across.shared(wide);
                    if shared.leaf != self.leaf {
                        elsewhere.push((vertex, shared));
                    }
                    shared.number
                }
            };
        }
        positions.shrink_to_fit();
        let mut shared: Vec<Shared> = Vec::new();
        for (vertex, other) in elsewhere {
            let known = shared.iter().position(|known| *known == other);
            let n = known.unwrap_or_else(|| {
                shared.push(other);
                shared.len() - 1
            });
            numbers[vertex] = (positions.len() + n) as u32;
        }
        let split_faces = cells.split_faces - joined_faces.len() as u64;
        Merged { names: numbers, positions, shared, split_faces }
    }

    /// A place beside one that is taken, in the same cell.
    fn beside(&self, position: [f32; 3], taken: &mut HashSet<[u32; 3]>) -> [f32; 3] {
        let point = self.frame.local(position);
        let cell = point.map(|c| (c.floor().max(0.0) as usize).min(BRICK_CELLS - 1));
        let at = std::array::from_fn(|a| point[a] - cell[a] as f64);
        self.frame.free_place((cell, 1.0), at, |position| !taken.insert(bits(position)))
    }
}

fn bits(position: &[f32; 3]) -> [u32; 3] {
    position.map(|c| (c + 0.0).to_bits())
}
