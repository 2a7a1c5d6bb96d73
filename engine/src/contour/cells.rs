//! The active cells of one leaf, their loops and the vertices of these.
//!
//! Cells whose surroundings have their own level or a lower one are found by bit arithmetic on the sign rows and
//! looped by a table; those next to finer leaves go to [`super::mixed`].
//!
//! Vertices are numbered within the leaf: cells in the order x, y, z from fast to slow, the loops of a cell in the
//! order of their first edge, then the extra vertices on split faces.
//!
//! *Split faces.* Where the same two loops meet across two cuts of one face, the mesh edge between their vertices
//! would have four triangles, so each cut gets a vertex of its own on the face.
//!
//! Whether that happens is decided from the two cells where both are plain cells of one size; other faces that are cut
//! twice are always split. A face belongs to the finer of its two cells, and to the upper one where they have the same
//! size; every leaf around asks the one that owns it.

mod cones;
mod place;
mod special;
mod split;

use super::annex::{Crease, Direction};
use super::edges::{EDGE_PLACES, EdgeStreams, NO_VERTEX, Quad};
use super::extras::{Extra, SplitPlace, SplitVertex, found_extra};
use super::field::{Field, Frame};
use super::halo::Place;
use super::joined;
use super::leaves::{Around, Side};
use super::mixed::Surroundings;
use super::outliers::Outliers;
use super::planes::EdgePlane;
use super::qef::{PlaneSums, Qef};
use super::solve::{GROUP, Group};
use super::surface::{Changes, EdgeRanks};
use super::topology::{Kind, NO_LOOP};
use crate::brick::{Ranks, SignChanges};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey};
use crate::wide::{Simd, dispatch, level};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};

use cones::Several;
use place::Waiting;
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
    pub kinds: Vec<Kind>,
    /// For each active cell its first vertex or, if it is mixed, its place in `mixed`.
    pub first: Vec<u32>,
    /// Where the edges of each mixed cell end in `mixed_edges`, after a leading zero.
    pub mixed: Vec<u32>,
    /// Minimal edges of mixed cells with the vertex of their loop, sorted within a cell.
    pub mixed_edges: Vec<(u64, u32)>,
    /// Mixed cells with several loops, [z, y, x], in order.
    pub several: Vec<[u8; 3]>,
    /// Sorted by face and edge.
    pub extras: Vec<Extra>,
    /// Plain cells with several loops, and cells whose vertex lies beyond them; see [`super::faces`].
    pub special: Vec<[u8; 3]>,
    /// Cells that have annexed one, in order, and in which direction; see [`super::annex`].
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
    /// Finds the active cells of a leaf and places their vertices.
    pub(super) fn build(field: &Field, leaf: u32) -> Result<BrickCells> {
        let has_finer = field.leaves.has_finer(leaf);
        if !field.leaves.get(leaf).changes && !has_finer {
            return Ok(BrickCells::default());
        }
        let around = field.leaves.around(leaf);
        let surface = field.surface(leaf)?;
        let changes = surface.changes();
        let mut rows = vec![CellRow::default(); CELL_ROWS];
        if let Some(changes) = changes {
            mark_active(&changes.signs, &mut rows);
        }
        let mut surroundings = has_finer.then(|| Surroundings::new(field, leaf, &around));
        if let Some(surroundings) = &mut surroundings {
            surroundings.mark(&mut rows)?;
        }
        let mut rank = 0;
        for row in &mut rows {
            row.set_rank(rank);
            rank += row.active.count_ones();
        }
        if rank == 0 {
            return Ok(BrickCells::of_edges(field, changes));
        }
        let mut builder = Builder::new(field, leaf, &around, changes, rows, rank as usize);
        builder.fill(surroundings.as_mut())?;
        builder.complete_corners()?;
        builder.separate_loops();
        builder.separate_cones();
        Ok(builder.finish())
    }

    /// What is to be known of the leaf's edges.
    fn of_edges(field: &Field, changes: Option<&Changes>) -> BrickCells {
        BrickCells {
            signs: changes.map(|c| c.signs.clone()),
            ranks: changes.filter(|_| field.merges()).map(|c| Arc::clone(c.ranks())),
            ..BrickCells::default()
        }
    }

    /// For the leaf's own polygons, for each sign-changing edge of it, those along x first, the vertices of the four
    /// cells around it in the order of [`super::topology::SQUARE`], [`NO_VERTEX`] for those that are not plain cells
    /// of this leaf with one loop, its vertex within, and without ambiguous faces.
    ///
    /// They are handed over once, because the cells stay for the leaves around.
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
            + self.kinds.capacity() * size_of::<Kind>()
            + 4 * (self.first.capacity() + self.mixed.capacity())
            + self.mixed_edges.capacity() * size_of::<(u64, u32)>()
            + self.several.capacity() * size_of::<[u8; 3]>()
            + self.extras.capacity() * size_of::<Extra>()
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
    pub(super) fn plain(&self, [i, j, k]: [usize; 3]) -> Option<(Kind, usize)> {
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

/// A cell is active when its eight corners are not all alike.
pub(super) fn mark_active(signs: &SignChanges, rows: &mut [CellRow]) {
    for (n, row) in rows.iter_mut().enumerate() {
        let (j, k) = (n % BRICK_CELLS, n / BRICK_CELLS);
        let corners = [signs.row(j, k), signs.row(j + 1, k), signs.row(j, k + 1), signs.row(j + 1, k + 1)];
        let any = corners.iter().fold(0, |or, r| or | r);
        let all = corners.iter().fold(u64::MAX, |and, r| and & r);
        row.active = ((any | any >> 1) & !(all & all >> 1)) as u32;
    }
}

/// Fills a [`BrickCells`] cell by cell.
pub(super) struct Builder<'a> {
    pub field: &'a Field<'a>,
    pub leaf: u32,
    key: NodeKey,
    pub frame: Frame,
    around: &'a Around,
    pub changes: Option<&'a Changes>,
    /// The leaf's Hermite edges.
    planes: &'a [EdgePlane],
    /// One for each of them; see [`BrickCells::take_quads`].
    quads: Vec<Quad>,
    pub cells: BrickCells,
    /// Plain cells with one loop that is not flat, for [`super::corner`].
    pub creased: Vec<[u8; 3]>,
    /// Those of them whose crease is sharp, for [`super::annex`], if creases are followed.
    pub sharp: Vec<([usize; 3], Crease)>,
    /// Those of them that may be at a corner, where there are sums.
    pub candidates: Vec<Place>,
    /// How many of the creased cells, and of the layers of cells along z, these are of.
    pub seen: usize,
    pub decided: usize,
    /// For each active cell the sums over the crossings of all cells before it, about the leaf's first sample, and at
    /// the end those of all; none where there are mixed cells.
    pub sums: Option<Vec<PlaneSums>>,
    /// Those of all cells that are placed.
    sum: PlaneSums,
    /// Cells, as bit rows, whose own planes rule out a corner in any block that they are part of.
    pub apart: Box<[u32; CELL_ROWS]>,
    /// Extra vertices come after all others.
    splits: Vec<SplitVertex>,
    /// Mixed cells with several loops.
    several: Vec<Several>,
    /// Loops whose vertices are placed next; these are the last ones.
    group: Group,
    waiting: Vec<Waiting>,
    /// Lone vertices that need more, of groups before.
    outliers: Outliers,
}

