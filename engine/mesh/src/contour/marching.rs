//! Marching cubes (Lorensen & Cline 1987), for comparison with the dual method: vertices where the surface crosses
//! lattice edges, polygons within cells.
//!
//! Cells are looped as for the dual method, ambiguous faces by their Hermite data ([`super::face_ambiguity`]), where the
//! asymptotic decider (Nielson & Hamann 1991) asks the four samples, which are whole numbers here and often do not
//! tell.
//!
//! A loop is a ring of crossings, and becomes triangles without a diagonal between two edges of one face of the cell;
//! where that is not possible, it becomes a fan about the middle of its crossings.
//!
//! So nothing lies in a face but its cuts, each of which has the two cells at it: the mesh is closed and manifold, as
//! the dual one is.
//!
//! A vertex knows one edge of the lattice, so edges of the part are cut off within cells, and triangles are as thin as
//! crossings are near each other. Surfaces that pass from leaves of one level to those of another are refused.

use super::cells::{CELL_ROWS, CellRow, mark_active};
use super::cut::{Cutter, QuadSplit, Vertex};
use super::edges::{EDGE_PLACES, EdgeStreams};
use super::envelope::MinimalEdge;
use super::face_ambiguity;
use super::field::LevelSet;
use super::leaves::{LeafNeighbour, LeafNeighbours, broken, direction_index};
use super::normal_sum::NormalSum;
use super::polygons::{FacetOptions, LeafFacets, direction};
use super::surface::{HermiteSurface, LeafSurface};
use super::topology::{CellCase, CellLoops, KINDS, SQUARE, cell_around, edge_lower};
use super::triangle_names::TriangleNames;
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey};
use std::sync::{Arc, LazyLock};

/// The crossings of a loop, by edge of the cell, one after the other.
struct LoopCrossings {
    edges: Vec<u8>,
    cut: Cut,
}

/// How a ring becomes triangles.
enum Cut {
    /// Along a diagonal of four corners: from the first, from the second, where allowed.
    Quad([bool; 2]),
    /// Into these.
    Triangles(Vec<[u8; 3]>),
    /// Into a fan about its middle.
    Fan,
}

/// By kind of cell.
static RINGS: LazyLock<Vec<Vec<LoopCrossings>>> = LazyLock::new(|| {
    let mut rings: Vec<Vec<LoopCrossings>> = Vec::new();
    rings.resize_with(KINDS, Vec::new);
    for kind in CellCase::all() {
        rings[kind.index()] = rings_of(kind.loops());
    }
    rings
});

fn rings_of(loops: &CellLoops) -> Vec<LoopCrossings> {
    let mut next = [None; 12];
    for face in 0..6 {
        for (enter, leave) in loops.face_cuts(Axis::ALL[face / 2], face % 2) {
            next[enter] = Some(leave);
        }
    }
    let ring = |of: usize| {
        let first = loops.edges[of].trailing_zeros() as usize;
        let ring = std::iter::successors(Some(first), |&edge| next[edge].filter(|&after| after != first));
        LoopCrossings::new(ring.map(|edge| edge as u8).collect())
    };
    (0..usize::from(loops.count)).map(ring).collect()
}

impl LoopCrossings {
    fn new(edges: Vec<u8>) -> LoopCrossings {
        let apart = |a: usize, b: usize| faces_at(edges[a]) & faces_at(edges[b]) == 0;
        let mut triangles = Vec::new();
        let cut = match edges.len() {
            4 if apart(0, 2) || apart(1, 3) => Cut::Quad([apart(0, 2), apart(1, 3)]),
            count if cut(&edges, (0, count - 1), &mut triangles) => Cut::Triangles(triangles),
            _ => Cut::Fan,
        };
        LoopCrossings { edges, cut }
    }
}

/// Bit per face, number `2·axis + side`, that an edge of the cell lies on.
fn faces_at(edge: u8) -> u8 {
    let (axis, low) = edge_lower(edge.into());
    let (u, v) = axis.others();
    [u, v].iter().fold(0, |faces, across| faces | 1 << (2 * across.index() + low[across.index()]))
}

