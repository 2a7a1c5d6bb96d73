//! The cells of a leaf from its samples: which are active, their loops and the vertices of these, cell by cell.

use super::several::MultiLoopCell;
use super::{BrickCells, CELL_ROWS, CellRow};
use crate::brick::SignChanges;
use crate::contour::constrained_qef::ConstrainedLoops;
use crate::contour::crease::Crease;
use crate::contour::edges::{EDGE_PLACES, EdgeStreams, NO_VERTEX, Quad};
use crate::contour::face_ambiguity;
use crate::contour::face_vertices::{FaceVertex, SplitPlace, SplitVertex};
use crate::contour::field::LevelSet;
use crate::contour::frame::CellFrame;
use crate::contour::lanes::GROUP;
use crate::contour::leaves::{LeafNeighbour, LeafNeighbours};
use crate::contour::local_index::LocalIndex;
use crate::contour::planes::EdgePlane;
use crate::contour::qef::{PlaneSums, Qef};
use crate::contour::solve::LoopGroup;
use crate::contour::surface::HermiteSurface;
use crate::contour::topology::CellCase;
use crate::contour::transition_cells::TransitionLeaf;
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey};
use crate::wide::{Simd, dispatch, level};
use std::sync::{Arc, RwLock};

/// Finds the active cells of a leaf and places their vertices.
pub(in crate::contour) fn build(field: &LevelSet, leaf: u32) -> Result<BrickCells> {
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
    let mut surroundings = has_finer.then(|| TransitionLeaf::new(field, leaf, &around));
    if let Some(surroundings) = &mut surroundings {
        surroundings.mark(&mut rows)?;
    }
    let mut rank = 0;
    for row in &mut rows {
        row.set_rank(rank);
        rank += row.active.count_ones();
    }
    if rank == 0 {
        return Ok(of_edges(field, changes));
    }
    let mut builder = CellsBuilder::new(field, leaf, &around, changes, rows, rank as usize);
    builder.fill(surroundings.as_mut())?;
    builder.complete_corners()?;
    builder.separate_loops();
    builder.separate_cones();
    Ok(builder.finish())
}

/// What is to be known of the leaf's edges.
fn of_edges(field: &LevelSet, changes: Option<&HermiteSurface>) -> BrickCells {
    BrickCells {
        signs: changes.map(|c| c.signs.clone()),
        ranks: changes.filter(|_| field.merges()).map(|c| Arc::clone(c.ranks())),
        ..BrickCells::default()
    }
}

/// A cell is active when its eight corners are not all alike.
pub(in crate::contour) fn mark_active(signs: &SignChanges, rows: &mut [CellRow]) {
    for (n, row) in rows.iter_mut().enumerate() {
        let (j, k) = (n % BRICK_CELLS, n / BRICK_CELLS);
        let corners = [signs.row(j, k), signs.row(j + 1, k), signs.row(j, k + 1), signs.row(j + 1, k + 1)];
        let any = corners.iter().fold(0, |or, r| or | r);
        let all = corners.iter().fold(u64::MAX, |and, r| and & r);
        row.active = ((any | any >> 1) & !(all & all >> 1)) as u32;
    }
}

/// A loop in a group.
#[derive(Clone, Copy)]
pub(super) struct PendingLoop {
    pub cell: [u8; 3],
    /// A plain cell with one loop.
    pub is_lone: bool,
    /// First vertex of the cell, and the loop's own.
    pub first: u32,
    pub vertex: u32,
}

