//! Corners that no single cell sees: a vertex for the point where the faces around a creased cell meet.
//!
//! A cell's vertex is placed from the crossings on its own edges. Where a corner of the surface lies in a cell
//! whose edges meet only two of its faces, the vertex ends up somewhere on their crease; where it is a tip that
//! reaches into a cell without a sign change, that cell has no vertex at all. Both show in the crossings of the
//! cells around. So every cell that sees a crease looks at the crossings of the 27 cells about it: if all of
//! their planes, however many there are, pass through one point, and no direction along which it could slide is
//! left, that point is a corner, and a vertex goes there: the one of the cell that holds it or, if that cell is
//! inactive, the nearest one of the cells around it.
//!
//! Only positions change, never the triangles. They stay distinct: a vertex that moves does so within its own
//! cell, or into an inactive one that gives room to no other.
//!
//! A smooth surface is left alone: its planes are many, and they do not pass through one point.

use super::cells::{Builder, Plane};
use super::qef::{Qef, dot};
use super::topology::CELL_LOOPS;
use crate::lattice::{Axis, BRICK_CELLS};
use glam::DVec3;
use std::collections::HashSet;

/// How far, in cells, a plane may pass by the corner: a hundred times what the rounding of offsets and
/// normals makes of planes that meet in one point, and far less than a curved face bends within a cell.
const MISS: f64 = 0.01;
/// Cosine of the angle, 3°, up to which two crossings count as of one face.
const SAME_NORMAL: f64 = 0.998_629_534_754_573_9;
/// Least singular value of the faces' normals: what is flatter or nearer to a straight crease has no place
/// along the crease that its crossings would tell.
const LEAST_SPREAD: f64 = 0.3;
/// Faces at a corner at most. More are a curved surface, on which the search ends early.
const MOST_FACES: usize = 8;
/// Triple product from which on three normals count as spread, and their planes' meeting point as roughly the
/// corner: planes that pass a corner within [`MISS`] then meet within 20 misses or so of it. The facets of a
/// faceted cylinder, whose normals lie in a plane, stay below.
const WELL_SPREAD: f64 = 0.1;
/// How far a plane may pass by that point: [`MISS`] from the corner, and the point's own distance.
const ROUGH_MISS: f64 = 21.0 * MISS;
/// Cosine of the angle, 8°, below which a second face is not looked for, because a triple product would be small.
const ROUGHLY_SAME: f64 = 0.99;
/// Crossings per face, on average: three lone planes always meet somewhere.
const EVIDENCE: usize = 2;

