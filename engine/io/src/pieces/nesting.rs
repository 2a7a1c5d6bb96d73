//! Which closed pieces lie inside others, where one of the two is reversed.

use super::gather::{NO_PIECE, PieceTable, SurfacePiece};
use crate::check::{BoxTree, IndexedMesh, OuterBox};
use crate::error::Result;
use crate::lattice::Units;
use crate::predicates::{Meeting, meeting_by_place};
use crate::progress::Progress;
use rayon::prelude::*;

/// Points of a piece that are asked whether they are inside.
const POINTS: usize = 8;

/// A piece inside another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PieceNesting {
    pub inner: u32,
    pub outer: u32,
}

/// Finds for each reversed piece the pieces that it lies in, and also for those that are not reversed if one that they
/// lie in is. Sorted.
///
/// # Errors
/// If the user interrupts.
pub(super) fn nested(
    mesh: &IndexedMesh<Units>,
    gathered: &PieceTable,
    progress: &dyn Progress,
) -> Result<Vec<PieceNesting>> {
    let pieces = &gathered.pieces;
    let solid = |number: &u32| pieces[*number as usize].is_solid();
    let reversed = |number: &u32| pieces[*number as usize].is_reversed();
    let all: Vec<u32> = (0..pieces.len() as u32).filter(solid).collect();
    let inward: Vec<u32> = all.iter().copied().filter(reversed).collect();
    if inward.is_empty() {
        return Ok(Vec::new());
    }
    let corners = |number: u32| {
        let SurfacePiece { low, high, .. } = pieces[number as usize];
        [low, high, low].map(|corner| corner.map(f64::from))
    };
    let of_all = BoxTree::new(all.clone(), &corners);
    let of_inward = BoxTree::new(inward, &corners);
    let candidates = |inner: u32, tree: &BoxTree, keep: &(dyn Fn(&u32) -> bool + Sync)| {
        let mut found = Vec::new();
        tree.for_near(&OuterBox::around(&corners(inner)[..1]), |outer| {
            if keep(&outer) && may_hold(&pieces[outer as usize], &pieces[inner as usize]) {
                found.push(PieceNesting { inner, outer });
            }
        });
        found
    };
    let of_piece = |&inner: &u32| {
        let tree = if reversed(&inner) { &of_all } else { &of_inward };
        candidates(inner, tree, &|_| true)
    };
    let first: Vec<PieceNesting> = all.par_iter().flat_map_iter(of_piece).collect();
    let mut found = confirmed(mesh, gathered, first, progress)?;
    // The largest of what else is around a piece decides, too.
    let mut inners: Vec<u32> = found.iter().map(|pair| pair.inner).filter(|inner| !reversed(inner)).collect();
    inners.dedup();
    let others = |&inner: &u32| candidates(inner, &of_all, &|outer| !reversed(outer));
    let second: Vec<PieceNesting> = inners.par_iter().flat_map_iter(others).collect();
    found.extend(confirmed(mesh, gathered, second, progress)?);
    found.sort_unstable();
    Ok(found)
}

/// Whether a piece is large enough, and where it would have to be, to have another inside.
fn may_hold(outer: &SurfacePiece, inner: &SurfacePiece) -> bool {
    let around = |a: usize| outer.low[a] <= inner.low[a] && inner.high[a] <= outer.high[a];
    (0..3).all(around) && inner.six_volumes.unsigned_abs() < outer.six_volumes.unsigned_abs()
}

/// Those of the pairs that are nested, sorted.
fn confirmed(
    mesh: &IndexedMesh<Units>,
    gathered: &PieceTable,
    mut pairs: Vec<PieceNesting>,
    progress: &dyn Progress,
) -> Result<Vec<PieceNesting>> {
    pairs.sort_unstable_by_key(|pair| (pair.outer, pair.inner));
    progress.phase("nesting", Some(pairs.len() as u64), "pairs");
    let members = Members::of(gathered, &pairs);
    let of_outer = |pairs: &[PieceNesting]| -> Result<Vec<PieceNesting>> {
        progress.check()?;
        let room = OuterPiece::new(mesh, gathered, members.of_piece(pairs[0].outer), pairs[0].outer);
        let holds = |pair: &&PieceNesting| room.holds(members.of_piece(pair.inner));
        let held = pairs.par_iter().filter(holds).copied().collect();
        progress.advance(pairs.len() as u64);
        Ok(held)
    };
    let groups: Vec<&[PieceNesting]> = pairs.chunk_by(|a, b| a.outer == b.outer).collect();
    let held: Vec<Vec<PieceNesting>> =
        groups.par_iter().map(|group| of_outer(group)).collect::<Result<_>>()?;
    let mut held = held.concat();
    held.sort_unstable();
    Ok(held)
}

/// The facets of some pieces.
struct Members {
    /// The place of each piece in `ends`, or [`NO_PIECE`].
    places: Vec<u32>,
    ends: Vec<usize>,
    facets: Vec<u32>,
}

impl Members {
    /// Those of the pieces in `pairs`.
    fn of(gathered: &PieceTable, pairs: &[PieceNesting]) -> Members {
        let mut places = vec![NO_PIECE; gathered.pieces.len()];
        let mut ends = Vec::new();
        let mut next = Vec::new();
        let mut total = 0;
        for number in pairs.iter().flat_map(|pair| [pair.inner, pair.outer]) {
            let place = &mut places[number as usize];
            if *place == NO_PIECE {
                *place = ends.len() as u32;
                next.push(total);
                total += gathered.pieces[number as usize].facets as usize;
                ends.push(total);
            }
        }
        let mut facets = vec![0; total];
        for (facet, &piece) in gathered.of_facet.iter().enumerate() {
            if piece != NO_PIECE && places[piece as usize] != NO_PIECE {
                let next = &mut next[places[piece as usize] as usize];
                facets[*next] = facet as u32;
                *next += 1;
            }
        }
        Members { places, ends, facets }
    }

