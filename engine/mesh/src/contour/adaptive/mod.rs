//! Fewer vertices where the surface is flat: those of cells are merged, bottom-up, over the nodes of the octree
//! (Schaefer, Ju & Warren 2007, *Manifold Dual Contouring*). Nodes are 2, 4, 8, 16 and 32 cells wide within a leaf
//! ([`leaf_candidates`]), and above it over the nodes of the tree, 64, 128, … cells wide ([`cross_leaf`]).
//!
//! What hangs together within a node becomes one vertex if
//! - it is a disk, by its Euler characteristic;
//! - it crosses every edge of the node at most once and every face along at most one line that ends on edges of the
//!   face (the paper's rule, for edges too). It crosses no face of a cell on the node's border twice;
//! - the vertex fits its planes within the tolerance ([`fit`]);
//! - no cell of it is next to a leaf of another level.
//!
//! *Why the mesh stays manifold.* Think of the uniform mesh's dual: the surface cut into patches, one a vertex, by the
//! faces of cells. Merging joins patches to larger disks.
//!
//! The nodes of two neighbours lie beside each other, since within a node everything that hangs together is one patch,
//! so they share a part of one face, which is a face of the smaller node.
//!
//! There the smaller patch has one line, and the larger patch has all of it or nothing: neighbours share one line, and
//! there is one mesh edge between their vertices.
//!
//! The smaller node may be a cell whose face is cut twice; then its patch is on two lines, but the larger one is not,
//! or both are cells, and extra vertices stand between them as ever. A patch has lines on three faces at least, beyond
//! each of which lies another node, so three neighbours at least.
//!
//! Where four patches meet at an edge, opposite ones share but a part of an edge of the smaller node, which is crossed
//! once, so there is one diagonal between them.
//!
//! *Across leaves* nothing of this changes, because the argument is about nodes of one octree: that of the cells of
//! one level, of which leaves are nodes like others. Leaves of other levels have their own, and no vertex next to them
//! is merged.
//!
//! Within a node above the leaves, too, everything that hangs together is one patch or none: what a child does not
//! hand on as a disk of its own freezes all that touches it. That gives up some patches, since several parts, none of
//! them a disk, may make one together; it never makes one of what is none.
//!
//! What a node knows of its children are the crossings on their borders, and an Euler characteristic needs no more. It
//! is those of the parts, less the ends of the lines between them, and the edges in the inside where lines meet.
//!
//! All within a leaf is a matter of the leaf and of the levels of those around it ([`LeafCandidates`]), all above it a matter
//! of what leaves hand on, in the order of the tree. The mesh is manifold whichever of the vertices that pass are
//! taken.
//!
//! Some are given up because the surface would fold there ([`foldovers`]), others because triangles would meet where they
//! are not joined ([`self_intersections`]). All of that is decided before any vertex is numbered; from then on what becomes of a
//! leaf's vertices is a matter of its draft and of what was given up ([`CrossLeafMerges::names`]).
//!
//! *What is not merged* is as without a tolerance: polygons without a merged vertex are cut the same way. A vertex on
//! a face ([`super::faces`]) stays as long as neither cell at the face is merged, which both polygons at it know.

mod bounds;
mod cross_leaf;
mod crossings;
mod edge;
mod edge_box;
mod edge_filter;
mod find_candidates;
mod find_cross_leaf;
mod find_foldovers;
mod fit;
mod foldovers;
mod leaf_candidates;
mod leaf_triangles;
mod merged_vertices;
mod out_of_cell;
mod parts;
mod patches;
mod reaching_edges;
mod self_intersections;
mod triangle_grid;
mod vertex_merge;

pub(super) use bounds::{Bounds, TriangleCorners, are_apart, bounds, meets, normal, wide};
pub(super) use cross_leaf::CrossLeafMerges;
pub(super) use edge::{OWN, turns};
pub(super) use edge_filter::{EdgeFilter, NumberedEdge};
pub(super) use find_candidates::draft;
pub(super) use find_cross_leaf::find_across;
pub(super) use leaf_candidates::LeafCandidates;
pub(super) use merged_vertices::{MergedVertices, SharedVertex};
pub(super) use self_intersections::MeetingSearch;

