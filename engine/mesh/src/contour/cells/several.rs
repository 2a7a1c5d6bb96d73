//! The loops of a cell next to finer leaves that has several.

use crate::contour::envelope::MinimalEdge;
use crate::contour::mixed::MixedCell;

/// A mixed cell with several loops.
pub(super) struct Several {
    pub cell: [usize; 3],
    /// Its first vertex.
    pub first: usize,
    /// By loop, the pieces of its line.
    pub lines: Vec<Line>,
}

pub(super) type Point = [f32; 3];
pub(super) type Line = Vec<Piece>;

/// A piece of a line, from where it passes an edge to the vertex on a face.
pub(super) struct Piece {
    pub edge: MinimalEdge,
    pub on_edge: Point,
    pub on_face: Point,
}

impl Several {
    pub(super) fn of(cell: [usize; 3], first: usize, mixed: &MixedCell) -> Several {
        let mut lines: Vec<Line> = (0..mixed.loops).map(|_| Line::new()).collect();
        for cut in &mixed.cuts {
            for crossing in mixed.ends(cut) {
                if let Some(line) = lines.get_mut(crossing.in_loop as usize) {
                    let edge = crossing.edge;
                    line.push(Piece { edge, on_edge: edge.crossing(), on_face: cut.at });
                }
            }
        }
        Several { cell, first, lines }
    }
}
