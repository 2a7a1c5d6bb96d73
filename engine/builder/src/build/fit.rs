//! Whether a node of a closed soup need not be divided, because the boundary w = 0.5 below it is near enough to the mesh
//! that its own samples and Hermite edges give.
//!
//! The vertices are those of that mesh ([`crate::contour`]), and what they are measured against are the triangles
//! themselves. A node fits if one sheet passes each of its cells with a sign change, and if every triangle, in every
//! cell that it has a part in,
//! - passes the cell's vertex within the tolerance, as a plane, and faces as one of the cell's crossings does. All
//!   vertices of a polygon of the mesh belong to cells around one crossing, hence to cells in which one facet has a
//!   part. The polygon is in the convex hull of its vertices. So it is within the tolerance of the plane of that
//!   facet, whatever the levels of the cells are. And where all planes of a cell pass one point, the boundary there is
//!   the cone from that point to where it leaves the cell, as the mesh is.
//! - Or its part reaches no farther than the tolerance out of a neighbouring cell of which that holds, or out of the
//!   node, or out of one of the cell's planes. That is what is cut off where a crease or a curved face passes between
//!   samples.
//! - Or its part is none of the boundary: w ≥ 1 on both sides, or on neither. That is found by counting crossings from a
//!   corner of the cell, after the part has been divided along all facets that pass through it. So overlaps inside do not
//!   divide a node, and nothing that hides between samples is lost.
//!
//! What the floating-point arithmetic here cannot tell divides the node. All of it follows from the node's samples,
//! Hermite edges and triangles, whatever their order.

mod cell;
mod polygon;

use crate::brick::Brick;
use crate::contour::{SingleBrick, SingleBrickCells};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey, RootCube, Triangle, dot};
use cell::{CellFacets, FACES_MAX, touches};
use polygon::{CellFacet, ConvexPolygon};
use std::cell::OnceCell;

/// A tolerance counts as no more cells than this: what is half a cell apart may hide between samples.
const CELLS_MAX: f64 = 0.25;
/// How many parts of facets that are likely to be some of the boundary are told at once: each takes a look at all facets.
const TOLD_AT_ONCE: u32 = 32;
/// Cosine of the angle up to which a facet faces as a crossing does.
const FACING: f64 = 0.5;
/// The same for what only reaches a little out of a plane, but for the rounding of normals: of every closed body, however
/// small, some facets face against the plane.
const NOT_BEHIND: f64 = -1e-3;

/// How far the mesh of a leaf above the depth limit may be from the boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MeshTolerance {
    root: RootCube,
    /// In the root's unit of length.
    length: f64,
}

/// A node that may be kept.
struct Fit<'a> {
    cells: SingleBrickCells,
    brick: &'a Brick,
    /// In cells.
    tolerance: f64,
}

impl MeshTolerance {
    pub fn new(length: f64, root: RootCube) -> MeshTolerance {
        MeshTolerance { root, length }
    }

    /// The brick that a node gives, and whether the boundary within is near enough to its mesh. `triangles` are all that
    /// touch the node.
    pub fn fits<'t>(
        &self,
        key: NodeKey,
        brick: Brick,
        triangles: impl Iterator<Item = &'t Triangle> + Clone,
    ) -> Result<(Brick, bool)> {
        let tolerance = (self.length / self.root.spacing(key.level())).min(CELLS_MAX);
        let (min, max) = brick.range();
        let (brick, cells) = if min >= 1 || max < 1 {
            (brick, SingleBrickCells::none())
        } else {
            let lone = SingleBrick::new(brick, self.cube(key));
            let cells = lone.cells(tolerance)?;
            let brick = lone.into_brick()?;
            let Some(cells) = cells else { return Ok((brick, false)) };
            (brick, cells)
        };
        let fits = Fit { cells, brick: &brick, tolerance }.holds(key, triangles);
        Ok((brick, fits))
    }

    /// The cube of which the node would be the root.
    fn cube(&self, key: NodeKey) -> RootCube {
        let edge = self.root.edge / f64::from(1u32 << key.level());
        // Unit 1 of it, as of the root, is the first sample.
        let first = self.root.to_world(key.base().map(|b| f64::from(b) + 1.0));
        let unit = edge / f64::from(1u32 << crate::lattice::ROOT_BITS);
        RootCube { origin: first.map(|c| c - unit), edge }
    }
}

