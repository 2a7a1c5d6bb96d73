//! Plain cells with several loops, and those whose vertex lies beyond them: what must be seen to where the surface
//! passes their faces ([`super::super::faces`]).

use super::builder::CellsBuilder;
use crate::contour::edges::{EDGE_PLACES, EdgeStreams, NO_VERTEX};
use crate::contour::frame::{CellFrame, SampleCoordinates, along};
use crate::contour::loops::tangled;
use crate::contour::topology::{CellCase, edge_lower};
use crate::lattice::BRICK_CELLS;

impl CellsBuilder<'_> {
    /// Whether the planes of a cell of the leaf alone rule out a corner in any block that the cell is part of.
    pub(in crate::contour) fn is_apart(&self, [i, j, k]: [usize; 3]) -> bool {
        self.sums.is_some() && self.apart[k * BRICK_CELLS + j] >> i & 1 == 1
    }

    /// Takes a plain cell with one loop for one whose vertex lies beyond it.
    pub(in crate::contour) fn let_stray(&mut self, cell: [usize; 3]) {
        let Some((kind, _)) = self.cells.plain(cell) else { return };
        self.cells.special.push(cell.map(|c| c as u8));
        let streams = EdgeStreams::of(self.changes, cell[1], cell[2]);
        for place in kind.loops().edges_of(0).map(|edge| &EDGE_PLACES[edge]) {
            self.quads[streams.slot(cell[0], place)].vertices[place.quadrant] = NO_VERTEX;
        }
    }

    /// Sees to it that the vertices of several loops in one cell are apart, in 32 bits: those that are not go to the mean
    /// of their loop's crossings. Where the surface crosses edges next to samples that may be on the plane between two loops
    /// all the same, so crossings are kept off the ends of edges as far as it takes; means of the middles of edges are
    /// apart however they are rounded ([`super::super::loops`]).
    #[cold]
    pub(super) fn separate_loops(&mut self) {
        if self.cells.special.is_empty() {
            return;
        }
        let lattice = self.frame.lattice();
        for n in 0..self.cells.special.len() {
            let cell = self.cells.special[n].map(usize::from);
            let Some((kind, first)) = self.cells.plain(cell) else { continue };
            let own = first..first + usize::from(kind.loops().count);
            for least in [0.0, 1.0 / 64.0, 0.5] {
                let within = |position: &[f32; 3]| within(&lattice, cell, *position);
                let vertices: Vec<[f64; 3]> = self.cells.positions[own.clone()].iter().map(within).collect();
                let tangled = tangled(kind, &vertices);
                if tangled == 0 {
                    break;
                }
                for l in (0..own.len()).filter(|l| tangled >> l & 1 == 1) {
                    self.cells.positions[first + l] = self.mean_of_crossings(cell, kind, l, least);
                }
            }
        }
    }

    /// The mean of the crossings of a loop of a cell, counted as if they were at least so far from the ends of their edges.
    fn mean_of_crossings(&self, cell: [usize; 3], kind: CellCase, of: usize, least: f64) -> [f32; 3] {
        let loops = kind.loops();
        let streams = EdgeStreams::of(self.changes, cell[1], cell[2]);
        let mut sum = [0.0; 3];
        for edge in loops.edges_of(of) {
            let mut at = self.crossing(cell[0], edge, &streams);
            let along = edge_lower(edge).0.index();
            at[along] = at[along].clamp(least, 1.0 - least);
            (0..3).for_each(|a| sum[a] += at[a]);
        }
        let mean = sum.map(|c| c / f64::from(loops.edges[of].count_ones()));
        let [low, high] = [self.frame.margin, 1.0 - self.frame.margin];
        self.frame.world(cell, mean.map(|c| c.clamp(low, high)))
    }
}

/// Where a position of the world lies in a cell between planes of a lattice, 0..1 along each axis.
pub(in crate::contour) fn within(
    lattice: &SampleCoordinates,
    cell: [usize; 3],
    position: [f32; 3],
) -> [f64; 3] {
    std::array::from_fn(|a| along(lattice, a, cell[a], position[a]))
}

/// World position of the point `at` of a cell, or near it if it is among those `before` it: loops of one cell can have
/// the same minimiser, as on a needle thinner than the cell.
#[inline(always)]
pub(super) fn apart(frame: &CellFrame, cell: [usize; 3], at: [f64; 3], before: &[[f32; 3]]) -> [f32; 3] {
    let position = frame.world(cell, at);
    if before.contains(&position) { moved(frame, cell, at, before) } else { position }
}

#[cold]
fn moved(frame: &CellFrame, cell: [usize; 3], at: [f64; 3], before: &[[f32; 3]]) -> [f32; 3] {
    frame.free_place((cell, 1.0), at, |position| before.contains(position))
}
