//! The crossings and signs about a leaf: its own, and those of the leaves of its level around it.
//!
//! Cells and samples are counted from the leaf's first one, so those below it are negative. What is said of a place is
//! the same whichever leaf asks: [`super::corner`] rests on that, because two leaves must agree on whose vertex goes
//! to a corner between them.
//!
//! Leaves of other levels are not looked into; of the border with them only the own apron is known.

use super::crease::Crease;
use super::edges::{EDGE_PLACES, EdgeStreams};
use super::face_ambiguity;
use super::field::LevelSet;
use super::local_index::LocalIndex;
use super::planes::HermitePlane;
use super::qef::MISS;
use super::solve::LoopGroup;
use super::surface::{HermiteSurface, LeafSurface};
use super::topology::CellCase;
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, NodeKey};
use crate::wide::{dispatch, level};
use std::sync::Arc;

const SIDE: i32 = BRICK_CELLS as i32;

/// A leaf of the level of the one in the middle, fetched when needed.
enum Piece {
    NotFetched,
    OtherLevel,
    /// Its surface, and whether there are finer leaves around it.
    Fetched(Arc<LeafSurface>, bool),
}

impl Piece {
    fn of(field: &LevelSet, leaf: u32) -> Result<Piece> {
        Ok(Piece::Fetched(field.surface(leaf)?, field.leaves.has_finer(leaf)))
    }
}

/// A leaf and its surroundings.
pub(super) struct Halo<'a> {
    field: &'a LevelSet<'a>,
    key: NodeKey,
    /// The leaf itself in the middle, the 26 around it by direction.
    pieces: [Piece; 27],
}

/// A crossing with the name of its edge: axis and lower sample, z first, then whether it comes from the apron
/// of a leaf below.
pub(super) type NamedPlane = ((usize, [i32; 3], bool), HermitePlane);

fn piece_index(d: LocalIndex) -> usize {
    ((d[2] + 1) * 9 + (d[1] + 1) * 3 + d[0] + 1) as usize
}

