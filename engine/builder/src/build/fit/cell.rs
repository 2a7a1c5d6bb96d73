//! What of the boundary lies within one cell: the winding number on both sides of a piece of a facet.

use super::polygon::{CellFacet, ConvexPolygon, NEAR};
use crate::brick::Brick;
use crate::lattice::{Vector, dot, minus};

/// Pieces that a facet may fall into within one cell, and facets of a cell. A cell that holds more is no plain one.
const PIECES_MAX: usize = 64;
pub(super) const FACES_MAX: usize = 256;

/// In cells: what is narrower is nothing. Facets next to each other that lay in one plane before their corners were
/// snapped divide each other so near to their common edge.
const WIDTH_MIN: f64 = 1e-6;
/// How far, in cells, facets that divide each other reach through each other at least.
const THROUGH: f64 = 1e-7;
/// How near a segment may pass by what it is compared with, in cells, and still be told from it: heights are off by 1e-13 at
/// most.
const APART: f64 = 1e-10;
/// How far a corner is from a facet that a segment is to end on.
const STEEP: f64 = 1e-4;

/// A cell with all facets that touch it.
pub(super) struct CellFacets<'a> {
    pub brick: &'a Brick,
    pub cell: [usize; 3],
    pub faces: &'a [CellFacet],
}

/// How a segment passes a facet.
enum Passage {
    None,
    /// By so much does the winding number rise.
    Jump(i32),
    /// It ends on the facet, which lies in the same plane as the one it is to end on, or faces against it.
    Coincident(i32),
    /// Too near to an edge or a plane to tell.
    Unclear,
}