impl Fit<'_> {
    fn holds<'t>(&self, key: NodeKey, triangles: impl Iterator<Item = &'t Triangle> + Clone) -> bool {
        let facets =
            Facets { all: triangles.map(|t| CellFacet::new(t, key)).collect(), ranks: OnceCell::new() };
        let faces = &facets.all;
        // What is left to tell, with its cell first. Some of it is told at once, as most nodes that do not fit show it soon:
        // what lies outside, or next to a sign change, is mostly a part of the boundary.
        let mut left: Vec<(usize, u32)> = Vec::new();
        let mut told = 0;
        for (n, face) in faces.iter().enumerate() {
            let may_fit = ConvexPolygon::triangle(face.corners).all_cells(|cell, part| {
                if self.is_near(face, cell, part) {
                    return true;
                }
                left.push((index_of(cell), n as u32));
                let is_likely =
                    told < TOLD_AT_ONCE && (self.cells.at(cell).is_some() || self.brick.sample(cell) < 1);
                if !is_likely && !left.len().is_power_of_two() {
                    return true;
                }
                told += 1;
                let crowd = (0..faces.len() as u32).filter(|&n| touches(&faces[n as usize], cell));
                self.is_hidden_inside(&facets, cell, crowd.collect(), std::iter::once(n as u32))
            });
            if !may_fit {
                return false;
            }
        }
        left.sort_unstable();
        let lists = Lists::new(faces, &left);
        left.chunk_by(|a, b| a.0 == b.0).zip(0..).all(|(of_cell, number)| {
            let asked = of_cell.iter().map(|(_, n)| *n);
            self.is_hidden_inside(&facets, cell_of(of_cell[0].0), lists.of(number).to_vec(), asked)
        })
    }

    /// Whether no part of some facets in a cell is one of the boundary, but for what is near the mesh; `crowd` are all
    /// that touch the cell.
    fn is_hidden_inside(
        &self,
        facets: &Facets,
        cell: [usize; 3],
        mut crowd: Vec<u32>,
        mut asked: impl Iterator<Item = u32>,
    ) -> bool {
        if crowd.len() > FACES_MAX {
            return false;
        }
        // Whatever the order of the triangles is.
        let (ranks, numbers) = (facets.ranks(), &mut crowd);
        numbers.sort_unstable_by_key(|&n| ranks[n as usize]);
        let faces: Vec<CellFacet> = numbers.iter().map(|&n| facets.all[n as usize]).collect();
        let crowd = CellFacets { brick: self.brick, cell, faces: &faces };
        asked.all(|asked| {
            let Some(own) = numbers.iter().position(|&n| n == asked) else { return false };
            let face = &faces[own];
            let part = ConvexPolygon::triangle(face.corners).within(cell);
            crowd.all_boundary(own, &part, |piece| self.is_near(face, cell, piece))
        })
    }

    /// Whether a part of a facet in a cell is near the mesh.
    fn is_near(&self, face: &CellFacet, cell: [usize; 3], part: &ConvexPolygon) -> bool {
        self.is_seen(face, cell) || self.reaches_little(face, cell, part)
    }

    /// Whether the facet passes the vertex of a cell within the tolerance, and faces as one of the cell's crossings.
    fn is_seen(&self, face: &CellFacet, cell: [usize; 3]) -> bool {
        let Some((vertex, planes)) = self.cells.at(cell) else { return false };
        face.height(vertex).abs() <= self.tolerance
            && planes.iter().any(|(_, normal)| dot(*normal, face.normal) >= FACING)
    }

    /// Whether a part comes only so far out of a plane of the cell, or a cell around, or the node.
    fn reaches_little(&self, face: &CellFacet, cell: [usize; 3], part: &ConvexPolygon) -> bool {
        let near = |height: f64| height.abs() <= self.tolerance;
        if let Some((vertex, planes)) = self.cells.at(cell)
            && planes.iter().any(|(at, normal)| {
                let height = |p: [f64; 3]| dot(*normal, p) - dot(*normal, *at);
                dot(*normal, face.normal) >= NOT_BEHIND
                    && near(height(vertex))
                    && part.corners().iter().all(|&p| near(height(p)))
            })
        {
            return true;
        }
        let ranges = [0, 1, 2].map(|axis| part.range(axis));
        // Of the cells around those out of which it reaches so little.
        let steps = |axis: usize| {
            let (low, high) = ranges[axis];
            let from = cell[axis] as f64;
            let below = cell[axis] > 0 && near(high - from);
            let above = cell[axis] + 1 < BRICK_CELLS && near(from + 1.0 - low);
            cell[axis] - usize::from(below)..=cell[axis] + usize::from(above)
        };
        let [x, y, z] = [0, 1, 2].map(steps);
        let seen_around = z.into_iter().any(|k| {
            y.clone().any(|j| x.clone().any(|i| [i, j, k] != cell && self.is_seen(face, [i, j, k])))
        });
        seen_around || (0..3).any(|axis| self.leaves_node(face, cell, axis, ranges[axis]))
    }

    /// Whether a part with this range along an axis reaches so little into the node, into a cell without a sign change, and
    /// faces as what comes in there does: inward if the cell is outside. What else of a small body there is faces so for the
    /// node on the other side, which is divided.
    fn leaves_node(&self, face: &CellFacet, cell: [usize; 3], axis: usize, (low, high): (f64, f64)) -> bool {
        let last = BRICK_CELLS as f64;
        let from_below = low == 0.0 && high <= self.tolerance;
        let from_above = high == last && last - low <= self.tolerance;
        let is_inside = self.brick.sample(cell) >= 1;
        let faces_up = face.normal[axis] > 0.0;
        self.cells.at(cell).is_none()
            && ((from_below && faces_up != is_inside) || (from_above && faces_up == is_inside))
    }
}