/// Cuts the part of a ring between two of its corners, without diagonals in faces; whether there is such a cut.
fn cut(ring: &[u8], (from, to): (usize, usize), triangles: &mut Vec<[u8; 3]>) -> bool {
    if to - from < 2 {
        return true;
    }
    let is_side = |a: usize, b: usize| b - a == 1 || faces_at(ring[a]) & faces_at(ring[b]) == 0;
    let before = triangles.len();
    for apex in (from + 1..to).filter(|&apex| is_side(from, apex) && is_side(apex, to)) {
        triangles.push([from, apex, to].map(|corner| corner as u8));
        if cut(ring, (from, apex), triangles) && cut(ring, (apex, to), triangles) {
            return true;
        }
        triangles.truncate(before);
    }
    false
}

/// The vertices of a leaf, those on the edges that start at one of its own samples, and its triangles; the leaf is done
/// with then.
///
/// # Errors
/// Where leaves of different levels meet at the surface; what reading the tree gives.
pub(super) fn leaf_facets(
    field: &LevelSet,
    leaf: u32,
    making: &FacetOptions,
) -> Result<(Vec<[f32; 3]>, LeafFacets)> {
    let around = field.leaves.around(leaf);
    let surface = field.leaves.get(leaf).changes.then(|| field.surface(leaf)).transpose()?;
    let made = match surface.as_deref() {
        Some(LeafSurface::Changes(changes)) => march(field, (leaf, &around), changes, making)?,
        _ => Default::default(),
    };
    field.release(leaf);
    Ok(made)
}

fn march(
    field: &LevelSet,
    (leaf, around): (u32, &LeafNeighbours),
    changes: &HermiteSurface,
    making: &FacetOptions,
) -> Result<(Vec<[f32; 3]>, LeafFacets)> {
    let key = field.leaves.get(leaf).key;
    let Crossings { corners, positions, names } = Crossings::of(field, (leaf, around), changes)?;
    let centre = field.root.origin.map(|o| o + 0.5 * field.root.edge);
    let mut cutter = Cutter::new(centre, TriangleNames::ON_EDGES, making.wanted, making.spare.take());
    let mut normals = making.normals.then(|| own_normals(changes));
    let mut rows = vec![CellRow::default(); CELL_ROWS];
    mark_active(&changes.signs, &mut rows);
    for (n, row) in rows.iter().enumerate().filter(|(_, row)| row.active != 0) {
        let (j, k) = (n % BRICK_CELLS, n / BRICK_CELLS);
        let streams = EdgeStreams::of(Some(changes), j, k);
        for i in (0..BRICK_CELLS).filter(|i| row.active >> i & 1 == 1) {
            let kind = face_ambiguity::kind(field, key, changes, [i, j, k])?;
            for ring in &RINGS[kind.index()] {
                let slot = |n: usize| streams.slot(i, &EDGE_PLACES[usize::from(ring.edges[n])]);
                if let (Some(normals), Cut::Fan) = (&mut normals, &ring.cut) {
                    let of_ring = (0..ring.edges.len()).map(|n| changes.planes[slot(n)].normal);
                    normals.push(NormalSum::of(of_ring).direction());
                }
                push(&mut cutter, ring, |n| corners[slot(n)]);
            }
        }
    }
    let Cutter { count, bytes, measured, edge_vertices, .. } = cutter.finish();
    let normals = normals.unwrap_or_default();
    let facets =
        LeafFacets { count, bytes, names, measured, edge_vertices, normals, ..LeafFacets::default() };
    Ok((positions, facets))
}

/// Normals of the crossings that are the leaf's own.
fn own_normals(changes: &HermiteSurface) -> Vec<[f32; 3]> {
    let (mut planes, mut normals) = (changes.planes.iter(), Vec::new());
    for axis in Axis::ALL {
        changes.signs.for_edges(axis, |low| {
            let own = planes.next().filter(|_| owner_of(low) == [0; 3]);
            normals.extend(own.map(|plane| NormalSum::of([plane.normal]).direction()));
        });
    }
    normals
}

