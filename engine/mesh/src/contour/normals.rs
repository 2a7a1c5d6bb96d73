//! Normals of vertices, for the sinks that want them.
//!
//! The normal of a vertex is the direction of the sum of the unit normals of the Hermite edges that it stands for.
//! These are the edges of its loop if it is a cell's, the two that the cut joins if it is on a face, and its own if it
//! is on an edge.
//!
//! A merged vertex stands for all that its parts do, as often as they do. Where a sum vanishes, as at the end of a
//! wall thinner than a cell whose two sides are one loop, the first normal that went into it is taken.
//!
//! Sums are in double precision, of the normals as they were decoded, in a fixed order: cells as they are numbered, the
//! edges of a plain cell by their numbers, those of a mixed one by their names. So bits depend on the tree alone.
//!
//! This is a pass of its own over the cells of a leaf, behind the one that places vertices, which knows nothing of it.
//! The cells of no other leaf are asked, and nothing of it outlives the leaf's way to the sink.
//!
//! Only of what is merged across leaves ([`super::adaptive`]) are normals kept: what a leaf knows of that is its own
//! part.

use super::cells::{BrickCells, CELL_ROWS};
use super::edges::{EDGE_PLACES, EdgeStreams};
use super::envelope::MinimalEdge;
use super::face_vertices::{face_key, plain_edge_key};
use super::field::LevelSet;
use super::normal_sum::NormalSum;
use super::surface::{HermiteSurface, LeafSurface};
use super::topology::CellLoops;
use super::transition_cells::TransitionLeaf;
use super::vertices::LeafVertices;
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey};
use std::sync::Arc;

/// The normals of a leaf's vertices, and what is needed for those of its edges.
pub(super) struct LeafNormals {
    /// `None` if no edge of it changes sign.
    surface: Option<Arc<LeafSurface>>,
    lattice: [[f32; BRICK_POINTS]; 3],
    all: Vec<[f32; 3]>,
}

impl LeafNormals {
    /// Of the vertices of a leaf by their numbers, those on edges aside.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub(super) fn of(field: &LevelSet, leaf: u32, vertices: &LeafVertices) -> Result<LeafNormals> {
        let key = field.leaves.get(leaf).key;
        let count = vertices.first_count();
        let has_edges = count > 0 && field.leaves.get(leaf).changes;
        let surface = has_edges.then(|| field.surface(leaf)).transpose()?;
        let changes = surface.as_deref().and_then(LeafSurface::changes);
        let mut sums = Sums { key, vertices, changes, all: vec![NormalSum::default(); count] };
        if count > 0 {
            sums.add_cells(field, leaf)?;
        }
        let all = sums.by_number(&field.normals_across(leaf));
        Ok(LeafNormals { lattice: field.frame(key).lattice(), surface, all })
    }

    /// With those of vertices on edges of the leaf, which come last.
    pub(super) fn with_edges(mut self, edges: &[MinimalEdge]) -> Vec<[f32; 3]> {
        if let Some(changes) = self.surface.as_deref().and_then(LeafSurface::changes) {
            let normal = |edge: &MinimalEdge| {
                let low = low_of(edge, &self.lattice);
                NormalSum::of([changes.plane(edge.axis, low).normal]).direction()
            };
            self.all.extend(edges.iter().map(normal));
        }
        self.all
    }
}

/// The lower sample of an edge of the leaf whose samples have these world coordinates by axis.
fn low_of(edge: &MinimalEdge, lattice: &[[f32; BRICK_POINTS]; 3]) -> [usize; 3] {
    let (u, v) = edge.axis.others();
    let mut at = [edge.ends[0]; 3];
    (at[u.index()], at[v.index()]) = (edge.at[0], edge.at[1]);
    // Coordinates grow along the axis: cells are wider than eight steps of them.
    std::array::from_fn(|a| lattice[a].partition_point(|&c| c < at[a]))
}

/// The sums of a leaf's vertices as first numbered: those of cells, then those on faces.
struct Sums<'a> {
    key: NodeKey,
    vertices: &'a LeafVertices,
    changes: Option<&'a HermiteSurface>,
    all: Vec<NormalSum>,
}

