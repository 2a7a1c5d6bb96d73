//! The active cells of one leaf, their loops and the vertices of these.
//!
//! Cells whose surroundings have their own level or a lower one are found by bit arithmetic on the sign rows
//! and looped by a table; those next to finer leaves go to [`super::transition_cells`]. Vertices are numbered within the
//! leaf: cells in the order x, y, z from fast to slow, the loops of a cell in the order of their first edge,
//! then the extra vertices on split faces.
//!
//! *Split faces.* Where the same two loops meet across two cuts of one face, the mesh edge between their
//! vertices would have four triangles, so each cut gets a vertex of its own on the face. Whether that happens
//! is decided from the two cells where both are plain cells of one size; other faces that are cut twice are
//! always split. A face belongs to the finer of its two cells, and to the upper one where they have the same
//! size; every leaf around asks the one that owns it.

mod builder;
mod cones;
mod place;
mod several;
mod special;
mod split;

use super::edges::Quad;
use super::face_vertices::{FaceVertex, found_extra};
use super::local_index::Direction;
use super::surface::EdgeRanks;
use super::topology::{CellCase, NO_LOOP};
use crate::brick::{Ranks, SignChanges};
use crate::lattice::BRICK_CELLS;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};

pub(super) use builder::{CellsBuilder, build, mark_active};
pub(super) use special::within;

/// Rows of cells along x in a leaf.
pub(super) const CELL_ROWS: usize = BRICK_CELLS * BRICK_CELLS;

/// Bits of one row of cells along x.
#[derive(Clone, Copy, Default)]
pub(super) struct CellRow {
    /// Cells with a loop.
    pub active: u32,
    /// Active cells whose boundary has edges of finer leaves.
    pub mixed: u32,
    /// Active cells in the rows before.
    rank: u32,
}

/// Cells and vertices of a leaf.
#[derive(Default)]
pub(super) struct BrickCells {
    /// Signs of the leaf's own samples; `None` if they are all alike.
    pub signs: Option<SignChanges>,
    /// Ranks of the edges, where vertices are merged.
    pub ranks: Option<Arc<EdgeRanks>>,
    /// Row k·32 + j; empty if no cell is active.
    pub rows: Vec<CellRow>,
    /// How the boundary of each active cell is cut, that of mixed ones aside.
    pub kinds: Vec<CellCase>,
    /// For each active cell its first vertex or, if it is mixed, its place in `mixed`.
    pub first: Vec<u32>,
    /// Where the edges of each mixed cell end in `mixed_edges`, after a leading zero.
    pub mixed: Vec<u32>,
    /// Minimal edges of mixed cells with the vertex of their loop, sorted within a cell.
    pub mixed_edges: Vec<(u64, u32)>,
    /// Mixed cells with several loops, [z, y, x], in order.
    pub several: Vec<[u8; 3]>,
    /// Sorted by face and edge.
    pub extras: Vec<FaceVertex>,
    /// Plain cells with several loops, and cells whose vertex lies beyond them; see [`super::faces`].
    pub special: Vec<[u8; 3]>,
    /// Cells that have annexed one, in order, and in which direction; see [`super::crease_extension`].
    pub annexed: Vec<([u8; 3], Direction)>,
    /// See [`BrickCells::take_quads`].
    quads: RwLock<Vec<Quad>>,
    /// World positions of the vertices.
    pub positions: Vec<[f32; 3]>,
    /// Faces with extra vertices.
    pub split_faces: u64,
    /// Cells next to finer leaves between whose sheets no place was found.
    pub unseparated: u64,
}

impl BrickCells {
    /// For the leaf's own polygons, for each sign-changing edge of it, those along x first, the vertices of the four cells
    /// around it in the order of [`super::topology::SQUARE`], [`NO_VERTEX`] for those that are not plain cells of this
    /// leaf with one loop, its vertex within, and without ambiguous faces. They are handed over once, because the cells
    /// stay for the leaves around.
    pub(super) fn take_quads(&self) -> Vec<Quad> {
        std::mem::take(&mut *self.quads.write().unwrap_or_else(PoisonError::into_inner))
    }

    /// The same, which stay; none if they have been handed over.
    pub(super) fn quads(&self) -> RwLockReadGuard<'_, Vec<Quad>> {
        self.quads.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Number of vertices.
    pub(super) fn len(&self) -> usize {
        self.positions.len()
    }

    /// Number of mixed cells.
    pub(super) fn mixed_cells(&self) -> u64 {
        self.mixed.len().saturating_sub(1) as u64
    }

