//! How much work each cube of a tree is, before any of it is done: what shards are cut by.
//!
//! All are sums and unions over the pieces, so that every machine finds the same, in whatever order it reads them.

use super::bins::Binner;
use super::field::PieceField;
use super::snap::read;
use super::soup::Soup;
use crate::error::Result;
use crate::ingest::{Facets, runs};
use crate::lattice::{GOLDEN, NodeKey, ROOT_BITS, RootCube, Triangle, Units, mix};
use crate::progress::Progress;
use crate::schedule::fold_in_order;

/// What a leaf costs, in the time that one more piece in a cube does.
const LEAF: u64 = 512;
/// Deepest level at which leaves are told apart: 2 million bits.
const FINEST: u8 = 7;
/// Pieces weighed at a time, where they are in memory.
const RUN: usize = 1 << 14;

/// What is known of pieces of a tree.
pub(super) struct CostMap {
    binner: Binner,
    depth: u8,
    /// Pieces that touch each cube.
    touching: Vec<u64>,
    /// Level of `occupied`.
    fine: u8,
    /// Bits of the cubes, along the Morton curve, that hold a corner of a piece.
    occupied: Vec<u64>,
    /// A sum over all pieces: other pieces give another.
    pub sum: u64,
}

impl CostMap {
    /// Of no pieces, for the cubes of `level` in a tree of `depth`.
    fn new(level: u8, depth: u8) -> CostMap {
        let binner = Binner::new(NodeKey::ROOT, level);
        let fine = depth.min(FINEST).max(level);
        let occupied = vec![0; (1usize << (3 * u32::from(fine))).div_ceil(64)];
        CostMap { binner, depth, touching: vec![0; binner.cells()], fine, occupied, sum: 0 }
    }

    fn add<F: PieceField>(&mut self, field: &F, pieces: &[F::Piece]) {
        let (fine, shift) = (self.fine, ROOT_BITS - u32::from(self.fine));
        // Most points lie in the same cube as the one before.
        let mut before: Option<Units> = None;
        for piece in pieces {
            let points = field.points(piece);
            self.sum = self.sum.wrapping_add(hash(points.as_ref(), field.bounds(piece)));
            if field.is_void(piece) {
                continue;
            }
            let touching = &mut self.touching;
            self.binner.for_touched(field, piece, |cell| touching[cell] += 1);
            for point in points.as_ref() {
                let at: Units = point.map(|c| c.clamp(0, (1 << ROOT_BITS) - 1) >> shift);
                if before.replace(at) != Some(at)
                    && let Some(key) = NodeKey::new(fine, at.map(|c| c as u32))
                {
                    let bit = key.code() ^ (1 << (3 * u32::from(fine)));
                    self.occupied[(bit / 64) as usize] |= 1 << (bit % 64);
                }
            }
        }
    }

    /// Of the pieces of both.
    pub fn and(mut self, other: &CostMap) -> CostMap {
        self.sum = self.sum.wrapping_add(other.sum);
        self.touching.iter_mut().zip(&other.touching).for_each(|(mine, theirs)| *mine += theirs);
        self.occupied.iter_mut().zip(&other.occupied).for_each(|(mine, theirs)| *mine |= theirs);
        self
    }

    /// The work of each cube. A surface that passes through a cube meets as many leaves as lie on one of its sides, if
    /// not more; pieces smaller than leaves show how many more.
    pub fn of_cubes(&self) -> Vec<u64> {
        let level = self.binner.stride();
        let leaves_below = |level: u8| 1u64 << (2 * u32::from(self.depth - level)).min(40);
        let fine_in_cube = 1usize << (3 * u32::from(self.fine - level));
        let is_occupied = |at: usize| self.occupied[at / 64] >> (at % 64) & 1;
        let of_cube = |(cell, &touching): (usize, &u64)| {
            if touching == 0 {
                return 0;
            }
            let occupied: u64 = (cell * fine_in_cube..(cell + 1) * fine_in_cube).map(is_occupied).sum();
            let leaves = (occupied * leaves_below(self.fine)).max(leaves_below(level));
            touching + LEAF * leaves
        };
        self.touching.iter().enumerate().map(of_cube).collect()
    }
}