impl Sums<'_> {
    fn add_cells(&mut self, field: &LevelSet, leaf: u32) -> Result<()> {
        let cells: &BrickCells = &self.vertices.cells;
        let around = field.leaves.around(leaf);
        let mut surroundings = (cells.mixed_cells() > 0).then(|| TransitionLeaf::new(field, leaf, &around));
        for n in 0..CELL_ROWS {
            let (j, k) = (n % BRICK_CELLS, n / BRICK_CELLS);
            let row = cells.row(j, k);
            if row.active == 0 {
                continue;
            }
            let streams = EdgeStreams::of(self.changes, j, k);
            for i in (0..BRICK_CELLS).filter(|i| row.active >> i & 1 == 1) {
                match &mut surroundings {
                    Some(surroundings) if row.mixed >> i & 1 == 1 => {
                        self.add_mixed([i, j, k], surroundings)?
                    }
                    _ => self.add_plain([i, j, k], &streams),
                }
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn add_plain(&mut self, cell: [usize; 3], streams: &EdgeStreams) {
        let (Some((kind, first)), Some(changes)) = (self.vertices.cells.plain(cell), self.changes) else {
            return;
        };
        let loops = kind.loops();
        let normal = |edge: usize| changes.planes[streams.slot(cell[0], &EDGE_PLACES[edge])].normal;
        for l in 0..usize::from(loops.count) {
            let sum = &mut self.all[first + l];
            let mut edges = loops.edges[l];
            while edges != 0 {
                sum.add(normal(edges.trailing_zeros() as usize));
                edges &= edges - 1;
            }
        }
        if self.vertices.has_extras() {
            self.add_plain_faces(cell, loops, normal);
        }
    }

    /// Those on the faces of a plain cell that the leaf owns: the lower ones, and upper ones next to coarser leaves.
    #[cold]
    fn add_plain_faces(&mut self, cell: [usize; 3], loops: &CellLoops, normal: impl Fn(usize) -> [f32; 3]) {
        for (axis, side) in Axis::ALL.into_iter().flat_map(|axis| [(axis, 0), (axis, 1)]) {
            let mut corner = cell;
            corner[axis.index()] += side;
            if side == 1 && corner[axis.index()] < BRICK_CELLS {
                continue;
            }
            for (enter, leave) in loops.face_cuts(axis, side) {
                let edge = plain_edge_key(enter, axis, self.key);
                if let Some(vertex) = self.vertices.number_on_face(face_key(axis, corner), edge) {
                    self.all[vertex as usize] = NormalSum::of([enter, leave].map(&normal));
                }
            }
        }
    }

    /// Those of a cell next to finer leaves, whose loops are found once more.
    #[cold]
    fn add_mixed(&mut self, cell: [usize; 3], surroundings: &mut TransitionLeaf) -> Result<()> {
        let mixed = surroundings.loops(cell)?;
        for (crossing, (_, vertex)) in mixed.crossings.iter().zip(self.vertices.cells.mixed_edges_of(cell)) {
            self.all[*vertex as usize].add(crossing.plane.1.map(|c| c as f32));
        }
        for cut in &mixed.cuts {
            let on_face = |face| self.vertices.number_on_face(face, cut.edges[0]);
            if let Some(vertex) = cut.face.and_then(on_face) {
                let normals = mixed.ends(cut).map(|crossing| crossing.plane.1.map(|c| c as f32));
                self.all[vertex as usize] = NormalSum::of(normals);
            }
        }
        Ok(())
    }

    /// Normals by the numbers that vertices have in the mesh; `across` are those of the first ones, which stand for
    /// vertices of several leaves.
    fn by_number(self, across: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let Some(merged) = self.vertices.what_is_merged() else {
            return self.all.iter().map(NormalSum::direction).collect();
        };
        let mut sums = vec![NormalSum::default(); merged.positions.len()];
        for (name, sum) in merged.names.iter().zip(&self.all) {
            // What is no more, and what another leaf has, is beyond.
            if let Some(whole) = sums.get_mut(*name as usize) {
                whole.add_all(sum);
            }
        }
        let own = sums.iter().map(NormalSum::direction).skip(across.len());
        across.iter().copied().chain(own).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_that_vanish_give_their_first_normal() {
        let [east, west, up] = [[1.0, 0.0, 0.0], [-1.0, 0.0, -0.0], [0.0, 0.0, 1.0]];
        assert_eq!(NormalSum::of([west, east]).direction(), west);
        // As far off as codes of normals are.
        let nearly_east = [1.0, 5e-5, -5e-5];
        assert_eq!(NormalSum::of([nearly_east, west, east, west]).direction(), nearly_east);
        let [x, y, z] = NormalSum::of([east, up, up, west, east]).direction();
        assert!((x - 1.0 / 5f32.sqrt()).abs() < 1e-7 && y == 0.0 && (z - 2.0 / 5f32.sqrt()).abs() < 1e-7);
        assert!(NormalSum::of([west]).direction().iter().all(|c| *c != 0.0 || c.is_sign_positive()));
    }
}
