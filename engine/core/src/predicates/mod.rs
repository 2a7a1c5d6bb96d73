//! Do two triangles meet elsewhere than they must? Decided exactly.
//!
//! Most pairs are neighbours in a nearly flat surface, for which signs of determinants in space are hard to tell. In a
//! projection along an axis in which one of the triangles keeps an area they are far apart, and a line that separates
//! them there settles it.
//!
//! Only what is left is decided in space. Two triangles that do not lie in one plane meet exactly if an edge of one
//! meets the other (as in Guigue & Devillers 2003, whose tests are on signs of the same determinants).

use robust::{Coord, Coord3D};
use serde::Serialize;

/// How two triangles meet that should not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Meeting {
    /// An edge of one passes through the inside of the other.
    Crossing,
    /// They lie in one plane and have an area in common.
    Overlapping,
    /// Anything else: they meet in points of the border of one of them, or where an edge of one ends on the other.
    Touching,
}

type Point = [f64; 3];
type Flat = [f64; 2];

/// A triangle with an area.
#[derive(Clone, Debug)]
pub struct ProperTriangle {
    /// Its number.
    pub face: u32,
    /// The numbers of its vertices: what two triangles have in common is told by these.
    pub vertices: [u32; 3],
    /// Where they are.
    pub corners: [Point; 3],
    /// An axis along which its projection keeps an area.
    axis: usize,
}

impl ProperTriangle {
    /// The triangle of a face with these vertices and corners, unless its corners are on a line.
    #[inline]
    pub fn of_face(face: u32, vertices: [u32; 3], corners: [Point; 3]) -> Option<ProperTriangle> {
        Some(ProperTriangle { face, vertices, corners, axis: axis(&corners)? })
    }

    /// One by itself, unless its corners are on a line.
    fn placed(corners: &[[f32; 3]; 3]) -> Option<ProperTriangle> {
        let corners = corners.map(|corner| corner.map(f64::from));
        Some(ProperTriangle { face: 0, vertices: [0, 1, 2], corners, axis: axis(&corners)? })
    }
}

/// The axis along which the projection is largest, as far as rounding lets see, but surely has an area; `None` if the
/// corners are on a line.
fn axis(corners: &[Point; 3]) -> Option<usize> {
    let [u, v] = [1, 2].map(|i| -> Point { std::array::from_fn(|a| corners[i][a] - corners[0][a]) });
    let area = |a: usize| (u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3]).abs();
    let mut axes = [(area(0), 0), (area(1), 1), (area(2), 2)];
    axes.sort_by(|a, b| b.0.total_cmp(&a.0));
    let keeps_area = |axis: &usize| {
        let [p, q, r] = corners.map(|c| flat(c, *axis));
        side_of_line(p, q, r) != 0
    };
    axes.into_iter().map(|(_, axis)| axis).find(keeps_area)
}

/// A point without its coordinate along `axis`.
fn flat(point: Point, axis: usize) -> Flat {
    [point[(axis + 1) % 3], point[(axis + 2) % 3]]
}

fn sign(value: f64) -> i8 {
    i8::from(value > 0.0) - i8::from(value < 0.0)
}

/// On which side of the line from p to q the point r is; 0 if on it, or if p is q.
fn side_of_line(p: Flat, q: Flat, r: Flat) -> i8 {
    let [p, q, r] = [p, q, r].map(|[x, y]| Coord { x, y });
    sign(robust::orient2d(p, q, r))
}

/// On which side of the plane of three points the fourth is; 0 if on it, or if there is no such plane.
#[inline]
pub fn side_of_plane(p: Point, q: Point, r: Point, s: Point) -> i8 {
    let [p, q, r, s] = [p, q, r, s].map(|[x, y, z]| Coord3D { x, y, z });
    sign(robust::orient3d(p, q, r, s))
}