/// The facets that touch a node.
struct Facets {
    all: Vec<CellFacet>,
    /// See [`Facets::ranks`].
    ranks: OnceCell<Vec<u32>>,
}

impl Facets {
    /// The place of each among all in an order that their corners alone decide; equal ones stay as they come.
    fn ranks(&self) -> &[u32] {
        self.ranks.get_or_init(|| {
            let mut order: Vec<u32> = (0..self.all.len() as u32).collect();
            order.sort_by(|&a, &b| compare(&self.all[a as usize], &self.all[b as usize]));
            let mut ranks = vec![0; order.len()];
            (0..).zip(order).for_each(|(rank, n)| ranks[n as usize] = rank);
            ranks
        })
    }
}

/// For some cells the facets that touch each.
struct Lists {
    /// Where those of each end, after a leading zero.
    ends: Vec<u32>,
    faces: Vec<u32>,
}

impl Lists {
    /// Of the cells that come in `asked`, in order.
    fn new(faces: &[CellFacet], asked: &[(usize, u32)]) -> Lists {
        let mut lists = Lists { ends: vec![0], faces: Vec::new() };
        if asked.is_empty() {
            return lists;
        }
        const NOT_ASKED: u32 = u32::MAX;
        let mut numbers = vec![NOT_ASKED; BRICK_CELLS.pow(3)];
        let mut count = 0;
        for of_cell in asked.chunk_by(|a, b| a.0 == b.0) {
            numbers[of_cell[0].0] = count;
            count += 1;
        }
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for (n, face) in faces.iter().enumerate() {
            face.for_bounds(|cell| {
                let number = numbers[index_of(cell)];
                if number != NOT_ASKED && touches(face, cell) {
                    pairs.push((number, n as u32));
                }
            });
        }
        pairs.sort_unstable();
        lists.ends.extend((0..count).map(|number| pairs.partition_point(|pair| pair.0 <= number) as u32));
        lists.faces = pairs.into_iter().map(|pair| pair.1).collect();
        lists
    }

    fn of(&self, number: usize) -> &[u32] {
        &self.faces[self.ends[number] as usize..self.ends[number + 1] as usize]
    }
}

fn cell_of(index: usize) -> [usize; 3] {
    [index % BRICK_CELLS, index / BRICK_CELLS % BRICK_CELLS, index / BRICK_CELLS / BRICK_CELLS]
}

fn index_of([i, j, k]: [usize; 3]) -> usize {
    (k * BRICK_CELLS + j) * BRICK_CELLS + i
}

/// An order of facets in which only equal ones are equal.
fn compare(a: &CellFacet, b: &CellFacet) -> std::cmp::Ordering {
    let pairs = a.corners.as_flattened().iter().zip(b.corners.as_flattened());
    pairs.map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
}