/// Hands the triangles of a ring on. Rings run counter-clockwise seen from outside.
fn push(cutter: &mut Cutter, ring: &LoopCrossings, corner: impl Fn(usize) -> Vertex) {
    match &ring.cut {
        &Cut::Quad(allowed) => {
            cutter.push([0, 1, 2, 3].map(&corner), QuadSplit::Quad, allowed);
        }
        Cut::Triangles(triangles) => {
            for triangle in triangles {
                cutter.push_triangle(triangle.map(|n| corner(n.into())), true);
            }
        }
        Cut::Fan => {
            let corners: Vec<Vertex> = (0..ring.edges.len()).map(corner).collect();
            let sum = |a: usize| corners.iter().map(|(_, at)| f64::from(at[a])).sum::<f64>();
            let middle = [0, 1, 2].map(|a| (sum(a) / corners.len() as f64) as f32);
            cutter.push_fan_about(middle, &corners, true);
        }
    }
}

/// The crossings on the edges of a leaf.
struct Crossings {
    /// By place in the leaf's planes.
    corners: Vec<Vertex>,
    /// Of those that are the leaf's own.
    positions: Vec<[f32; 3]>,
    names: TriangleNames,
}

impl Crossings {
    fn of(
        field: &LevelSet,
        (leaf, around): (u32, &LeafNeighbours),
        changes: &HermiteSurface,
    ) -> Result<Crossings> {
        let key = field.leaves.get(leaf).key;
        let lattice = field.frame(key).lattice();
        let mut edges = Vec::with_capacity(changes.planes.len());
        for axis in Axis::ALL {
            changes.signs.for_edges(axis, |low| edges.push((axis, low)));
        }
        let own = edges.iter().filter(|(_, low)| owner_of(*low) == [0; 3]).count();
        let mut names = TriangleNames::new(leaf, own);
        let (mut corners, mut positions) = (Vec::with_capacity(edges.len()), Vec::with_capacity(own));
        let mut owners = [const { None }; 27];
        for (&(axis, low), plane) in edges.iter().zip(&changes.planes) {
            require_one_level(around, axis, low)?;
            let owner = owner_of(low);
            if owner == [0; 3] {
                let position = placed(&lattice, axis, low, plane.fraction);
                corners.push((names.of(leaf, positions.len() as u32), position));
                positions.push(position);
                continue;
            }
            let place = direction_index(owner);
            let owner = match &mut owners[place] {
                Some(owner) => owner,
                none => none.insert(ApronOwner::new(field, around[place])?),
            };
            corners.push(owner.corner(axis, low, &mut names).ok_or_else(|| broken(key))?);
        }
        Ok(Crossings { corners, positions, names })
    }
}

/// In which direction the leaf lies that a sample of a leaf belongs to: those of the apron are the upper neighbours'.
fn owner_of(low: [usize; 3]) -> [i32; 3] {
    low.map(|c| i32::from(c == BRICK_CELLS))
}

/// The crossing on an edge, in the world.
fn placed(lattice: &[[f32; BRICK_POINTS]; 3], axis: Axis, low: [usize; 3], fraction: f32) -> [f32; 3] {
    MinimalEdge::placed(lattice, axis, low, fraction).crossing()
}

/// Fails unless all four cells around an edge are of one size.
fn require_one_level(around: &LeafNeighbours, axis: Axis, low: [usize; 3]) -> Result<()> {
    let (u, v) = axis.others();
    let is_border = [u, v].iter().any(|across| matches!(low[across.index()], 0 | BRICK_CELLS));
    let is_same = |quadrant: [usize; 2]| {
        let cell = cell_around(axis, low.map(|c| c as i32), quadrant);
        matches!(around[direction_index(direction(cell))], LeafNeighbour::Same(_))
    };
    if !is_border || SQUARE.into_iter().all(is_same) {
        return Ok(());
    }
    Err(Error::setting(
        "marching cubes does not join bricks of different sizes, as they meet at this surface",
        "leave `method` out, or choose a `level` at which they have one size",
    ))
}

