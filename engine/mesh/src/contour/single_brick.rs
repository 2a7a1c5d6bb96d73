//! What contouring makes of a brick on its own, for a build that decides whether the brick is fine enough. It is the
//! vertex of every cell that the surface passes, by the code that places it in the mesh of a tree.
//!
//! Only bricks are of use there in which one sheet passes each cell: the others are left alone.

use super::cells::{self, CELL_ROWS, CellRow, mark_active};
use super::edges::{EDGE_PLACES, EdgeStreams};
use super::frame::CellFrame;
use super::options::{ContourMethod, ContourOptions};
use super::planes::HermitePlane;
use super::qef::PlaneSums;
use super::stages;
use super::surface::{HermiteSurface, IsoLevel, LeafSurface};
use super::topology::{CellCase, CellLoops};
use crate::brick::{Brick, Samples, SignChanges};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey, RootCube};
use crate::store::{BrickTree, MemoryTree};
use std::sync::Arc;

/// Bytes for what is made of the one brick: signs and planes, then cells.
const CACHE_BYTES: usize = 64 << 20;
/// How far from the middle of its cell a vertex may be, in cells, along each axis: one that stands for a corner goes into
/// the next.
const REACH: f64 = 1.5;
/// What the rounding of Hermite edges makes of distances within a cell.
const ROUNDING: f64 = 2e-4;

/// A brick as the only leaf of a tree.
pub struct SingleBrick {
    tree: MemoryTree,
}

/// The cells of a brick that the surface passes, once each.
pub struct SingleBrickCells {
    rows: Vec<CellRow>,
    vertices: Vec<[f64; 3]>,
    /// Where the planes of each cell end, after a leading zero.
    ends: Vec<u32>,
    planes: Vec<HermitePlane>,
}

impl SingleBrick {
    /// A brick with its Hermite edges, whose samples 0 to 32 lie in the world as those of the root of `cube` do.
    pub fn new(brick: Brick, cube: RootCube) -> SingleBrick {
        let mut tree = MemoryTree::new(cube);
        tree.insert(NodeKey::ROOT, true, brick);
        SingleBrick { tree }
    }

    /// The brick.
    pub fn into_brick(self) -> Result<Brick> {
        let brick = self.tree.brick(NodeKey::ROOT)?;
        drop(self.tree);
        Ok(Arc::try_unwrap(brick).unwrap_or_else(|shared| (*shared).clone()))
    }

    /// Its cells; `None` if one has several loops or an ambiguous face, or if no point in or next to one is within
    /// `miss` cells of all the planes of its crossings. Most bricks that are too coarse show it in one of their first
    /// cells, before any vertex is placed.
    pub fn cells(&self, miss: f64) -> Result<Option<SingleBrickCells>> {
        let options = ContourOptions {
            cache_bytes: CACHE_BYTES,
            method: ContourMethod::Dual,
            ..ContourOptions::default()
        };
        let field = stages::field(&self.tree, IsoLevel { threshold: 1, iso: 0.5 }, &options)?;
        let surface = field.surface(0)?;
        let LeafSurface::Changes(changes) = &*surface else { return Ok(Some(SingleBrickCells::none())) };
        let Some(mut cells) = SingleBrickCells::planes(changes, miss + ROUNDING) else { return Ok(None) };
        let built = cells::build(&field, 0)?;
        let frame: CellFrame = field.frame(NodeKey::ROOT);
        // One loop a cell, no extra vertices: vertices are numbered as active cells are.
        cells.vertices = built.positions.iter().map(|&position| frame.local(position)).collect();
        Ok((cells.vertices.len() + 1 == cells.ends.len()).then_some(cells))
    }
}

/// Whether no cell of a brick with these samples has several loops or an ambiguous face, as far as signs tell.
pub fn has_one_sheet(samples: &Samples) -> bool {
    let signs = SignChanges::of(samples);
    let mut rows = vec![CellRow::default(); CELL_ROWS];
    mark_active(&signs, &mut rows);
    rows.iter().enumerate().all(|(n, row)| {
        let (j, k) = (n % BRICK_CELLS, n / BRICK_CELLS);
        let mut bits = row.active;
        while bits != 0 {
            let i = bits.trailing_zeros();
            bits &= bits - 1;
            let pair = |j, k| (signs.row(j, k) >> i) as u8 & 3;
            let mask = pair(j, k) | pair(j + 1, k) << 2 | pair(j, k + 1) << 4 | pair(j + 1, k + 1) << 6;
            if !is_plain(CellCase::of(mask).loops()) {
                return false;
            }
        }
        true
    })
}

fn is_plain(loops: &CellLoops) -> bool {
    loops.count == 1 && loops.ambiguous == 0
}

impl SingleBrickCells {
    /// Of a brick whose samples are all inside, or all outside.
    pub fn none() -> SingleBrickCells {
        SingleBrickCells { rows: Vec::new(), vertices: Vec::new(), ends: vec![0], planes: Vec::new() }
    }

    /// All but the vertices.
    fn planes(changes: &HermiteSurface, miss: f64) -> Option<SingleBrickCells> {
        let mut cells =
            SingleBrickCells { rows: vec![CellRow::default(); CELL_ROWS], ..SingleBrickCells::none() };
        mark_active(&changes.signs, &mut cells.rows);
        let mut rank = 0;
        for n in 0..CELL_ROWS {
            let row = &mut cells.rows[n];
            row.set_rank(rank);
            rank += row.active.count_ones();
            let mut bits = row.active;
            let (j, k) = (n % BRICK_CELLS, n / BRICK_CELLS);
            let streams = EdgeStreams::of((bits != 0).then_some(changes), j, k);
            while bits != 0 {
                let i = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                cells.push([i, j, k], changes, &streams, miss)?;
            }
        }
        Some(cells)
    }

    /// The planes of the next cell; `None` if that is not one of use.
    fn push(
        &mut self,
        cell: [usize; 3],
        changes: &HermiteSurface,
        streams: &EdgeStreams,
        miss: f64,
    ) -> Option<()> {
        let loops = CellCase::of(changes.mask(cell)).loops();
        if !is_plain(loops) {
            return None;
        }
        let centre = cell.map(|c| c as f64 + 0.5);
        let mut sums = PlaneSums::default();
        for edge in loops.edges_of(0) {
            let place = &EDGE_PLACES[edge];
            let plane = &changes.planes[streams.slot(cell[0], place)];
            let [x, y, z, _] = place.seen_from_centre(plane).map(f64::from);
            let at = [centre[0] + x, centre[1] + y, centre[2] + z];
            let normal = plane.normal.map(f64::from);
            sums.add([x, y, z], normal);
            self.planes.push((at, normal));
        }
        self.ends.push(self.planes.len() as u32);
        sums.may_share_point([0.0; 3], REACH, miss).then_some(())
    }

    /// The vertex of a cell and the planes of its crossings, in cells of the brick; `None` if the surface does not pass it.
    #[inline]
    pub fn at(&self, [i, j, k]: [usize; 3]) -> Option<([f64; 3], &[HermitePlane])> {
        let row = self.rows.get(k * BRICK_CELLS + j)?;
        if row.active >> i & 1 == 0 {
            return None;
        }
        let slot = row.slot(i);
        Some((self.vertices[slot], &self.planes[self.ends[slot] as usize..self.ends[slot + 1] as usize]))
    }
}