impl CellFacets<'_> {
    /// Whether `excuses` takes every piece of `part`, a part of the facet `own`, that is a part of the boundary: one with
    /// w ≥ 1 on one side alone. What cannot be told counts as boundary.
    pub fn all_boundary(
        &self,
        own: usize,
        part: &ConvexPolygon,
        mut excuses: impl FnMut(&ConvexPolygon) -> bool,
    ) -> bool {
        let mut left = vec![(*part, 0)];
        let mut pieces = 1;
        while let Some((piece, from)) = left.pop() {
            let divided = (from..self.faces.len()).find_map(|n| {
                let is_other = n != own;
                if is_other { self.divide(own, &piece, n).map(|halves| (n + 1, halves)) } else { None }
            });
            match divided {
                Some((next, halves)) => {
                    pieces += 1;
                    if pieces > PIECES_MAX || piece.is_full() {
                        return false;
                    }
                    left.extend(halves.map(|half| (half, next)));
                }
                None => {
                    let counts = piece.area() > WIDTH_MIN * piece.length();
                    if counts && !excuses(&piece) && self.is_boundary(own, piece.middle()) != Some(false) {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// The two halves of a piece of the facet `own`, if the facet `other` passes through it.
    fn divide(&self, own: usize, piece: &ConvexPolygon, other: usize) -> Option<[ConvexPolygon; 2]> {
        let (face, other) = (&self.faces[own], &self.faces[other]);
        if !is_passed(&other.corners, face) || !is_passed(piece.corners(), other) {
            return None;
        }
        let halves = [piece.below(|p| other.height(p)), piece.below(|p| -other.height(p))];
        // Where the other's plane cuts the piece, within the other's edges.
        let cut = halves[0].corners().iter().copied().filter(|&p| other.height(p).abs() <= THROUGH);
        let mut chord = farthest(&cut.collect::<Vec<_>>());
        for edge in 0..3 {
            chord = clipped(&chord, |p| other.depth_at(edge, p) - WIDTH_MIN);
        }
        let length = match *chord {
            [a, b] => dot(minus(a, b), minus(a, b)),
            _ => 0.0,
        };
        (length > THROUGH * THROUGH).then_some(halves)
    }

    /// Whether exactly one side of a facet has w ≥ 1 at the point `p` of it, on which no other facet ends; `None` if that
    /// cannot be told.
    fn is_boundary(&self, own: usize, p: Vector) -> Option<bool> {
        (0..8).find_map(|n| {
            let corner: [usize; 3] = std::array::from_fn(|a| self.cell[a] + (n >> a & 1));
            self.is_boundary_from(own, p, corner)
        })
    }

    /// As a segment from a corner of the cell tells, if it does.
    fn is_boundary_from(&self, own: usize, p: Vector, corner: [usize; 3]) -> Option<bool> {
        let face = &self.faces[own];
        let from = corner.map(|c| c as f64);
        let height = face.height(from);
        if height.abs() < STEEP {
            return None;
        }
        let mut near = i32::from(self.brick.sample(corner));
        let mut step = 1;
        for (_, other) in self.faces.iter().enumerate().filter(|&(n, _)| n != own) {
            match passage(other, from, p, face.normal) {
                Passage::None => {}
                Passage::Jump(jump) => near += jump,
                Passage::Coincident(jump) => step += jump,
                Passage::Unclear => return None,
            }
        }
        let far = if height > 0.0 { near + step } else { near - step };
        Some((near >= 1) != (far >= 1))
    }
}

/// Whether some points lie on both sides of the plane of a facet.
#[inline]
fn is_passed(points: &[Vector], face: &CellFacet) -> bool {
    let least = (f64::INFINITY, f64::NEG_INFINITY);
    let heights = points.iter().map(|&p| face.height(p));
    let (low, high) = heights.fold(least, |(low, high), h| (low.min(h), high.max(h)));
    low < -THROUGH && high > THROUGH
}

/// How the segment from `from` to `p`, which lies on a facet with the normal `own`, passes another one.
fn passage(other: &CellFacet, from: Vector, p: Vector, own: Vector) -> Passage {
    let (start, end) = (other.height(from), other.height(p));
    if end.abs() <= APART {
        return match other.depth(p) {
            depth if depth < -APART => Passage::None,
            depth if depth > APART && dot(other.normal, own).abs() > 1.0 - 1e-9 => {
                Passage::Coincident(if dot(other.normal, own) > 0.0 { 1 } else { -1 })
            }
            _ => Passage::Unclear,
        };
    }
    if start.abs() <= APART {
        return if other.depth(from) < -APART { Passage::None } else { Passage::Unclear };
    }
    if (start > 0.0) == (end > 0.0) {
        return Passage::None;
    }
    let share = start / (start - end);
    let at: Vector = std::array::from_fn(|a| from[a] + (p[a] - from[a]) * share);
    // Rounding, where the segment passes at a flat angle.
    let unclear = APART + 1e-12 / (start - end).abs();
    match other.depth(at) {
        depth if depth > unclear => Passage::Jump(if start > 0.0 { 1 } else { -1 }),
        depth if depth < -unclear => Passage::None,
        _ => Passage::Unclear,
    }
}

/// The two of some points on a line that are farthest from each other.
fn farthest(points: &[Vector]) -> Vec<Vector> {
    let from = |a: Vector| {
        move |p: &&Vector, q: &&Vector| {
            let distance = |p: Vector| dot(minus(p, a), minus(p, a));
            distance(**p).total_cmp(&distance(**q))
        }
    };
    let Some(&first) = points.first() else { return Vec::new() };
    let one = points.iter().max_by(from(first)).copied().unwrap_or(first);
    let other = points.iter().max_by(from(one)).copied().unwrap_or(one);
    vec![one, other]
}

/// What of a segment, or a point, has no negative depth.
fn clipped(points: &[Vector], depth: impl Fn(Vector) -> f64) -> Vec<Vector> {
    let mut kept: Vec<Vector> = points.iter().copied().filter(|&p| depth(p) >= 0.0).collect();
    if let [a, b] = *points {
        let (first, second) = (depth(a), depth(b));
        if (first >= 0.0) != (second >= 0.0) {
            let share = first / (first - second);
            kept.push(std::array::from_fn(|n| a[n] + (b[n] - a[n]) * share));
        }
    }
    kept
}

/// Whether the plane of a facet passes a cell, and its bounds do.
pub(super) fn touches(face: &CellFacet, cell: [usize; 3]) -> bool {
    let within = (0..3).all(|a| {
        let from = cell[a] as f64;
        face.low[a] <= from + 1.0 + NEAR && face.high[a] >= from - NEAR
    });
    let centre: Vector = std::array::from_fn(|a| cell[a] as f64 + 0.5);
    let reach = 0.5 * (face.normal[0].abs() + face.normal[1].abs() + face.normal[2].abs());
    within && face.height(centre).abs() <= reach + NEAR
}