/// How `a` and `b` meet where they need not; `None` if they do not.
pub fn meeting(a: &ProperTriangle, b: &ProperTriangle) -> Option<Meeting> {
    let common = |v: &u32| b.vertices.contains(v);
    match a.vertices.iter().filter(|v| common(v)).count() {
        0 => apart(&a.corners, &b.corners, a.axis),
        1 => {
            let i = a.vertices.iter().position(common)?;
            let j = b.vertices.iter().position(|v| *v == a.vertices[i])?;
            let turned = |c: &[Point; 3], i: usize| [c[i], c[(i + 1) % 3], c[(i + 2) % 3]];
            at_vertex(&turned(&a.corners, i), &turned(&b.corners, j), a.axis)
        }
        2 => {
            let i = a.vertices.iter().position(|v| !common(v))?;
            let j = b.vertices.iter().position(|v| !a.vertices.contains(v))?;
            let edge = [a.corners[(i + 1) % 3], a.corners[(i + 2) % 3]];
            at_edge(edge, a.corners[i], b.corners[j], a.axis)
        }
        _ => Some(Meeting::Overlapping),
    }
}

/// Whether the corners of a triangle are not on a line.
#[inline]
pub fn has_area(corners: &[[f32; 3]; 3]) -> bool {
    ProperTriangle::placed(corners).is_some()
}

/// Whether two triangles meet elsewhere than they must; corners at the same place are one vertex, and what has no area
/// meets nothing.
#[inline]
pub fn meet_by_place(a: &[[f32; 3]; 3], b: &[[f32; 3]; 3]) -> bool {
    meeting_by_place(a, b).is_some()
}

/// How two triangles meet elsewhere than they must, as [`meet_by_place`] has it.
#[inline]
pub fn meeting_by_place(a: &[[f32; 3]; 3], b: &[[f32; 3]; 3]) -> Option<Meeting> {
    let (a, b) = (ProperTriangle::placed(a)?, ProperTriangle::placed(b)?);
    let vertex =
        |n: usize| a.corners.iter().position(|corner| *corner == b.corners[n]).unwrap_or(3 + n) as u32;
    let vertices = [0, 1, 2].map(vertex);
    meeting(&a, &ProperTriangle { vertices, ..b })
}

/// Of two triangles without a common vertex. `a` has an area along `axis`.
fn apart(a: &[Point; 3], b: &[Point; 3], axis: usize) -> Option<Meeting> {
    let (flat_a, flat_b) = (a.map(|c| flat(c, axis)), b.map(|c| flat(c, axis)));
    if separated(&flat_a, &flat_b, true) {
        return None;
    }
    let a_sides = a.map(|corner| side_of_plane(b[0], b[1], b[2], corner));
    if on_one_side(&a_sides) {
        return None;
    }
    let b_sides = b.map(|corner| side_of_plane(a[0], a[1], a[2], corner));
    if on_one_side(&b_sides) {
        return None;
    }
    if a_sides == [0; 3] {
        let have_area = !separated(&flat_a, &flat_b, false);
        return Some(if have_area { Meeting::Overlapping } else { Meeting::Touching });
    }
    let edges = |t: &[Point; 3], sides: &[i8; 3], other: &[Point; 3]| {
        let meet = |i: usize| {
            let j = (i + 1) % 3;
            pierce([t[i], t[j]], [sides[i], sides[j]], other)
        };
        strongest((0..3).filter_map(meet))
    };
    strongest([edges(a, &a_sides, b), edges(b, &b_sides, a)].into_iter().flatten())
}

/// Of two triangles whose first corners are the same vertex. Where they meet elsewhere, they meet along a line from that
/// vertex, which ends on the edge of one that lies opposite.
fn at_vertex(a: &[Point; 3], b: &[Point; 3], axis: usize) -> Option<Meeting> {
    let (flat_a, flat_b) = (a.map(|c| flat(c, axis)), b.map(|c| flat(c, axis)));
    if wedges_separated(&flat_a, &flat_b, true) {
        return None;
    }
    let a_sides = [1, 2].map(|i| side_of_plane(b[0], b[1], b[2], a[i]));
    if on_one_side(&a_sides) {
        return None;
    }
    let b_sides = [1, 2].map(|i| side_of_plane(a[0], a[1], a[2], b[i]));
    if on_one_side(&b_sides) {
        return None;
    }
    if a_sides == [0; 2] {
        let have_area = !wedges_separated(&flat_a, &flat_b, false);
        return Some(if have_area { Meeting::Overlapping } else { Meeting::Touching });
    }
    let meetings = [pierce([a[1], a[2]], a_sides, b), pierce([b[1], b[2]], b_sides, a)];
    strongest(meetings.into_iter().flatten())
}

