//! Corners that no single cell sees: a vertex for the point where the faces around a creased cell meet.
//!
//! A cell's vertex is placed from the crossings on its own edges. Where a corner of the surface lies in a cell whose
//! edges meet only two of its faces, the vertex ends up somewhere on their crease.
//!
//! Where it is a tip that reaches into a cell without a sign change, that cell has no vertex at all. Both show in the
//! crossings of the cells around.
//!
//! So every cell that sees a crease looks at the crossings of the 27 cells about it. If all of their planes pass
//! through one point, and no direction along which it could slide is left, that point is a corner.
//!
//! A vertex goes there: the one of the cell that holds it. If that cell is inactive, it is the nearest one of the
//! cells around, with nothing but inactive cells between.
//!
//! Only positions change, never the triangles. They stay distinct: a vertex that moves does so within its own cell, or
//! into an inactive one that gives room to no other. Across the border of two leaves that holds because a corner and
//! its vertex follow from the crossings about the corner, which both leaves see alike through [`super::halo`].
//!
//! A vertex moves if a creased cell of its own leaf finds the corner.
//!
//! A smooth surface is left alone: its planes are many, and they do not pass through one point. Neither is a tip
//! found that reaches more than a cell beyond the last sample inside.

use super::cells::{BrickCells, CELL_ROWS, CellsBuilder};
use super::crease_extension::{CreaseExtension, CreaseVertex};
use super::halo::{Halo, NamedPlane};
use super::local_index::{LocalIndex, home_of, is_next_to, neighbour};
use super::planes::{HermitePlane, distance};
use super::qef::{MISS, PlaneSums, Qef};
use super::symmetric::dot;
use crate::error::Result;
use crate::lattice::BRICK_CELLS;
use crate::wide::{Simd, dispatch, level};
use glam::DVec3;
use std::collections::HashSet;

/// Cosine of the angle, 3°, up to which two crossings count as of one face.
const SAME_NORMAL: f64 = 0.998_629_534_754_573_9;
/// Least singular value of the faces' normals: what is flatter or nearer to a straight crease has no place
/// along the crease that its crossings would tell.
const LEAST_SPREAD: f64 = 0.3;
/// Half the edge of the block of 3³ cells.
const BLOCK_REACH: f64 = 1.5;
/// Faces at a corner at most. More are a curved surface, on which the search ends early.
const MOST_FACES: usize = 8;
/// Crossings per face, on average: three lone planes always meet somewhere.
const EVIDENCE: usize = 2;