    /// Heap bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        let signs = self.signs.as_ref().map_or(0, |_| 33 * 33 * 8);
        let ranks = self.ranks.as_ref().map_or(0, |_| 3 * size_of::<Ranks>());
        signs
            + ranks
            + self.rows.capacity() * size_of::<CellRow>()
            + self.kinds.capacity() * size_of::<CellCase>()
            + 4 * (self.first.capacity() + self.mixed.capacity())
            + self.mixed_edges.capacity() * size_of::<(u64, u32)>()
            + self.several.capacity() * size_of::<[u8; 3]>()
            + self.extras.capacity() * size_of::<FaceVertex>()
            + self.special.capacity() * size_of::<[u8; 3]>()
            + self.annexed.capacity() * size_of::<([u8; 3], Direction)>()
            + self.quads().capacity() * size_of::<Quad>()
            + self.positions.capacity() * size_of::<[f32; 3]>()
            + size_of::<BrickCells>()
    }

    /// The row of cells at (j, k); all zero if no cell is active.
    #[inline]
    pub(super) fn row(&self, j: usize, k: usize) -> CellRow {
        self.rows.get(k * BRICK_CELLS + j).copied().unwrap_or_default()
    }

    /// Number of active cells in the rows before one, which is k·32 + j.
    #[inline]
    pub(super) fn cells_before(&self, row: usize) -> usize {
        self.rows[row].rank as usize
    }

    /// The vertex of the loop of a plain cell through its edge number `edge`; `None` for other cells.
    #[inline(always)]
    pub(super) fn plain_vertex(&self, cell: [usize; 3], edge: usize) -> Option<u32> {
        let (kind, first) = self.plain(cell)?;
        let of_edge = kind.loops().of_edge[edge];
        (of_edge != NO_LOOP).then(|| first as u32 + u32::from(of_edge))
    }

    /// The vertex of the loop of `cell` through a minimal edge: number `edge` of the cell's own 12 if the
    /// cell is plain, named `key` relative to the cell's lower corner.
    pub(super) fn vertex(&self, cell: [usize; 3], edge: usize, key: u64) -> Option<u32> {
        if !self.is_mixed(cell) {
            return self.plain_vertex(cell, edge);
        }
        let edges = self.mixed_edges_of(cell);
        edges.binary_search_by_key(&key, |e| e.0).ok().map(|n| edges[n].1)
    }

    /// Whether a cell next to finer leaves has several loops.
    pub(super) fn has_several_loops(&self, [i, j, k]: [usize; 3]) -> bool {
        self.several.binary_search(&[k, j, i].map(|c| c as u8)).is_ok()
    }

    /// Whether a cell is active and next to finer leaves.
    pub(super) fn is_mixed(&self, cell: [usize; 3]) -> bool {
        self.row(cell[1], cell[2]).mixed >> cell[0] & 1 == 1
    }

    /// Minimal edges of a mixed cell with the vertex of their loop, sorted.
    pub(super) fn mixed_edges_of(&self, cell: [usize; 3]) -> &[(u64, u32)] {
        let place = self.first[self.row(cell[1], cell[2]).slot(cell[0])] as usize;
        &self.mixed_edges[self.mixed[place] as usize..self.mixed[place + 1] as usize]
    }

    /// The extra vertex on the cut of a face of this leaf that ends at a minimal edge, if the face is split.
    pub(super) fn extra(&self, face: u32, edge: u64) -> Option<u32> {
        found_extra(&self.extras, face, edge)
    }

    /// In which direction a cell has annexed one, if it has.
    pub(super) fn annexed(&self, cell: [usize; 3]) -> Option<Direction> {
        let cell = cell.map(|c| c as u8);
        self.annexed.binary_search_by_key(&cell, |annexed| annexed.0).ok().map(|n| self.annexed[n].1)
    }

    /// Kind and first vertex of an active cell that is not mixed.
    pub(super) fn plain(&self, [i, j, k]: [usize; 3]) -> Option<(CellCase, usize)> {
        let row = self.row(j, k);
        if (row.active & !row.mixed) >> i & 1 == 0 {
            return None;
        }
        let slot = row.slot(i);
        Some((*self.kinds.get(slot)?, self.first[slot] as usize))
    }
}

impl CellRow {
    /// Tells how many cells are active in the rows before.
    pub(super) fn set_rank(&mut self, rank: u32) {
        self.rank = rank;
    }

    /// Place among all active cells of the one at `i`, up to 32, or of the next.
    #[inline]
    pub(super) fn slot(self, i: usize) -> usize {
        (self.rank + (self.active & ((1u64 << i) - 1) as u32).count_ones()) as usize
    }
}
