//! Stretches of the boundary, square by square, joined to closed polylines.

use super::arc::{ArcEnd, BoundaryArc};
use crate::error::{Error, Result};
use rayon::prelude::*;

/// Closed polylines in a plane.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contour {
    /// World coordinates by the axes of [`Plane::sides`](super::Plane::sides), first to the right and second upward: the
    /// inside lies to the left of every loop. The last point is joined to the first.
    pub loops: Vec<Vec<[f64; 2]>>,
    /// What they enclose, in square world units.
    pub area: f64,
    /// A bound on the error of that area, if between each two crossings of the lattice the boundary bends one way and
    /// nothing hides: on the areas between chords and tangents there.
    pub area_error: f64,
    /// Their length.
    pub length: f64,
}

/// Numbers of edges of squares.
pub(super) type EdgeId = u64;

/// The number of the edge from a corner to the right (0) or upward (1).
pub(super) fn edge([u, v]: [u32; 2], side: usize) -> EdgeId {
    u64::from(v) << 32 | u64::from(u) << 1 | side as u64
}

/// Where the boundary passes an edge, in cells from the root's first sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgePoint {
    pub at: [f64; 2],
    /// By the plane's sides and its axis.
    pub normal: Option<[f64; 3]>,
    /// How far it may be off.
    pub bound: f64,
}

/// The boundary through a square, from passage to passage.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContourSegment {
    pub from: EdgeId,
    pub to: EdgeId,
    /// The square's lower left corner.
    pub square: [u32; 2],
    /// Whether no other one passes the square.
    pub is_alone: bool,
}

/// What a tile adds.
#[derive(Default)]
pub(super) struct TileContour {
    pub points: Vec<(EdgeId, EdgePoint)>,
    pub stretches: Vec<ContourSegment>,
}

impl Contour {
    /// Joins stretches to loops, each beginning at its first edge. `world` places a point given in cells.
    pub(super) fn of(part: TileContour, cell: f64, world: impl Fn([f64; 2]) -> [f64; 2]) -> Result<Contour> {
        let TileContour { mut points, mut stretches } = part;
        points.par_sort_unstable_by_key(|(edge, _)| *edge);
        stretches.par_sort_unstable_by_key(|stretch| stretch.from);
        let fit = points.len() == stretches.len()
            && points.iter().zip(&stretches).all(|((edge, _), stretch)| *edge == stretch.from);
        let find = |edge: EdgeId| points.binary_search_by_key(&edge, |(edge, _)| *edge).ok();
        let next: Option<Vec<usize>> = stretches.iter().map(|stretch| find(stretch.to)).collect();
        let Some(next) = next.filter(|_| fit) else {
            return Err(Error::setting(
                "the tree contradicts itself",
                "check the store with `brickfield verify` and build it again",
            ));
        };
        let mut contour = Contour::default();
        // In square cells.
        let mut error = 0.0;
        let mut is_done = vec![false; points.len()];
        for first in 0..points.len() {
            let mut line: Vec<[f64; 2]> = Vec::new();
            let mut at = first;
            while !std::mem::replace(&mut is_done[at], true) {
                let place = &points[at].1;
                let arc = arc(&stretches[at], place, &points[next[at]].1);
                // A passage that is off moves the ends of two stretches, each in a square one cell wide.
                error += place.bound.min(1.0) + arc.area_bound();
                for point in std::iter::once(place.at).chain(arc.corners()).map(&world) {
                    if line.last() != Some(&point) {
                        line.push(point);
                    }
                }
                at = next[at];
            }
            if line.len() > 1 && line.first() == line.last() {
                line.pop();
            }
            if line.len() > 2 {
                contour.add(line);
            }
        }
        contour.area_error = error * cell * cell;
        Ok(contour)
    }

    fn add(&mut self, line: Vec<[f64; 2]>) {
        let from = line[0];
        for (a, b) in line.iter().zip(line.iter().cycle().skip(1)) {
            // About a point of the loop, so that nothing large cancels.
            let [[ax, ay], [bx, by]] = [a, b].map(|p| [p[0] - from[0], p[1] - from[1]]);
            self.area += (ax * by - bx * ay) / 2.0;
            self.length += ((bx - ax).powi(2) + (by - ay).powi(2)).sqrt();
        }
        self.loops.push(line);
    }
}

/// How a stretch bends. Two in one square are straight, so that they do not cross.
fn arc(stretch: &ContourSegment, from: &EdgePoint, to: &EdgePoint) -> BoundaryArc {
    let [from, to] = [from, to].map(|place| ArcEnd { at: place.at, normal: place.normal });
    match stretch.is_alone {
        true => BoundaryArc::new(stretch.square.map(f64::from), from, to),
        false => BoundaryArc::straight(from, to),
    }
}