impl Builder<'_> {
    /// Moves vertices to the corners that the creased cells find, which were noted when their own vertices
    /// were placed. Corners beyond the leaf are left to the leaf that holds them.
    pub(super) fn complete_corners(&mut self) {
        let (mut homes, mut moved) = (HashSet::new(), HashSet::new());
        let mut planes = Vec::new();
        for cell in std::mem::take(&mut self.creased) {
            let (low, high) = (cell.map(|c| c.max(1) - 1), cell.map(|c| (c + 2).min(BRICK_CELLS)));
            if !self.may_meet(cell, low, high) {
                continue;
            }
            self.gather(low, high, &mut planes);
            let Some(corner) = meeting_point(cell, &planes) else { continue };
            let home = corner.map(|c| c.floor());
            if (0..3).any(|a| {
                home[a] < 0.0 || home[a] >= BRICK_CELLS as f64 || (home[a] - cell[a] as f64).abs() > 1.0
            }) {
                continue;
            }
            let home = home.map(|c| c as usize);
            if homes.contains(&home) {
                continue;
            }
            let margin = self.frame.margin;
            let at = std::array::from_fn(|a| (corner[a] - home[a] as f64).clamp(margin, 1.0 - margin));
            let position = self.frame.world(home, at);
            let Some(vertex) = self.taker(home, corner, position, &mut planes) else { continue };
            if moved.insert(vertex) {
                homes.insert(home);
                self.cells.positions[vertex] = position;
            }
        }
    }

    /// The vertex that goes to a corner in the cell `home`: its own one if it is active, otherwise the nearest
    /// of those of the 26 cells around it that have no plane that misses the corner.
    fn taker(
        &self,
        home: [usize; 3],
        corner: [f64; 3],
        position: [f32; 3],
        planes: &mut Vec<Plane>,
    ) -> Option<usize> {
        if self.cells.row(home[1], home[2]).active >> home[0] & 1 == 1 {
            return self.lone_vertex(home);
        }
        let mut best: Option<(f64, usize)> = None;
        for step in 0..27 {
            let step = [step % 3, step / 3 % 3, step / 9];
            // Below 0 it wraps round to far beyond the last cell.
            let next = std::array::from_fn(|a| (home[a] + step[a]).wrapping_sub(1));
            if next.iter().any(|&c| c >= BRICK_CELLS) {
                continue;
            }
            let Some(vertex) = self.lone_vertex(next) else { continue };
            self.gather(next, next.map(|c| c + 1), planes);
            if planes.iter().any(|plane| misses(plane, corner)) {
                continue;
            }
            let from = self.cells.positions[vertex];
            let distance = (0..3).map(|a| f64::from(from[a] - position[a]).powi(2)).sum();
            if best.is_none_or(|(least, _)| distance < least) {
                best = Some((distance, vertex));
            }
        }
        best.map(|(_, vertex)| vertex)
    }

    /// The vertex of a plain active cell with a single loop.
    fn lone_vertex(&self, cell: [usize; 3]) -> Option<usize> {
        let row = self.cells.row(cell[1], cell[2]);
        if (row.active & !row.mixed) >> cell[0] & 1 == 0 {
            return None;
        }
        let slot = row.slot(cell[0]);
        let loops = &CELL_LOOPS[self.cells.masks[slot] as usize];
        (loops.count == 1).then(|| self.cells.first[slot] as usize)
    }

    /// A quick look at the block about a cell: its first three faces whose normals are spread must meet nearby,
    /// and every crossing's plane must roughly pass there. Creases are many and corners few: without it
    /// contouring a pile of beads takes nearly twice as long.
    fn may_meet(&self, cell: [usize; 3], low: [usize; 3], high: [usize; 3]) -> bool {
        let mut faces: [Option<Plane>; 2] = [None; 2];
        let mut point = None;
        self.any_plane(low, high, |plane| match faces {
            [None, _] => {
                faces[0] = Some(plane);
                false
            }
            [Some(first), None] => {
                if dot(first.1, plane.1) < ROUGHLY_SAME {
                    faces[1] = Some(plane);
                }
                false
            }
            [Some(first), Some(second)] => {
                let across = cross(first.1, second.1);
                let volume = dot(across, plane.1);
                if volume.abs() > WELL_SPREAD {
                    point = Some(intersection([first, second, plane], volume));
                }
                point.is_some()
            }
        });
        let Some(point) = point else { return false };
        let near = (0..3).all(|a| (point[a] - cell[a] as f64 - 0.5).abs() <= 1.5 + ROUGH_MISS);
        let off =
            |(at, normal): Plane| dot(normal, std::array::from_fn(|a| point[a] - at[a])).abs() > ROUGH_MISS;
        near && !self.any_plane(low, high, off)
    }

    /// The leaf's crossings on the lattice edges between the samples `low` and `high`, both included, in
    /// cells from the leaf's first sample.
    fn gather(&self, low: [usize; 3], high: [usize; 3], planes: &mut Vec<Plane>) {
        planes.clear();
        self.any_plane(low, high, |plane| {
            planes.push(plane);
            false
        });
    }

    /// Whether the predicate holds for one of those crossings; those after it are not looked at.
    #[inline]
    fn any_plane(&self, low: [usize; 3], high: [usize; 3], mut holds: impl FnMut(Plane) -> bool) -> bool {
        let Some(changes) = self.changes else { return false };
        for axis in Axis::ALL {
            let mut last = high;
            last[axis.index()] -= 1;
            let columns = (2 << last[0]) - (1 << low[0]);
            for (k, j) in (low[2]..=last[2]).flat_map(|k| (low[1]..=last[1]).map(move |j| (k, j))) {
                let mut bits = changes.signs.edges(axis, j, k) & columns;
                while bits != 0 {
                    let start = [bits.trailing_zeros() as usize, j, k];
                    bits &= bits - 1;
                    let edge = self.planes[self.axis_start[axis.index()] + changes.slot(axis, start)];
                    let mut point = start.map(|c| c as f64);
                    point[axis.index()] += f64::from(edge.fraction);
                    if holds((point, edge.normal.map(f64::from))) {
                        return true;
                    }
                }
            }
        }
        false
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    DVec3::from(a).cross(DVec3::from(b)).to_array()
}

/// The point that three planes share; `volume` is the triple product of their normals.
fn intersection(planes: [Plane; 3], volume: f64) -> [f64; 3] {
    let [n0, n1, n2] = planes.map(|(_, normal)| DVec3::from(normal));
    let [d0, d1, d2] = planes.map(|(point, normal)| dot(point, normal));
    ((d0 * n1.cross(n2) + d1 * n2.cross(n0) + d2 * n0.cross(n1)) / volume).to_array()
}

/// True if the corner is not on a crossing's plane.
fn misses((point, normal): &Plane, corner: [f64; 3]) -> bool {
    dot(*normal, std::array::from_fn(|a| corner[a] - point[a])).abs() > MISS
}

/// The point where the planes of all crossings about a cell meet, if there is just one.
fn meeting_point(cell: [usize; 3], planes: &[Plane]) -> Option<[f64; 3]> {
    let mut faces: Vec<&Plane> = Vec::with_capacity(MOST_FACES);
    for plane in planes {
        let is_known = |face: &&Plane| dot(face.1, plane.1) > SAME_NORMAL && !misses(face, plane.0);
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
    let base = cell.map(|c| c as f64);
    let mut qef = Qef::default();
    for (point, normal) in faces {
        qef.add(std::array::from_fn(|a| point[a] - base[a]), *normal);
    }
    let corner = qef.meeting_point(LEAST_SPREAD)?;
    let corner = std::array::from_fn(|a| corner[a] + base[a]);
    (!planes.iter().any(|plane| misses(plane, corner))).then_some(corner)
}