impl CellsBuilder<'_> {
    /// Moves vertices to the corners that the creased cells find, which were noted when their own vertices
    /// were placed, and others along their creases ([`super::crease_extension`]). Where a corner lies and whose vertex goes there is a
    /// function of the crossings about it alone, so leaves next to each other agree; each moves its own vertices.
    pub(super) fn complete_corners(&mut self) -> Result<()> {
        let candidates = match self.sums {
            Some(_) => std::mem::take(&mut self.candidates),
            None => self.creased.iter().map(|cell| cell.map(i32::from)).collect(),
        };
        if candidates.is_empty() && self.sharp.is_empty() {
            return Ok(());
        }
        let mut claims = CreaseExtension::new(Halo::new(self.field, self.leaf)?, self);
        let mut homes = HashSet::new();
        let (mut aside, mut moves, mut strays) = (Vec::new(), Vec::new(), Vec::new());
        let mut at_corners = HashSet::new();
        for cell in candidates {
            let Some(seen) = claims.seen_from(cell, BLOCK_REACH)? else { continue };
            let home = home_of(seen);
            if home != cell
                && let Some(vertex) = self.lone_vertex(cell)
                && let Some(point) =
                    claims.on_crease(cell, seen, self.frame.local(self.cells.positions[vertex]))
            {
                aside.push((vertex, self.frame.world_within(cell, point)));
            }
            if !is_next_to(home, cell) || !homes.insert(home) {
                continue;
            }
            let Some((corner, taker)) = claims.corner_in(home)? else { continue };
            if let Some(vertex) = self.lone_vertex(taker) {
                moves.push((vertex, self.frame.world_within(home, corner)));
                let is_first = at_corners.insert(vertex);
                if taker != home {
                    strays.push((taker, home, is_first));
                }
            }
        }
        let following = claims.follow_creases(|vertex| at_corners.contains(&vertex))?;
        let may_annex = claims.may_annex;
        for (taker, home, is_first) in strays {
            let cell = taker.map(|c| c as usize);
            match (0..6).find(|&direction| neighbour(taker, direction) == home) {
                Some(direction) if is_first && may_annex => self.annex(cell, direction),
                _ => self.let_stray(cell),
            }
        }
        for CreaseVertex { vertex, cell, annexed, position } in following {
            // Those beside corners have their place; they may annex, too.
            self.cells.positions[vertex] = position;
            if let Some(direction) = annexed {
                self.annex(cell, direction);
            }
        }
        self.cells.annexed.sort_unstable();
        // The first corner that a vertex could go to gets it.
        moves.reverse();
        for (vertex, position) in aside.into_iter().chain(moves) {
            self.cells.positions[vertex] = position;
        }
        Ok(())
    }

    /// Adds to the candidates those of the creased cells whose block may hold a corner as far as the cells of the leaf
    /// can tell: creases are many and corners few. Layer by layer, as soon as the sums of the next are there, while they
    /// are in the processor's cache: those of all cells are more than it holds.
    #[inline(always)]
    pub(super) fn keep_candidates<S: Simd>(&mut self, simd: S, is_filled: bool) {
        let CellsBuilder { sums: Some(sums), cells, apart, creased, candidates, .. } = self else { return };
        while self.decided < BRICK_CELLS {
            let layer = self.decided;
            // The first row after the next layer.
            let after = (layer + 2) * BRICK_CELLS;
            if !is_filled && (after >= CELL_ROWS || cells.cells_before(after) >= sums.len()) {
                break;
            }
            self.decided += 1;
            let apart = near(apart, layer);
            while let Some(&cell) = creased.get(self.seen)
                && let [i, j, k] = cell.map(usize::from)
                && k == layer
            {
                self.seen += 1;
                let cell = cell.map(i32::from);
                if apart[j] >> i & 1 == 0 && may_meet_within(simd, cells, cell, sums) {
                    candidates.push(cell);
                }
            }
        }
    }

    /// The vertex of a plain active cell of this leaf with a single loop.
    pub(super) fn lone_vertex(&self, cell: LocalIndex) -> Option<usize> {
        if cell.iter().any(|&c| c < 0 || c >= BRICK_CELLS as i32) {
            return None;
        }
        let (kind, first) = self.cells.plain(cell.map(|c| c as usize))?;
        (kind.loops().count == 1).then_some(first)
    }
}

/// A cell and the 26 around it, the cell itself first.
fn cells_about(cell: LocalIndex) -> impl Iterator<Item = LocalIndex> {
    let others = (0..27).filter(|&n| n != 13);
    std::iter::once(13).chain(others).map(move |n| {
        let step = [n % 3, n / 3 % 3, n / 9];
        std::array::from_fn(|a| cell[a] + step[a] - 1)
    })
}

impl CreaseExtension<'_, '_> {
    /// The point where the planes of all crossings of the 27 cells about `cell` meet, if there is just one; one farther
    /// than `reach` cells from the middle of the cell along an axis may be left out.
    pub(super) fn seen_from(&mut self, cell: LocalIndex, reach: f64) -> Result<Option<[f64; 3]>> {
        let (low, high) = (cell.map(|c| c - 1), cell.map(|c| c + 2));
        self.halo.fetch(low, high)?;
        // As compiled for this processor: bits are counted for every crossing.
        if !dispatch!(level(), simd => self.may_meet(simd, cell, [low, high], reach)) {
            return Ok(None);
        }
        dispatch!(level(), _simd => self.halo.gather(low, high, &mut self.planes));
        Ok(meeting_point(cell, &self.planes))
    }

    /// The corner in the cell `home` as the first of the cells about it that sees one there sees it, and the
    /// cell whose vertex goes there.
    fn corner_in(&mut self, home: LocalIndex) -> Result<Option<([f64; 3], LocalIndex)>> {
        for cell in cells_about(home) {
            if let Some(corner) = self.seen_from(cell, BLOCK_REACH)?
                && home_of(corner) == home
            {
                return Ok(self.taker(home, corner)?.map(|taker| (corner, taker)));
            }
        }
        Ok(None)
    }