    fn of_piece(&self, piece: u32) -> &[u32] {
        let place = self.places[piece as usize] as usize;
        let begin = if place == 0 { 0 } else { self.ends[place - 1] };
        &self.facets[begin..self.ends[place]]
    }
}

/// A piece that others may lie in.
struct OuterPiece<'a> {
    mesh: &'a IndexedMesh<Units>,
    gathered: &'a PieceTable,
    tree: BoxTree,
    /// Whether the piece is reversed.
    reversed: bool,
}

impl OuterPiece<'_> {
    fn new<'a>(
        mesh: &'a IndexedMesh<Units>,
        gathered: &'a PieceTable,
        facets: &[u32],
        piece: u32,
    ) -> OuterPiece<'a> {
        let corners =
            |facet: u32| mesh.triangles[facet as usize].map(|v| mesh.positions[v as usize].map(f64::from));
        let tree = BoxTree::new(facets.to_vec(), &corners);
        OuterPiece { mesh, gathered, tree, reversed: gathered.pieces[piece as usize].is_reversed() }
    }

    fn corners(&self, facet: u32) -> [Units; 3] {
        self.mesh.triangles[facet as usize].map(|v| self.mesh.positions[v as usize])
    }

    /// Whether the piece of these facets lies inside: all of its points that are asked, but those on the surface, are,
    /// and no facet passes through the surface.
    fn holds(&self, facets: &[u32]) -> bool {
        let step = facets.len().div_ceil(POINTS);
        let mut is_inside = false;
        for &facet in facets.iter().step_by(step) {
            let [p, q, r] = self.corners(facet);
            // The middle of the facet, where all is three times as large.
            let middle = std::array::from_fn(|a| i64::from(p[a]) + i64::from(q[a]) + i64::from(r[a]));
            // On the surface the field jumps between a point and the one on the other side.
            match [1, -1].map(|nudge| self.field(middle, nudge) >= 1) {
                [true, true] => is_inside = true,
                [false, false] => return false,
                _ => {}
            }
        }
        is_inside && !facets.par_iter().any(|&facet| self.is_crossed_by(facet))
    }

    /// The winding number of the piece, were it not reversed, very near a third of `point`, on the side that `nudge`
    /// says: what facets above it add up to, moved by ε, ε² and ε³ of that sign along the axes (simulation of
    /// simplicity, Edelsbrunner & Mücke 1990).
    fn field(&self, point: [i64; 3], nudge: i64) -> i64 {
        let [x, y, z] = point.map(|c| c as f64 / 3.0);
        let above = OuterBox::around(&[[x, y, z], [x, y, f64::from(1u32 << 25)]]);
        let mut sum = 0;
        self.tree.for_near(&above, |facet| {
            let [p, q, r] = self.corners(facet).map(|corner| corner.map(|c| 3 * i64::from(c)));
            let corners = if self.gathered.is_against(facet) { [p, r, q] } else { [p, q, r] };
            sum += jump_above(&corners, point, nudge);
        });
        if self.reversed { -sum } else { sum }
    }

    /// Whether a facet passes through one of the piece.
    fn is_crossed_by(&self, facet: u32) -> bool {
        // Even numbers up to 2^24 are exact.
        let exact = |facet: u32| self.corners(facet).map(|corner| corner.map(|c| c as f32));
        let own = exact(facet);
        let mut crossed = false;
        self.tree.for_near(&OuterBox::around(&own.map(|corner| corner.map(f64::from))), |other| {
            crossed = crossed || meeting_by_place(&own, &exact(other)) == Some(Meeting::Crossing);
        });
        crossed
    }
}

/// What the field falls by where the line from a point upward leaves through a triangle: 1 or −1, or 0 if it passes by.
fn jump_above(t: &[[i64; 3]; 3], point: [i64; 3], nudge: i64) -> i64 {
    let edge = |i: usize, a: usize| t[i][a] - t[0][a];
    let normal = [0, 1, 2].map(|axis| {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        edge(1, u) * edge(2, v) - edge(1, v) * edge(2, u)
    });
    let way = normal[2].signum();
    // Seen from above the nudged point is on no edge.
    let is_beside = |i: usize| {
        let (a, b) = (t[i], t[(i + 1) % 3]);
        let (du, dv) = (b[0] - a[0], b[1] - a[1]);
        let side = du * (point[1] - a[1]) - dv * (point[0] - a[0]);
        let nudged = if dv == 0 { du } else { -dv };
        let side = if side == 0 { nudge * nudged } else { side };
        side.signum() != way
    };
    if way == 0 || (0..3).any(is_beside) {
        return 0;
    }
    let height: i128 = (0..3).map(|a| i128::from(normal[a]) * i128::from(point[a] - t[0][a])).sum();
    let nudged = normal.into_iter().find(|c| *c != 0).unwrap_or(0) * nudge;
    let height = if height == 0 { i128::from(nudged) } else { height };
    // Below the plane the height is negative where the normal points up.
    if height.signum() as i64 == -way { way } else { 0 }
}
