//! The pieces of an input, sorted by the cubes of one level that they touch.

use super::bins::{Binner, SortedRun};
use super::field::PieceField;
use crate::error::Result;
use crate::lattice::NodeKey;

/// Pieces that lie elsewhere than in [`SortedPieces`]' own runs, sorted by cube alike.
pub(super) trait CellStore<F: PieceField>: Send + Sync {
    /// How many pieces touch one cube.
    fn count(&self, cell: usize) -> usize;
    /// Calls `block` with all pieces of a cube, in parts that fit in memory.
    fn for_blocks(&self, cell: usize, block: &mut dyn FnMut(&[F::Piece]) -> Result<()>) -> Result<()>;
    /// Sorts the pieces of a cube by its parts, which the binner names, within `memory` bytes.
    fn split(&self, cell: usize, binner: &Binner, memory: u64) -> Result<SortedPieces<F>>;
    /// Memory taken.
    fn heap_bytes(&self) -> u64;
}

/// Pieces in runs, each sorted by the cube, `stride` levels below a node, that a piece touches.
pub(super) struct SortedPieces<F: PieceField> {
    runs: Vec<SortedRun<F::Piece>>,
    /// Those that the runs do not hold.
    pub elsewhere: Option<Box<dyn CellStore<F>>>,
    /// Sums for the corners of those cubes; `None` before the first run.
    pub corners: Option<F::Corners>,
}

impl<F: PieceField> Default for SortedPieces<F> {
    fn default() -> Self {
        SortedPieces { runs: Vec::new(), elsewhere: None, corners: None }
    }
}

impl<F: PieceField> SortedPieces<F> {
    /// Pieces that are all elsewhere, and their sums.
    pub fn kept_elsewhere(corners: F::Corners, pieces: Box<dyn CellStore<F>>) -> SortedPieces<F> {
        SortedPieces { runs: Vec::new(), elsewhere: Some(pieces), corners: Some(corners) }
    }

    /// All pieces of an input, for a tree whose nodes decide from the root on.
    pub fn of_all(field: &F, pieces: &[F::Piece]) -> SortedPieces<F> {
        let mut sorted = SortedPieces::default();
        sorted.push(field, &Binner::new(NodeKey::ROOT, 0), pieces);
        sorted
    }

    /// Adds a run; every run comes with the same binner.
    pub fn push(&mut self, field: &F, binner: &Binner, pieces: &[F::Piece]) {
        self.add_corners(field, binner, pieces);
        self.runs.push(SortedRun::new(field, binner, pieces));
    }

    /// Adds pieces to the sums for the corners only.
    pub fn add_corners(&mut self, field: &F, binner: &Binner, pieces: &[F::Piece]) {
        let corners = self.corners.get_or_insert_with(|| field.corners(binner.node(), binner.stride()));
        pieces.iter().for_each(|piece| field.add_corners(corners, piece));
    }

    /// Adds a run that is sorted already and whose pieces are in the sums.
    pub fn push_sorted(&mut self, run: SortedRun<F::Piece>) {
        self.runs.push(run);
    }

    /// Takes the runs away; the sums stay.
    pub fn take_runs(&mut self) -> Vec<SortedRun<F::Piece>> {
        std::mem::take(&mut self.runs)
    }

    /// Those of its own pieces of a cube that are not elsewhere, sorted by parts of the cube.
    pub fn push_own_of(&self, cell: usize, field: &F, binner: &Binner, to: &mut SortedPieces<F>) {
        let own = self.runs.iter().map(|run| run.of(cell)).filter(|pieces| !pieces.is_empty());
        own.for_each(|pieces| to.push(field, binner, pieces));
    }

    /// Adds the runs of another part, which must not hold pieces elsewhere.
    pub fn merge(&mut self, field: &F, mut other: SortedPieces<F>) {
        self.runs.append(&mut other.runs);
        match (&mut self.corners, other.corners) {
            (Some(mine), Some(theirs)) => field.merge_corners(mine, &theirs),
            (mine, theirs) => *mine = mine.take().or(theirs),
        }
    }

    /// Memory taken.
    pub fn heap_bytes(&self) -> u64 {
        let runs: u64 = self.runs.iter().map(SortedRun::heap_bytes).sum();
        runs + self.elsewhere.as_ref().map_or(0, |store| store.heap_bytes())
    }

    /// All pieces of one cube.
    ///
    /// # Errors
    /// If they are in a file that cannot be read.
    pub fn gather(&self, cell: usize, out: &mut Vec<F::Piece>) -> Result<()> {
        out.clear();
        out.reserve_exact(self.count(cell));
        self.for_blocks(cell, &mut |pieces| {
            out.extend_from_slice(pieces);
            Ok(())
        })
    }

    /// Calls `block` with all pieces of one cube in parts.
    ///
    /// # Errors
    /// As [`Self::gather`], and what `block` gives.
    pub fn for_blocks(&self, cell: usize, block: &mut dyn FnMut(&[F::Piece]) -> Result<()>) -> Result<()> {
        self.runs
            .iter()
            .map(|run| run.of(cell))
            .filter(|pieces| !pieces.is_empty())
            .try_for_each(&mut *block)?;
        self.elsewhere.as_ref().map_or(Ok(()), |store| store.for_blocks(cell, block))
    }

    /// How many pieces touch one cube.
    pub fn count(&self, cell: usize) -> usize {
        let runs: usize = self.runs.iter().map(|run| run.of(cell).len()).sum();
        runs + self.elsewhere.as_ref().map_or(0, |store| store.count(cell))
    }
}