use super::cells::BrickCells;
use super::face_vertices::{FACES, FaceVertex, edge_key, face_key};
use super::faces::FaceVertices;
use super::field::LevelSet;
use super::frame::CellFrame;
use crate::error::Result;
use crate::lattice::NodeKey;
use crossings::FROZEN;
use edge::Edge;
use hashbrown::HashTable;
use leaf_candidates::Candidate;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use vertex_merge::{NONE, VertexMerge, bits, hash};

/// Merges the vertices of a leaf's cells.
pub(super) fn merged_vertices(
    field: &LevelSet,
    leaf: u32,
    across: &CrossLeafMerges,
) -> Result<MergedVertices> {
    let (draft, cells, faces) = (field.draft(leaf)?, field.cells(leaf)?, field.faces(leaf)?);
    let hosted = across.hosted(leaf);
    let names = across.names(leaf, &draft, cells.len());
    let lost_faces = beside_merged(field, across, (leaf, &names), &faces)?;
    if hosted.is_empty() && !lost_faces.contains(&true) && names.iter().all(|name| *name == VertexMerge::Own)
    {
        return Ok(MergedVertices::default());
    }
    let key = field.leaves.get(leaf).key;
    let dropped = extras_within(&draft.edges, &names, key, &cells.extras);
    let frame = field.frame(key);
    let owned = across.owned(leaf);
    let renaming = VertexRenumbering { leaf, cells: &cells, frame, draft: &draft, across, owned, hosted };
    Ok(renaming.merged(&names, &dropped, (&faces, &lost_faces)))
}

/// For each vertex on a face whether one of the cells at the face is merged with others.
fn beside_merged(
    field: &LevelSet,
    across: &CrossLeafMerges,
    (leaf, names): (u32, &[VertexMerge]),
    faces: &FaceVertices,
) -> Result<Vec<bool>> {
    let mut others: HashMap<u32, Vec<VertexMerge>> = HashMap::new();
    let mut lost = Vec::with_capacity(faces.sides.len());
    for &([other, below], above) in &faces.sides {
        let below = if other == leaf {
            names[below as usize]
        } else if field.leaves.get(other).key.level() != field.leaves.get(leaf).key.level() {
            // Nothing is merged next to leaves of other levels.
            VertexMerge::Own
        } else {
            let names = match others.entry(other) {
                Entry::Occupied(names) => names.into_mut(),
                Entry::Vacant(place) => {
                    let (draft, cells) = (field.draft(other)?, field.cells(other)?);
                    place.insert(across.names(other, &draft, cells.len()))
                }
            };
            names[below as usize]
        };
        lost.push([below, names[above as usize]] != [VertexMerge::Own; 2]);
    }
    Ok(lost)
}

/// For each extra vertex whether both cells at its face are merged with each other.
fn extras_within(edges: &[Edge], names: &[VertexMerge], key: NodeKey, extras: &[FaceVertex]) -> Vec<bool> {
    let mut found = vec![false; extras.len()];
    if extras.is_empty() {
        return found;
    }
    let mut is_split = vec![false; FACES];
    extras.iter().for_each(|extra| is_split[extra.face as usize] = true);
    for edge in edges {
        let (u, v) = edge.axis.others();
        for n in 0..4 {
            let [a, b] = [edge.vertices[n], edge.vertices[(n + 1) % 4]];
            let name = |vertex: u32| if vertex < FROZEN { names[vertex as usize] } else { VertexMerge::Own };
            if name(a) == VertexMerge::Own || name(a) != name(b) {
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
            let face = face_key(across, corner);
            if !is_split[face as usize] {
                continue;
            }
            let name = (face, edge_key(relative, edge.axis, key.level()));
            if let Ok(extra) = extras.binary_search_by_key(&name, |extra| (extra.face, extra.edge)) {
                found[extra] = true;
            }
        }
    }
    found
}

/// Numbers the vertices of a leaf anew.
struct VertexRenumbering<'a> {
    leaf: u32,
    cells: &'a BrickCells,
    frame: CellFrame,
    draft: &'a LeafCandidates,
    across: &'a CrossLeafMerges,
    owned: Vec<[f32; 3]>,
    hosted: &'a [([f32; 3], u32)],
}