    /// The cell whose vertex goes to a corner in the cell `home`: `home` itself if it is active, otherwise the one that
    /// annexes it, or, of the cells around it that have no plane that misses the corner, the one with its crossings nearest.
    fn taker(&mut self, home: LocalIndex, corner: [f64; 3]) -> Result<Option<LocalIndex>> {
        self.halo.fetch(home.map(|c| c - 1), home.map(|c| c + 2))?;
        let Some(mask) = self.halo.plain_mask(home) else { return Ok(None) };
        if !matches!(mask, 0 | u8::MAX) {
            return Ok((self.halo.loops(home)? == 1).then_some(home));
        }
        if let Some(annexer) = self.annexer(home)? {
            let (low, high) = (annexer, annexer.map(|c| c + 1));
            let misses_it = self.halo.any_plane(low, high, false, |plane| misses(&plane, corner));
            return Ok((!misses_it).then_some(annexer));
        }
        let mut best: Option<(f64, LocalIndex)> = None;
        for next in cells_about(home).skip(1) {
            if self.halo.loops(next)? != 1 || !self.is_clear(home, next)? {
                continue;
            }
            let (mut sum, mut count) = (DVec3::ZERO, 0.0);
            let misses_it = self.halo.any_plane(next, next.map(|c| c + 1), false, |plane| {
                sum += DVec3::from(plane.0);
                count += 1.0;
                misses(&plane, corner)
            });
            let distance = (sum / count).distance_squared(DVec3::from(corner));
            if !misses_it && best.is_none_or(|(least, _)| distance < least) {
                best = Some((distance, next));
            }
        }
        Ok(best.map(|(_, taker)| taker))
    }

