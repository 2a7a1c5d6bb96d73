//! The pieces of an input, sorted by the cubes of one level that they touch.

use super::bins::{Binner, SortedRun};
use super::field::Field;
use crate::lattice::NodeKey;

/// Pieces in runs, each sorted by the cube, `stride` levels below the root, that a piece touches.
pub(super) struct SortedPieces<F: Field> {
    runs: Vec<SortedRun<F::Piece>>,
    /// Sums for the corners of those cubes; `None` before the first run.
    pub corners: Option<F::Corners>,
}

impl<F: Field> Default for SortedPieces<F> {
    fn default() -> Self {
        SortedPieces { runs: Vec::new(), corners: None }
    }
}

impl<F: Field> SortedPieces<F> {
    /// Adds a run; every run comes with the same binner, which starts at the root.
    pub fn push(&mut self, field: &F, binner: &Binner, pieces: &[F::Piece]) {
        let corners = self.corners.get_or_insert_with(|| field.corners(NodeKey::ROOT, binner.stride()));
        pieces.iter().for_each(|piece| field.add_corners(corners, piece));
        self.runs.push(SortedRun::new(field, binner, pieces));
    }

    /// Adds the runs of another part.
    pub fn merge(&mut self, field: &F, mut other: SortedPieces<F>) {
        self.runs.append(&mut other.runs);
        match (&mut self.corners, other.corners) {
            (Some(mine), Some(theirs)) => field.merge_corners(mine, &theirs),
            (mine, theirs) => *mine = mine.take().or(theirs),
        }
    }

    /// All pieces of one cube.
    pub fn gather(&self, cell: usize, out: &mut Vec<F::Piece>) {
        out.clear();
        out.reserve_exact(self.count(cell));
        self.runs.iter().for_each(|run| out.extend_from_slice(run.of(cell)));
    }

    /// How many pieces touch one cube.
    pub fn count(&self, cell: usize) -> usize {
        self.runs.iter().map(|run| run.of(cell).len()).sum()
    }
}