/// A number that pieces with other points or another extent hardly share: a sum of products (multilinear hashing,
/// Carter & Wegman 1979), because a chain of hashes takes longer than all else that is done with a triangle.
fn hash(points: &[Units], (low, high): (Units, Units)) -> u64 {
    let mut factor = GOLDEN;
    let mut sum = 0u64;
    for &c in points.iter().chain([&low, &high]).flatten() {
        sum = sum.wrapping_add((c as u64).wrapping_mul(factor));
        factor = factor.wrapping_mul(0xd134_2543_de82_ef95);
    }
    // So that sums over pieces that exchange corners differ.
    mix(sum)
}

/// Weighs the triangles of all sources for cubes of `level`; a pass over the input.
///
/// # Errors
/// If the user interrupts.
pub(super) fn weigh_soup(
    sources: &[&dyn Facets],
    root: RootCube,
    (level, depth): (u8, u8),
    progress: &dyn Progress,
) -> Result<CostMap> {
    progress.phase("weighing", Some(sources.iter().map(|source| source.facets()).sum()), "facets");
    let none = || CostMap::new(level, depth);
    let part = || (none(), Vec::new(), Vec::<Triangle>::new());
    let parts = fold_in_order(&runs(sources), part, |(work, world, snapped), (source, range)| {
        progress.check()?;
        read(sources[*source], range.clone(), root, world, snapped);
        work.add(&Soup::CPU, snapped);
        progress.advance(snapped.len() as u64);
        Ok(())
    })?;
    Ok(parts.iter().fold(none(), |all, (work, ..)| all.and(work)))
}

/// Weighs pieces that are in memory.
///
/// # Errors
/// If the user interrupts.
pub(super) fn weigh_pieces<F: PieceField>(
    field: &F,
    pieces: &[F::Piece],
    (level, depth): (u8, u8),
    progress: &dyn Progress,
) -> Result<CostMap> {
    progress.phase("weighing", Some(pieces.len() as u64), "pieces");
    let none = || CostMap::new(level, depth);
    let runs: Vec<&[F::Piece]> = pieces.chunks(RUN).collect();
    let parts = fold_in_order(&runs, none, |work, run| {
        progress.check()?;
        work.add(field, run);
        progress.advance(run.len() as u64);
        Ok(())
    })?;
    Ok(parts.iter().fold(none(), CostMap::and))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use proptest::prelude::*;

    fn weigh(triangles: &[Triangle]) -> (u64, Vec<u64>) {
        let work = weigh_pieces(&Soup::CPU, triangles, (2, 4), &Silent).unwrap();
        (work.sum, work.of_cubes())
    }

    #[test]
    fn only_touched_cubes_are_work_and_small_pieces_show_leaves() {
        let at = |x: i32| [[x, 2, 2], [x + 2, 2, 2], [x, 4, 2]];
        let (_, one) = weigh(&[at(2)]);
        assert_eq!(one.iter().filter(|&&work| work > 0).count(), 1);
        assert_eq!(one[0], 1 + 16 * LEAF);
        // Every leaf of the cube's 64 holds one.
        let leaf = 1 << (ROOT_BITS - 4);
        let places = (0..64).map(|n| [n % 4, n / 4 % 4, n / 16].map(|i| i * leaf + 8));
        let dense: Vec<Triangle> =
            places.map(|[x, y, z]| [[x, y, z], [x + 2, y, z], [x, y + 2, z]]).collect();
        assert_eq!(weigh(&dense).1[0], 64 + 64 * LEAF);
        // Without an area it is no work, but it is a piece.
        let void = [[2, 2, 2]; 3];
        assert_eq!(weigh(&[void]).1, weigh(&[]).1);
        assert_ne!(weigh(&[void]).0, weigh(&[]).0);
    }

    proptest! {
        #[test]
        fn the_order_does_not_matter_and_every_corner_does(
            mut triangles in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(1i32..1 << 22)), 2..40),
            at in any::<prop::sample::Index>(),
        ) {
            triangles.iter_mut().flatten().flatten().for_each(|c| *c *= 2);
            let before = weigh(&triangles);
            triangles.reverse();
            prop_assert_eq!(&weigh(&triangles), &before);
            let at = at.index(triangles.len());
            triangles[at][1][2] ^= 2;
            prop_assert_ne!(weigh(&triangles).0, before.0);
        }
    }
}