impl VertexRenumbering<'_> {
    /// Vertices of several leaves come first, as far as the leaf has them, then the other merged ones in the order of the
    /// first that each stands for, then those that stay, and at last those on faces.
    fn merged(
        &self,
        names: &[VertexMerge],
        dropped: &[bool],
        (faces, lost_faces): (&FaceVertices, &[bool]),
    ) -> MergedVertices {
        let cells = self.cells;
        let mut numbers = vec![0; cells.len()];
        // Extras are sorted by face.
        let mut joined_faces: Vec<u32> = Vec::new();
        for (extra, _) in cells.extras.iter().zip(dropped).filter(|(_, is_dropped)| **is_dropped) {
            numbers[extra.vertex as usize] = NONE;
            joined_faces.push(extra.face);
        }
        joined_faces.dedup();
        let kept = |vertex: &usize| names[*vertex] == VertexMerge::Own && numbers[*vertex] != NONE;
        let kept: Vec<usize> = (0..cells.len()).filter(kept).collect();
        let mut taken = WorldPositions::default();
        taken.0.reserve(cells.len(), hash);
        for vertex in &kept {
            taken.insert(bits(&cells.positions[*vertex]));
        }
        let crowding = self.hosted.iter().filter(|(position, _)| !taken.insert(bits(position)));
        let crowding = crowding.map(|(_, wide)| *wide).collect();
        let mut has_moved = false;
        let mut positions = Vec::with_capacity(self.owned.len() + cells.len());
        positions.extend_from_slice(&self.owned);
        let mut of_candidate = vec![NONE; self.draft.candidates.len()];
        let mut candidates = Vec::new();
        for (number, name) in numbers.iter_mut().zip(names) {
            let VertexMerge::Candidate(candidate) = *name else { continue };
            let place = &mut of_candidate[candidate as usize];
            if *place == NONE {
                let Candidate { node, at, .. } = self.draft.candidates[candidate as usize];
                let is_taken = |position: &[f32; 3]| {
                    let is_taken = !taken.insert(bits(position));
                    has_moved |= is_taken;
                    is_taken
                };
                *place = positions.len() as u32;
                positions.push(self.frame.free_place((node.corner(), node.size()), at, is_taken));
                candidates.push((candidate, node));
            }
            *number = *place;
        }
        for vertex in kept {
            numbers[vertex] = positions.len() as u32;
            positions.push(cells.positions[vertex]);
        }
        let before_faces = positions.len();
        for (position, is_lost) in faces.positions.iter().zip(lost_faces) {
            numbers.push(if *is_lost { NONE } else { positions.len() as u32 });
            positions.extend((!is_lost).then_some(*position));
        }
        positions.shrink_to_fit();
        let shared = self.number_shared(names, &mut numbers, positions.len());
        MergedVertices {
            names: numbers,
            several: self.owned.len() as u32,
            candidates,
            shared,
            split_faces: cells.split_faces - joined_faces.len() as u64,
            face_vertices: positions.len() - before_faces,
            has_moved,
            crowding,
            positions,
        }
    }

    /// Numbers what stands for vertices of several leaves; returns those that other leaves have, from `first` on.
    fn number_shared(&self, names: &[VertexMerge], numbers: &mut [u32], first: usize) -> Vec<SharedVertex> {
        let mut shared: Vec<SharedVertex> = Vec::new();
        for (number, name) in numbers.iter_mut().zip(names) {
            let VertexMerge::Wide(wide) = *name else { continue };
            let other = self.across.shared(wide);
            if other.leaf == self.leaf {
                *number = other.number;
                continue;
            }
            let n = shared.iter().position(|known| *known == other).unwrap_or_else(|| {
                shared.push(other);
                shared.len() - 1
            });
            *number = (first + n) as u32;
        }
        shared
    }
}

/// Places of the world.
#[derive(Default)]
struct WorldPositions(HashTable<[u32; 3]>);

impl WorldPositions {
    /// Adds one, by its [`bits`]. False if it has been there.
    fn insert(&mut self, place: [u32; 3]) -> bool {
        match self.0.entry(hash(&place), |other| *other == place, hash) {
            hashbrown::hash_table::Entry::Occupied(_) => false,
            hashbrown::hash_table::Entry::Vacant(entry) => {
                entry.insert(place);
                true
            }
        }
    }
}