impl<'a> Builder<'a> {
    fn new(
        field: &'a Field<'a>,
        leaf: u32,
        around: &'a Around,
        changes: Option<&'a Changes>,
        rows: Vec<CellRow>,
        active: usize,
    ) -> Builder<'a> {
        let planes = changes.map_or(&[][..], |c| &c.planes);
        let cells = BrickCells {
            rows,
            kinds: Vec::with_capacity(active),
            first: Vec::with_capacity(active),
            positions: Vec::with_capacity(active + active / 16),
            ..BrickCells::of_edges(field, changes)
        };
        let key = field.leaves.get(leaf).key;
        let mut quads = field.spare_quads.take();
        quads.extend(planes.iter().map(|plane| Quad { fraction: plane.offset(), ..Quad::UNKNOWN }));
        Builder {
            field,
            leaf,
            key,
            frame: field.frame(key),
            around,
            changes,
            planes,
            quads,
            cells,
            creased: Vec::with_capacity(active),
            sharp: Vec::new(),
            candidates: Vec::new(),
            seen: 0,
            decided: 0,
            sums: (!around.contains(&Side::Finer)).then(|| {
                let mut sums = field.spare_sums.take();
                // A group is stored as a whole.
                sums.reserve(active + GROUP);
                sums
            }),
            sum: PlaneSums::default(),
            apart: Box::new([0; CELL_ROWS]),
            splits: Vec::new(),
            several: Vec::new(),
            group: Group::new(field.on_surface),
            waiting: Vec::with_capacity(GROUP),
            outliers: Outliers::default(),
        }
    }

    /// As compiled for this processor: bits are counted for every edge of every cell.
    fn fill(&mut self, surroundings: Option<&mut Surroundings>) -> Result<()> {
        dispatch!(level(), simd => self.fill_rows(simd, surroundings))
    }

    #[inline(always)]
    fn fill_rows<S: Simd>(&mut self, simd: S, mut surroundings: Option<&mut Surroundings>) -> Result<()> {
        for n in 0..CELL_ROWS {
            if n % BRICK_CELLS == 0 {
                self.keep_candidates(simd, false);
            }
            let row = self.cells.rows[n];
            if row.active == 0 {
                continue;
            }
            let (j, k) = (n % BRICK_CELLS, n / BRICK_CELLS);
            let streams = EdgeStreams::of(self.changes, j, k);
            let mut bits = row.active;
            while bits != 0 {
                let i = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                match &mut surroundings {
                    Some(surroundings) if row.mixed >> i & 1 == 1 => {
                        self.mixed_cell([i, j, k], surroundings)?
                    }
                    _ => self.plain_cell(simd, [i, j, k], &streams)?,
                }
            }
        }
        self.place();
        self.place_outliers();
        if let Some(sums) = &mut self.sums {
            sums.push(self.sum);
        }
        self.keep_candidates(simd, true);
        Ok(())
    }

    /// That of a plain cell.
    #[inline(always)]
    fn kind(&self, cell: [usize; 3], streams: &EdgeStreams) -> Result<Kind> {
        let Some(changes) = self.changes else { return Ok(Kind::default()) };
        joined::kind_of(self.field, self.key, changes, cell, streams.mask(cell[0]))
    }

    #[inline(always)]
    fn plain_cell<S: Simd>(&mut self, simd: S, cell: [usize; 3], streams: &EdgeStreams) -> Result<()> {
        let kind = self.kind(cell, streams)?;
        let loops = kind.loops();
        let first = self.cells.positions.len();
        self.cells.kinds.push(kind);
        self.cells.first.push(first as u32);
        let is_named = loops.ambiguous == 0 && loops.count == 1;
        for l in 0..loops.count as usize {
            let vertex = first + l;
            let named = if is_named && vertex < NO_VERTEX.into() { vertex as u16 } else { NO_VERTEX };
            let lane = self.waiting.len();
            let (mut edges, mut count) = (loops.edges[l], 0);
            while edges != 0 {
                let place = &EDGE_PLACES[edges.trailing_zeros() as usize];
                let slot = streams.slot(cell[0], place);
                let plane = &self.planes[slot];
                self.group.put(simd, lane, count, place, plane);
                self.quads[slot].vertices[place.quadrant] = named;
                edges &= edges - 1;
                count += 1;
            }
            self.group.count(lane, count);
            self.push_vertex(cell, first, loops.count == 1);
        }
        if loops.count > 1 {
            self.cells.special.push(cell.map(|c| c as u8));
        }
        if loops.ambiguous != 0 {
            self.split_plain_faces(cell, loops, streams)?;
        }
        Ok(())
    }

    /// The crossing on edge `edge` of cell `i` in a row, which changes sign, in cell coordinates.
    fn crossing(&self, i: usize, edge: usize, streams: &EdgeStreams) -> [f64; 3] {
        let place = &EDGE_PLACES[edge];
        let [x, y, z, _] = place.seen_from_centre(&self.planes[streams.slot(i, place)]);
        [x, y, z].map(|c| f64::from(c) + 0.5)
    }

    fn mixed_cell(&mut self, cell: [usize; 3], surroundings: &mut Surroundings) -> Result<()> {
        let mixed = surroundings.loops(cell)?;
        let first = self.cells.positions.len();
        if self.cells.mixed.is_empty() {
            self.cells.mixed.push(0);
        }
        self.cells.kinds.push(Kind::default());
        self.cells.first.push(self.cells.mixed.len() as u32 - 1);
        for l in 0..mixed.loops {
            let mut qef = Qef::default();
            for crossing in mixed.crossings.iter().filter(|c| c.in_loop == l) {
                qef.add(crossing.plane.0, crossing.plane.1);
            }
            self.group.set(self.waiting.len(), &qef);
            self.push_vertex(cell, first, false);
        }
        let edges = mixed.crossings.iter().map(|c| (c.key, first as u32 + c.in_loop));
        self.cells.mixed_edges.extend(edges);
        self.cells.mixed.push(self.cells.mixed_edges.len() as u32);
        self.cells.split_faces += mixed.split_faces;
        if mixed.loops > 1 {
            let [i, j, k] = cell.map(|c| c as u8);
            self.cells.several.push([k, j, i]);
            self.several.push(Several::of(cell, first, &mixed));
        }
        for cut in mixed.cuts.iter().filter(|cut| cut.is_split) {
            let place = SplitPlace::At(cut.at);
            self.splits.extend(cut.face.map(|face| SplitVertex { face, edges: cut.edges, place }));
        }
        Ok(())
    }

    /// Called when all vertices are placed.
    fn finish(mut self) -> BrickCells {
        if let Some(sums) = self.sums.take() {
            self.field.spare_sums.keep(sums);
        }
        if !self.splits.is_empty() {
            let lattice = self.frame.lattice();
            for split in self.splits {
                let vertex = self.cells.positions.len() as u32;
                self.cells.positions.push(split.position(&self.frame, &lattice));
                let SplitVertex { face, edges, .. } = split;
                self.cells.extras.extend(edges.map(|edge| Extra { face, edge, vertex }));
            }
        }
        self.cells.quads = RwLock::new(self.quads);
        self.cells.extras.sort_unstable_by_key(|e| (e.face, e.edge));
        self.cells
    }
}