/// Of two triangles on a common edge with the third corners `a` and `b`: they meet elsewhere if one is folded onto the
/// other. The first has an area along `axis`.
fn at_edge([p, q]: [Point; 2], a: Point, b: Point, axis: usize) -> Option<Meeting> {
    let [u, v] = [p, q].map(|c| flat(c, axis));
    let [a_side, b_side] = [a, b].map(|c| side_of_line(u, v, flat(c, axis)));
    let folded = a_side * b_side >= 0 && side_of_plane(p, q, a, b) == 0;
    folded.then_some(Meeting::Overlapping)
}

/// A crossing rather than a touch.
fn strongest(meetings: impl Iterator<Item = Meeting>) -> Option<Meeting> {
    meetings.min()
}

fn on_one_side(sides: &[i8]) -> bool {
    sides[0] != 0 && sides.iter().all(|side| *side == sides[0])
}

/// How the edge p–q meets the triangle `t`, given on which sides of its plane p and q are. Where both are in it, the edge
/// meets the triangle only if another edge of the two triangles meets one of them too, so that need not be looked at.
fn pierce([p, q]: [Point; 2], sides: [i8; 2], t: &[Point; 3]) -> Option<Meeting> {
    if sides[0] * sides[1] > 0 || sides == [0; 2] {
        return None;
    }
    // How the line through p and q passes the three edges: alike, if it passes through the triangle.
    let passes = [0, 1, 2].map(|i| side_of_plane(p, q, t[i], t[(i + 1) % 3]));
    if passes.contains(&1) && passes.contains(&-1) {
        return None;
    }
    let inside = !passes.contains(&0) && !sides.contains(&0);
    Some(if inside { Meeting::Crossing } else { Meeting::Touching })
}

/// Whether a line along an edge of one of two triangles in the plane has them on different sides: `strictly` so that they
/// have no point in common, else so that they have no area in common. The first has an area. Complete where both have:
/// the edges of the Minkowski difference of two polygons are theirs.
fn separated(a: &[Flat; 3], b: &[Flat; 3], strictly: bool) -> bool {
    let by_edge = |t: &[Flat; 3], other: &[Flat; 3], i: usize| {
        let (p, q, third) = (t[i], t[(i + 1) % 3], t[(i + 2) % 3]);
        let own = side_of_line(p, q, third);
        let beyond = |side: i8| if strictly { side == -own } else { side != own };
        // An edge on end has no line.
        own != 0 && other.iter().all(|&r| beyond(side_of_line(p, q, r)))
    };
    (0..3).any(|i| by_edge(a, b, i) || by_edge(b, a, i))
}

/// Whether a line along an edge at the common first corner of two triangles in the plane has them on different sides:
/// `strictly` so that they have only that corner in common, else so that they have no area in common. The first has an
/// area. Complete where both have.
fn wedges_separated(a: &[Flat; 3], b: &[Flat; 3], strictly: bool) -> bool {
    let by_edge = |t: &[Flat; 3], other: &[Flat; 3], i: usize| {
        let (tip, end, third) = (t[0], t[i], t[3 - i]);
        let own = side_of_line(tip, end, third);
        let beyond = |r: Flat| {
            let side = side_of_line(tip, end, r);
            // On the line it may be if it is on the other ray.
            side != own && (side != 0 || !strictly || is_opposite(tip, end, r))
        };
        own != 0 && beyond(other[1]) && beyond(other[2])
    };
    (1..3).any(|i| by_edge(a, b, i) || by_edge(b, a, i))
}

/// Whether `r`, on the line through `tip` and `end`, is on the other side of `tip` than `end`.
fn is_opposite(tip: Flat, end: Flat, r: Flat) -> bool {
    (0..2).any(|n| end[n] < tip[n] && tip[n] < r[n] || r[n] < tip[n] && tip[n] < end[n])
}