/// The leaf that edges of the apron belong to.
struct ApronOwner {
    leaf: u32,
    surface: Arc<LeafSurface>,
    lattice: [[f32; BRICK_POINTS]; 3],
    /// By axis and row of cells, how many of its own edges come before.
    before: [Vec<u32>; 3],
}

impl ApronOwner {
    fn new(field: &LevelSet, side: LeafNeighbour) -> Result<ApronOwner> {
        let LeafNeighbour::Same(leaf) = side else { return Err(broken(NodeKey::ROOT)) };
        let surface = field.surface(leaf)?;
        let mut before = [const { Vec::new() }; 3];
        if let LeafSurface::Changes(changes) = &*surface {
            let mut sum = 0;
            for axis in Axis::ALL {
                before[axis.index()] = (0..CELL_ROWS)
                    .map(|row| {
                        let edges = changes.signs.edges(axis, row % BRICK_CELLS, row / BRICK_CELLS);
                        let before = sum;
                        // Edges that begin on the apron are not its own.
                        sum += (edges as u32).count_ones();
                        before
                    })
                    .collect();
            }
        }
        let lattice = field.frame(field.leaves.get(leaf).key).lattice();
        Ok(ApronOwner { leaf, surface, lattice, before })
    }

    /// The crossing on an edge of it, given by the lower sample as the leaf below it counts.
    fn corner(&self, axis: Axis, low: [usize; 3], names: &mut TriangleNames) -> Option<Vertex> {
        let LeafSurface::Changes(changes) = &*self.surface else { return None };
        let low = low.map(|c| c % BRICK_CELLS);
        let [i, j, k] = low;
        let edges = changes.signs.edges(axis, j, k);
        if edges >> i & 1 == 0 {
            return None;
        }
        let number = self.before[axis.index()][k * BRICK_CELLS + j] + (edges & ((1 << i) - 1)).count_ones();
        let plane = changes.planes.get(changes.slot(axis, low))?;
        Some((names.of(self.leaf, number), placed(&self.lattice, axis, low, plane.fraction)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_have_no_diagonals_in_faces() {
        let (mut fans, mut longest) = (0, 0);
        for kind in CellCase::all() {
            let rings = &RINGS[kind.index()];
            assert_eq!(rings.len(), usize::from(kind.loops().count));
            for (of, ring) in rings.iter().enumerate() {
                let bits = ring.edges.iter().fold(0u16, |bits, edge| bits | 1 << edge);
                assert_eq!((bits, bits.count_ones() as usize), (kind.loops().edges[of], ring.edges.len()));
                let count = ring.edges.len();
                longest = longest.max(count);
                let apart = |a: usize, b: usize| faces_at(ring.edges[a]) & faces_at(ring.edges[b]) == 0;
                match &ring.cut {
                    Cut::Quad(allowed) => assert_eq!((*allowed, count), ([apart(0, 2), apart(1, 3)], 4)),
                    Cut::Fan => fans += 1,
                    Cut::Triangles(triangles) => {
                        assert_eq!(triangles.len(), count - 2);
                        // Every side of the ring once, every diagonal there and back.
                        let mut sides: Vec<[usize; 2]> = Vec::new();
                        for [a, b, c] in triangles.iter().map(|t| t.map(usize::from)) {
                            for side in [[a, b], [b, c], [c, a]] {
                                match sides.iter().position(|&[p, q]| [q, p] == side) {
                                    Some(back) => drop(sides.remove(back)),
                                    None => sides.push(side),
                                }
                                let is_side = (side[0] + 1) % count == side[1];
                                assert!(is_side || apart(side[0], side[1]));
                            }
                        }
                        assert!(sides.iter().all(|&[p, q]| (p + 1) % count == q) && sides.len() == count);
                    }
                }
            }
        }
        assert_eq!(longest, 9);
        assert!(fans > 0);
    }
}
