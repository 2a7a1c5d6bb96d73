//! The loops of a cell next to finer leaves that has several.

use crate::contour::envelope::MinimalEdge;
use crate::contour::transition_cells::MixedCell;

/// A mixed cell with several loops.
pub(super) struct MultiLoopCell {
    pub cell: [usize; 3],
    /// Its first vertex.
    pub first: usize,
    /// By loop, the pieces of its line.
    pub lines: Vec<LoopLine>,
}

pub(super) type LinePoint = [f32; 3];
pub(super) type LoopLine = Vec<LinePiece>;

/// A piece of a line, from where it passes an edge to the vertex on a face.
pub(super) struct LinePiece {
    pub edge: MinimalEdge,
    pub on_edge: LinePoint,
    pub on_face: LinePoint,
}

impl MultiLoopCell {
    pub(super) fn of(cell: [usize; 3], first: usize, mixed: &MixedCell) -> MultiLoopCell {
        let mut lines: Vec<LoopLine> = (0..mixed.loops).map(|_| LoopLine::new()).collect();
        for cut in &mixed.cuts {
            for crossing in mixed.ends(cut) {
                if let Some(line) = lines.get_mut(crossing.in_loop as usize) {
                    let edge = crossing.edge;
                    line.push(LinePiece { edge, on_edge: edge.crossing(), on_face: cut.at });
                }
            }
        }
        MultiLoopCell { cell, first, lines }
    }
}