/// Fills a [`BrickCells`] cell by cell.
pub(in crate::contour) struct CellsBuilder<'a> {
    pub field: &'a LevelSet<'a>,
    pub leaf: u32,
    pub(super) key: NodeKey,
    pub frame: CellFrame,
    pub(super) around: &'a LeafNeighbours,
    pub changes: Option<&'a HermiteSurface>,
    /// The leaf's Hermite edges.
    pub(super) planes: &'a [EdgePlane],
    /// One for each of them; see [`BrickCells::take_quads`].
    pub(super) quads: Vec<Quad>,
    pub cells: BrickCells,
    /// Plain cells with one loop that is not flat, for [`super::corner`].
    pub creased: Vec<[u8; 3]>,
    /// Those of them whose crease is sharp, for [`super::crease_extension`], if creases are followed.
    pub sharp: Vec<([usize; 3], Crease)>,
    /// Those of them that may be at a corner, where there are sums.
    pub candidates: Vec<LocalIndex>,
    /// How many of the creased cells, and of the layers of cells along z, these are of.
    pub seen: usize,
    pub decided: usize,
    /// For each active cell the sums over the crossings of all cells before it, about the leaf's first sample, and at
    /// the end those of all; none where there are mixed cells.
    pub sums: Option<Vec<PlaneSums>>,
    /// Those of all cells that are placed.
    pub(super) sum: PlaneSums,
    /// Cells, as bit rows, whose own planes rule out a corner in any block that they are part of.
    pub apart: Box<[u32; CELL_ROWS]>,
    /// Extra vertices come after all others.
    pub(super) splits: Vec<SplitVertex>,
    /// Mixed cells with several loops.
    pub(super) several: Vec<MultiLoopCell>,
    /// Loops whose vertices are placed next; these are the last ones.
    pub(super) group: LoopGroup,
    pub(super) waiting: Vec<PendingLoop>,
    /// Lone vertices that need more, of groups before.
    pub(super) outliers: ConstrainedLoops,
}

impl<'a> CellsBuilder<'a> {
    fn new(
        field: &'a LevelSet<'a>,
        leaf: u32,
        around: &'a LeafNeighbours,
        changes: Option<&'a HermiteSurface>,
        rows: Vec<CellRow>,
        active: usize,
    ) -> CellsBuilder<'a> {
        let planes = changes.map_or(&[][..], |c| &c.planes);
        let cells = BrickCells {
            rows,
            kinds: Vec::with_capacity(active),
            first: Vec::with_capacity(active),
            positions: Vec::with_capacity(active + active / 16),
            ..of_edges(field, changes)
        };
        let key = field.leaves.get(leaf).key;
        let mut quads = field.spare_quads.take();
        quads.extend(planes.iter().map(|plane| Quad { fraction: plane.offset(), ..Quad::UNKNOWN }));
        CellsBuilder {
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
            sums: (!around.contains(&LeafNeighbour::Finer)).then(|| {
                let mut sums = field.spare_sums.take();
                // A group is stored as a whole.
                sums.reserve(active + GROUP);
                sums
            }),
            sum: PlaneSums::default(),
            apart: Box::new([0; CELL_ROWS]),
            splits: Vec::new(),
            several: Vec::new(),
            group: LoopGroup::new(field.on_surface),
            waiting: Vec::with_capacity(GROUP),
            outliers: ConstrainedLoops::default(),
        }
    }

    /// As compiled for this processor: bits are counted for every edge of every cell.
    fn fill(&mut self, surroundings: Option<&mut TransitionLeaf>) -> Result<()> {
        dispatch!(level(), simd => self.fill_rows(simd, surroundings))
    }

    #[inline(always)]
    fn fill_rows<S: Simd>(&mut self, simd: S, mut surroundings: Option<&mut TransitionLeaf>) -> Result<()> {
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
    fn kind(&self, cell: [usize; 3], streams: &EdgeStreams) -> Result<CellCase> {
        let Some(changes) = self.changes else { return Ok(CellCase::default()) };
        face_ambiguity::kind_of(self.field, self.key, changes, cell, streams.mask(cell[0]))
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
    pub(super) fn crossing(&self, i: usize, edge: usize, streams: &EdgeStreams) -> [f64; 3] {
        let place = &EDGE_PLACES[edge];
        let [x, y, z, _] = place.seen_from_centre(&self.planes[streams.slot(i, place)]);
        [x, y, z].map(|c| f64::from(c) + 0.5)
    }

    fn mixed_cell(&mut self, cell: [usize; 3], surroundings: &mut TransitionLeaf) -> Result<()> {
        let mixed = surroundings.loops(cell)?;
        let first = self.cells.positions.len();
        if self.cells.mixed.is_empty() {
            self.cells.mixed.push(0);
        }
        self.cells.kinds.push(CellCase::default());
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
            self.several.push(MultiLoopCell::of(cell, first, &mixed));
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
                self.cells.extras.extend(edges.map(|edge| FaceVertex { face, edge, vertex }));
            }
        }
        self.cells.quads = RwLock::new(self.quads);
        self.cells.extras.sort_unstable_by_key(|e| (e.face, e.edge));
        self.cells
    }
}