impl<'a> Halo<'a> {
    pub(super) fn new(field: &'a LevelSet<'a>, leaf: u32) -> Result<Halo<'a>> {
        let mut pieces = [const { Piece::NotFetched }; 27];
        pieces[piece_index([0; 3])] = Piece::of(field, leaf)?;
        Ok(Halo { field, key: field.leaves.get(leaf).key, pieces })
    }

    /// Fetches the leaves that hold the cells between the samples `low` and `high`.
    #[inline]
    pub(super) fn fetch(&mut self, low: LocalIndex, high: LocalIndex) -> Result<()> {
        if low.iter().all(|&c| c >= 0) && high.iter().all(|&c| c <= SIDE) {
            return Ok(());
        }
        self.fetch_around(low, high)
    }

    #[cold]
    fn fetch_around(&mut self, low: LocalIndex, high: LocalIndex) -> Result<()> {
        for d in directions(low, high) {
            let piece = &mut self.pieces[piece_index(d)];
            if matches!(piece, Piece::NotFetched) {
                *piece = match self.key.neighbour(d).and_then(|key| self.field.leaves.exact(key)) {
                    Some(leaf) => Piece::of(self.field, leaf)?,
                    None => Piece::OtherLevel,
                };
            }
        }
        Ok(())
    }

    /// The surface that has a cell of a fetched leaf of this level, which touches no finer leaf, and where: the
    /// direction of the leaf, and the cell counted from its first one.
    fn plain(&self, cell: LocalIndex) -> Option<(&LeafSurface, LocalIndex, [usize; 3])> {
        let d = cell.map(|c| c.div_euclid(SIDE));
        let Piece::Fetched(surface, has_finer) = &self.pieces[piece_index(d)] else { return None };
        (!has_finer || !self.field.leaves.touches_finer(self.key, cell))
            .then(|| (&**surface, d, cell.map(|c| c.rem_euclid(SIDE) as usize)))
    }

    /// The corner mask of such a cell; `None` for others.
    pub(super) fn plain_mask(&self, cell: LocalIndex) -> Option<u8> {
        self.plain(cell).map(|(surface, _, cell)| surface.mask(cell))
    }

    /// The number of loops of such a cell; 0 for others.
    pub(super) fn loops(&self, cell: LocalIndex) -> Result<u8> {
        Ok(self.active(cell)?.map_or(0, |(_, _, kind)| kind.loops().count))
    }

    /// Such a cell, as its leaf sees it, if it has one loop.
    fn lone(&self, cell: LocalIndex) -> Result<Option<(&HermiteSurface, [usize; 3], CellCase)>> {
        Ok(self.active(cell)?.filter(|(_, _, kind)| kind.loops().count == 1))
    }

    /// The sharp crease of such a cell, found in the first lane of `group`, which is empty; see [`super::crease_extension`].
    pub(super) fn sharp_crease(&self, cell: LocalIndex, group: &mut LoopGroup) -> Result<Option<Crease>> {
        let Some((changes, cell, kind)) = self.lone(cell)? else { return Ok(None) };
        Ok(dispatch!(level(), simd => {
            let streams = EdgeStreams::of(Some(changes), cell[1], cell[2]);
            let mut count = 0;
            for place in kind.loops().edges_of(0).map(|edge| &EDGE_PLACES[edge]) {
                let plane = &changes.planes[streams.slot(cell[0], place)];
                group.put(simd, 0, count, place, plane);
                count += 1;
            }
            group.count(0, count);
            Crease::of(&group.solve(simd, 1, 0.0, MISS), 0)
        }))
    }

    fn active(&self, cell: LocalIndex) -> Result<Option<(&HermiteSurface, [usize; 3], CellCase)>> {
        let Some((LeafSurface::Changes(changes), d, cell)) = self.plain(cell) else { return Ok(None) };
        let Some(key) = self.key.neighbour(d) else { return Ok(None) };
        Ok(Some((&**changes, cell, face_ambiguity::kind(self.field, key, changes, cell)?)))
    }

    /// The crossings on the lattice edges between the samples `low` and `high`, both included, in an order that
    /// does not depend on the leaf that asks.
    #[inline(always)]
    pub(super) fn gather(&self, low: LocalIndex, high: LocalIndex, found: &mut Vec<NamedPlane>) {
        found.clear();
        let mut is_sorted = true;
        for d in directions(low, high) {
            is_sorted &= d == [0; 3];
            self.any_of_piece(d, low, high, |axis, start, plane| {
                let on_apron = (0..3).any(|a| start[a] == (d[a] + 1) * SIDE);
                let [x, y, z] = start;
                found.push(((axis.index(), [z, y, x], on_apron), plane));
                false
            });
        }
        if !is_sorted {
            found.sort_by_key(|(name, _)| *name);
            found.dedup_by_key(|((axis, start, _), _)| (*axis, *start));
        }
    }

    /// Whether the predicate holds for one of the crossings on the edges of a cell, as the cell sees them.
    pub(super) fn any_of_cell(&self, cell: LocalIndex, mut holds: impl FnMut(&HermitePlane) -> bool) -> bool {
        let Piece::Fetched(surface, _) = &self.pieces[piece_index(cell.map(|c| c.div_euclid(SIDE)))] else {
            return false;
        };
        let [i, j, k] = cell.map(|c| c.rem_euclid(SIDE) as usize);
        dispatch!(level(), _simd => {
            let streams = EdgeStreams::of(surface.changes(), j, k);
            let mut is_any = false;
            for place in &EDGE_PLACES {
                if let Some(changes) = surface.changes()
                    && streams.is_crossed(i, place)
                {
                    let plane = &changes.planes[streams.slot(i, place)];
                    let ([x, y, z, _], [u, v, w]) = (place.seen_from_centre(plane), plane.normal);
                    let point = [f64::from(x) + 0.5, f64::from(y) + 0.5, f64::from(z) + 0.5];
                    is_any |= holds(&(point, [f64::from(u), f64::from(v), f64::from(w)]));
                }
            }
            is_any
        })
    }

    /// Whether the predicate holds for one of those crossings, or of those of other leaves if `beyond`; some may come
    /// twice, and those after it are not looked at.
    #[inline(always)]
    pub(super) fn any_plane(
        &self,
        low: LocalIndex,
        high: LocalIndex,
        beyond: bool,
        mut holds: impl FnMut(HermitePlane) -> bool,
    ) -> bool {
        directions(low, high)
            .filter(|d| !beyond || *d != [0; 3])
            .any(|d| self.any_of_piece(d, low, high, |_, _, plane| holds(plane)))
    }

    #[inline(always)]
    fn any_of_piece(
        &self,
        d: LocalIndex,
        low: LocalIndex,
        high: LocalIndex,
        mut holds: impl FnMut(Axis, LocalIndex, HermitePlane) -> bool,
    ) -> bool {
        let Piece::Fetched(surface, _) = &self.pieces[piece_index(d)] else { return false };
        let LeafSurface::Changes(changes) = &**surface else { return false };
        let first = d.map(|d| d * SIDE);
        let low: [usize; 3] = std::array::from_fn(|a| (low[a] - first[a]).max(0) as usize);
        let high: [usize; 3] = std::array::from_fn(|a| (high[a] - first[a]).min(SIDE) as usize);
        for axis in Axis::ALL {
            let mut last = high;
            last[axis.index()] -= 1;
            let columns = (2 << last[0]) - (1 << low[0]);
            for (k, j) in (low[2]..=last[2]).flat_map(|k| (low[1]..=last[1]).map(move |j| (k, j))) {
                let mut bits = changes.signs.edges(axis, j, k) & columns;
                while bits != 0 {
                    let start = [bits.trailing_zeros() as usize, j, k];
                    bits &= bits - 1;
                    let edge = changes.plane(axis, start);
                    let start: LocalIndex = std::array::from_fn(|a| first[a] + start[a] as i32);
                    let mut point = start.map(f64::from);
                    point[axis.index()] += f64::from(edge.fraction);
                    if holds(axis, start, (point, edge.normal.map(f64::from))) {
                        return true;
                    }
                }
            }
        }
        false
    }
}

/// The directions, z slowest, of the leaves that hold the cells between two samples.
#[inline(always)]
fn directions(low: LocalIndex, high: LocalIndex) -> impl Iterator<Item = LocalIndex> {
    let range = |a: usize| low[a].div_euclid(SIDE)..=(high[a] - 1).div_euclid(SIDE);
    let (x, y, z) = (range(0), range(1), range(2));
    z.flat_map(move |k| {
        let x = x.clone();
        y.clone().flat_map(move |j| x.clone().map(move |i| [i, j, k]))
    })
}
