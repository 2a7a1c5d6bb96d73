//! Faces of plain cells that are cut twice.

use super::builder::CellsBuilder;
use crate::contour::edges::EdgeStreams;
use crate::contour::face_ambiguity;
use crate::contour::face_vertices::{SplitFace, SplitPlace, SplitVertex, face_key, middle, plain_edge_key};
use crate::contour::leaves::{LeafNeighbour, direction_index};
use crate::contour::surface::LeafSurface;
use crate::contour::topology::{CellLoops, edge_lower};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS};

/// What is beyond a face of a plain cell.
enum Beyond {
    /// A plain cell of its size.
    Plain,
    /// Another: of another size, or next to finer leaves.
    Uneven,
}

impl CellsBuilder<'_> {
    /// Extra vertices on the faces of a plain cell that this leaf owns and that need them.
    #[cold]
    pub(super) fn split_plain_faces(
        &mut self,
        cell: [usize; 3],
        loops: &CellLoops,
        streams: &EdgeStreams,
    ) -> Result<()> {
        for face in (0..6).filter(|face| loops.ambiguous >> face & 1 == 1) {
            let (axis, side) = (Axis::ALL[face / 2], face % 2);
            let Some(beyond) = self.splits_plain_face(cell, loops, axis, side)? else { continue };
            let Some(changes) = self.changes else { continue };
            self.cells.split_faces += 1;
            let mut corner = cell;
            corner[axis.index()] += side;
            for (enter, leave) in loops.face_cuts(axis, side) {
                let cut = [enter, leave];
                let edges = cut.map(|edge| plain_edge_key(edge, axis, self.key));
                let place = match beyond {
                    Beyond::Plain => {
                        let [p, q] = cut.map(|edge| self.crossing(cell[0], edge, streams));
                        SplitPlace::Near(std::array::from_fn(|a| (p[a] + q[a]) * 0.5), middle(cut))
                    }
                    Beyond::Uneven => {
                        let lattice = self.frame.lattice();
                        let edge = |edge: usize| {
                            let (along, offset) = edge_lower(edge);
                            let low = std::array::from_fn(|a| cell[a] + offset[a]);
                            self.field.minimal_edge((self.leaf, changes), &lattice, (along, low))
                        };
                        let [p, q] = [edge(enter)?, edge(leave)?];
                        SplitPlace::At(SplitFace::new(&lattice, axis, corner).half_way([&p, &q]))
                    }
                };
                self.splits.push(SplitVertex { face: face_key(axis, corner), edges, place });
            }
        }
        Ok(())
    }

    /// Whether a face of a plain cell that is cut twice gets extra vertices of this leaf, and for what cell beyond it.
    fn splits_plain_face(
        &self,
        cell: [usize; 3],
        loops: &CellLoops,
        axis: Axis,
        side: usize,
    ) -> Result<Option<Beyond>> {
        let a = axis.index();
        let mut step = [0; 3];
        step[a] = 2 * side as i32 - 1;
        let beyond = self.around[direction_index(step)];
        if side == 1 {
            let is_own = cell[a] == BRICK_CELLS - 1 && matches!(beyond, LeafNeighbour::Coarser(_));
            return Ok(is_own.then_some(Beyond::Uneven));
        }
        let below = std::array::from_fn(|n| cell[n] as i32 + step[n]);
        // A cell next to a finer leaf may have loops that its own corners do not tell of.
        if self.field.leaves.touches_finer(self.key, below) {
            return Ok(Some(Beyond::Uneven));
        }
        let other = if cell[a] > 0 {
            self.cells.plain(below.map(|c| c as usize)).map(|(kind, _)| kind)
        } else if let LeafNeighbour::Same(other) = beyond
            && let LeafSurface::Changes(changes) = &*self.field.surface(other)?
        {
            let below = below.map(|c| c.rem_euclid(BRICK_CELLS as i32) as usize);
            Some(face_ambiguity::kind(self.field, self.field.leaves.get(other).key, changes, below)?)
        } else {
            None
        };
        let Some(other) = other else { return Ok(Some(Beyond::Uneven)) };
        let rejoined = loops.rejoined >> (2 * a) & other.loops().rejoined >> (2 * a + 1) & 1 == 1;
        Ok(rejoined.then_some(Beyond::Plain))
    }
}
