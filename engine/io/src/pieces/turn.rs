//! Which pieces are to be turned, and what is said about them.

use super::gather::{PieceTable, SurfacePiece};
use super::nesting::{PieceNesting, nested};
use super::{InsideOut, PiecesReport};
use crate::check::IndexedMesh;
use crate::error::Result;
use crate::lattice::Units;
use crate::progress::Progress;
use std::cmp::Reverse;

/// What becomes of each piece.
pub(super) struct TurnDecision {
    /// It is turned over.
    pub turned: Vec<bool>,
    /// In the end it faces inward, as what it bounds is a cavity.
    pub cavity: Vec<bool>,
}

/// Decides piece by piece, by the rule of [`super`]. `starts` are the numbers of the sources' first facets.
///
/// # Errors
/// If the user interrupts.
pub(super) fn decide(
    mesh: &IndexedMesh<Units>,
    gathered: &PieceTable,
    starts: &[u64],
    progress: &dyn Progress,
) -> Result<TurnDecision> {
    let pieces = &gathered.pieces;
    let nested = nested(mesh, gathered, progress)?;
    let mut cavity = vec![false; pieces.len()];
    let mut groups: Vec<&[PieceNesting]> = nested.chunk_by(|a, b| a.inner == b.inner).collect();
    let files = inverted_files(pieces, &groups, starts);
    // What a piece lies in is larger.
    groups.sort_by_key(|group| Reverse(size(&pieces[group[0].inner as usize])));
    for group in groups {
        let inner = &pieces[group[0].inner as usize];
        let outers = || group.iter().map(|pair| pair.outer as usize);
        let field: i64 = outers().map(|outer| if cavity[outer] { -1 } else { 1 }).sum();
        let parent = outers().min_by_key(|&outer| (size(&pieces[outer]), outer));
        let in_reversed = parent.is_some_and(|parent| pieces[parent].is_reversed());
        let was_cavity = inner.is_reversed() || in_reversed && files[source_of(inner.first, starts)];
        cavity[group[0].inner as usize] = was_cavity && field >= 1;
    }
    let turned =
        pieces.iter().zip(&cavity).map(|(piece, cavity)| piece.is_solid() && piece.is_reversed() != *cavity);
    Ok(TurnDecision { turned: turned.collect(), cavity })
}

fn size(piece: &SurfacePiece) -> u128 {
    piece.six_volumes.unsigned_abs()
}

/// The source that a facet is of.
fn source_of(facet: u32, starts: &[u64]) -> usize {
    starts.partition_point(|&start| start <= u64::from(facet)).saturating_sub(1)
}

/// Of each source, whether more than half of its outermost pieces are reversed.
fn inverted_files(pieces: &[SurfacePiece], nested: &[&[PieceNesting]], starts: &[u64]) -> Vec<bool> {
    let mut balance = vec![0i64; starts.len()];
    let mut inners = nested.iter().map(|group| group[0].inner).peekable();
    for (number, piece) in pieces.iter().enumerate().filter(|(_, piece)| piece.is_solid()) {
        while inners.next_if(|&inner| (inner as usize) < number).is_some() {}
        if inners.peek() != Some(&(number as u32)) {
            balance[source_of(piece.first, starts)] += if piece.is_reversed() { 1 } else { -1 };
        }
    }
    balance.into_iter().map(|balance| balance > 0).collect()
}

/// What there is to say, but for the number of facets. `unit` is the length of the lattice's unit.
pub(super) fn report(
    gathered: &PieceTable,
    decision: &TurnDecision,
    starts: &[u64],
    unit: f64,
) -> PiecesReport {
    let pieces = &gathered.pieces;
    let count = |is: &dyn Fn(&SurfacePiece) -> bool| pieces.iter().filter(|piece| is(piece)).count() as u64;
    let flags = decision.turned.iter().zip(&decision.cavity);
    let inside_out = || {
        let outward = pieces.iter().zip(flags.clone()).filter(|(_, (turned, cavity))| **turned && !**cavity);
        outward.map(|(piece, _)| piece)
    };
    let largest = inside_out().min_by_key(|piece| (Reverse(size(piece)), piece.first));
    PiecesReport {
        pieces: pieces.len() as u64,
        open: count(&|piece| piece.open && !piece.mixed),
        inconsistent: count(&|piece| piece.mixed),
        cavities: decision.cavity.iter().filter(|cavity| **cavity).count() as u64,
        inside_out: largest.map(|largest| {
            let source = source_of(largest.first, starts);
            InsideOut {
                pieces: inside_out().count() as u64,
                // Sixths of cubes of two units.
                volume: inside_out().map(size).sum::<u128>() as f64 / 6.0 * (2.0 * unit).powi(3),
                source,
                facet: u64::from(largest.first) - starts[source] + 1,
            }
        }),
        turned_facets: 0,
    }
}