    /// Whether all cells between two that touch are inactive and nobody else's: then the first one and these have room for
    /// what the vertex of the other one spans with its own cell, which meets nothing there.
    fn is_clear(&mut self, home: LocalIndex, next: LocalIndex) -> Result<bool> {
        for n in 1..7 {
            let cell: LocalIndex = std::array::from_fn(|a| if n >> a & 1 == 1 { next[a] } else { home[a] });
            if cell == home || cell == next {
                continue;
            }
            if !self.is_inactive(cell) || self.annexer(cell)?.is_some_and(|annexer| annexer != next) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// A better place for the vertex, now at `position`, of a cell beside a corner: the minimiser of the errors
    /// of more than two planes that meet outside the cell lies on no crease. The point of the cell on one of the
    /// creases into the corner that is nearest to the cell's crossings.
    fn on_crease(&self, cell: LocalIndex, corner: [f64; 3], position: [f64; 3]) -> Option<[f64; 3]> {
        let mut faces: Vec<DVec3> = Vec::with_capacity(MOST_FACES);
        let (mut sum, mut count, mut is_off) = (DVec3::ZERO, 0.0, false);
        self.halo.any_plane(cell, cell.map(|c| c + 1), false, |plane| {
            let normal = DVec3::from(plane.1);
            if faces.iter().all(|face| face.dot(normal) <= SAME_NORMAL) {
                faces.push(normal);
            }
            sum += DVec3::from(plane.0);
            count += 1.0;
            is_off |= misses(&plane, position);
            false
        });
        if !is_off {
            return None;
        }
        let (corner, middle) = (DVec3::from(corner), sum / count);
        let low = DVec3::from(cell.map(f64::from));
        let mut best: Option<(f64, DVec3)> = None;
        for (n, first) in faces.iter().enumerate() {
            for along in faces[..n].iter().map(|second| first.cross(*second)) {
                if along.length_squared() < LEAST_SPREAD * LEAST_SPREAD {
                    continue;
                }
                // Where the line enters and leaves the cell.
                let (a, b) = ((low - corner) / along, (low + 1.0 - corner) / along);
                let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
                if enter <= leave {
                    let at = ((middle - corner).dot(along) / along.length_squared()).clamp(enter, leave);
                    let point = corner + at * along;
                    let distance = point.distance_squared(middle);
                    if best.is_none_or(|(least, _)| distance < least) {
                        best = Some((distance, point));
                    }
                }
            }
        }
        best.map(|(_, point)| point.to_array())
    }

    /// Whether the block about a cell may hold a corner. Within the leaf the sums of its cells serve; the crossings
    /// beyond its border are added up.
    #[inline(always)]
    fn may_meet<S: Simd>(&self, simd: S, cell: LocalIndex, [low, high]: [LocalIndex; 2], reach: f64) -> bool {
        let before = self.builder.sums.as_ref();
        let within = before.map(|before| sums_within(simd, &self.builder.cells, cell, before));
        let beyond = within.is_some();
        let mut sums = within.unwrap_or_default();
        self.halo.any_plane(low, high, beyond, |(point, normal)| {
            sums.add(point, normal);
            false
        });
        may_meet(&sums, cell, reach)
    }
}

#[inline(always)]
fn may_meet_within<S: Simd>(simd: S, cells: &BrickCells, cell: LocalIndex, before: &[PlaneSums]) -> bool {
    const LAST: i32 = BRICK_CELLS as i32 - 1;
    let sums = sums_within(simd, cells, cell, before);
    let is_within = cell.iter().all(|&c| 0 < c && c < LAST);
    if is_within {
        may_meet(&sums, cell, BLOCK_REACH)
    } else {
        sums.may_share_point(middle(cell), BLOCK_REACH, MISS)
    }
}

/// The sums over the cells of the leaf in the block about a cell, from those over all cells before each.
#[inline(always)]
fn sums_within<S: Simd>(simd: S, cells: &BrickCells, cell: LocalIndex, before: &[PlaneSums]) -> PlaneSums {
    let (mut first, mut rest) = PlaneSums::default().load(simd);
    let within = |c: i32| c.clamp(0, BRICK_CELLS as i32) as usize;
    let [x, y, z] = cell.map(|c| within(c - 1)..within(c + 2));
    for k in z {
        for j in y.clone() {
            let row = cells.row(j, k);
            let (end, start) = (before[row.slot(x.end)].load(simd), before[row.slot(x.start)].load(simd));
            first += end.0 - start.0;
            rest += end.1 - start.1;
        }
    }
    PlaneSums::of((first, rest))
}

/// Whether the planes of the block about a cell may meet in a corner so far from its middle.
#[inline(always)]
fn may_meet(sums: &PlaneSums, cell: LocalIndex, reach: f64) -> bool {
    sums.may_meet(middle(cell), reach, MISS, LEAST_SPREAD)
}

#[inline(always)]
fn middle(cell: LocalIndex) -> [f64; 3] {
    cell.map(|c| f64::from(c) + 0.5)
}

/// The cells of a layer, as bit rows, that have one of the set ones in their block.
#[inline(always)]
fn near(rows: &[u32; CELL_ROWS], layer: usize) -> [u32; BRICK_CELLS] {
    let mut along_z = [0; BRICK_CELLS];
    for k in layer.saturating_sub(1)..(layer + 2).min(BRICK_CELLS) {
        for j in 0..BRICK_CELLS {
            along_z[j] |= rows[k * BRICK_CELLS + j];
        }
    }
    let mut near = [0; BRICK_CELLS];
    for j in 0..BRICK_CELLS {
        let below = if j > 0 { along_z[j - 1] } else { 0 };
        let above = if j + 1 < BRICK_CELLS { along_z[j + 1] } else { 0 };
        let any = below | along_z[j] | above;
        near[j] = any | any << 1 | any >> 1;
    }
    near
}

/// True if the corner is not on a crossing's plane.
fn misses(plane: &HermitePlane, corner: [f64; 3]) -> bool {
    distance(plane, corner) > MISS
}

/// The point where the planes of all crossings about a cell meet, if there is just one.
fn meeting_point(cell: LocalIndex, planes: &[NamedPlane]) -> Option<[f64; 3]> {
    let mut faces: Vec<&HermitePlane> = Vec::with_capacity(MOST_FACES);
    for (_, plane) in planes {
        let is_known = |face: &&HermitePlane| dot(face.1, plane.1) > SAME_NORMAL && !misses(face, plane.0);
        if !faces.iter().any(is_known) {
            if faces.len() == MOST_FACES {
                return None;
            }
            faces.push(plane);
        }
    }
    if faces.len() < 3 || planes.len() < EVIDENCE * faces.len() {
        return None;
    }
    let base = cell.map(f64::from);
    let mut qef = Qef::default();
    for (point, normal) in faces {
        qef.add(std::array::from_fn(|a| point[a] - base[a]), *normal);
    }
    let corner = qef.meeting_point(LEAST_SPREAD)?;
    let corner = std::array::from_fn(|a| corner[a] + base[a]);
    (!planes.iter().any(|(_, plane)| misses(plane, corner))).then_some(corner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_near_those_of_its_block() {
        for cell in [[0, 0, 0], [31, 31, 31], [5, 0, 31], [31, 17, 0], [9, 8, 7]] {
            let mut rows = [0; CELL_ROWS];
            rows[cell[2] as usize * BRICK_CELLS + cell[1] as usize] = 1 << cell[0];
            let near: Vec<_> = (0..BRICK_CELLS).map(|layer| near(&rows, layer)).collect();
            for n in 0..BRICK_CELLS * CELL_ROWS {
                let [i, j, k] = [n % BRICK_CELLS, n / BRICK_CELLS % BRICK_CELLS, n / CELL_ROWS];
                let is_set = near[k][j] >> i & 1 == 1;
                assert_eq!(is_set, is_next_to([i as i32, j as i32, k as i32], cell));
            }
        }
    }
}
