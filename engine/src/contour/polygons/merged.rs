//! The polygons of a leaf some of whose vertices stand for others ([`super::super::adaptive`]): corners that fall
//! together count once, and what has less than three vanishes.

use super::{Border, Maker, Quarter};
use crate::brick::SignChanges;
use crate::contour::adaptive::{OWN, Shared, turns};
use crate::contour::cut::{BOTH, Shape, Vertex};
use crate::contour::edges::{NO_VERTEX, Quad};
use crate::contour::later::Names;
use crate::contour::vertices::LeafVertices;
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS};

/// Which leaf a vertex is of, and its number there.
type Name = (u32, u32);

impl Maker<'_> {
    /// All edges of the leaf, in the order of [`crate::contour::cells::BrickCells::take_quads`].
    pub(super) fn merged_rows(&mut self, signs: &SignChanges, quads: &[Quad]) -> Result<()> {
        let mut edges = Vec::with_capacity(quads.len());
        for axis in Axis::ALL {
            signs.for_edges(axis, |low| edges.push((axis, low)));
        }
        for (n, &(axis, low)) in edges.iter().enumerate() {
            let quad = &quads.get(n).unwrap_or(&Quad::UNKNOWN).vertices;
            let inside = signs.is_inside(low);
            if quad.contains(&NO_VERTEX) {
                self.merged_border(axis, low, quad, inside)?;
            } else if let Some(own) = &self.neighbours[OWN]
                && quad.iter().any(|vertex| *vertex != quad[0])
            {
                let corners = quad.map(|vertex| corner(&mut self.names, own, vertex.into()));
                self.push_distinct(axis, corners, inside);
            }
        }
        Ok(())
    }

    /// As [`Maker::border`].
    fn merged_border(&mut self, axis: Axis, low: [usize; 3], quad: &[u16; 4], inside: bool) -> Result<()> {
        let place = self.border_place(axis, low)?;
        match self.borders[place] {
            Border::Foreign => return Ok(()),
            Border::Equal(quarters) => {
                if let Some(corners) = self.merged_equal(low, &quarters, quad) {
                    self.push_distinct(axis, corners, inside);
                    return Ok(());
                }
            }
            Border::Unknown | Border::Uneven => {}
        }
        self.general((axis, low, 0), inside)
    }

    /// The corners of a polygon among plain cells without ambiguous faces of leaves of this level; `quad` as in
    /// [`crate::contour::cells::BrickCells::take_quads`].
    fn merged_equal(
        &mut self,
        low: [usize; 3],
        quarters: &[Quarter; 4],
        quad: &[u16; 4],
    ) -> Option<[(Name, Vertex); 4]> {
        let mut corners = [Default::default(); 4];
        for (n, quarter) in quarters.iter().enumerate() {
            let vertices = self.neighbours[quarter.direction].as_ref()?;
            let vertex = if quad[n] == NO_VERTEX {
                let cell = std::array::from_fn(|a| (low[a] + quarter.step[a]) % BRICK_CELLS);
                // A face that is cut twice may be split.
                vertices.cells.plain(cell).filter(|(kind, _)| kind.loops().ambiguous == 0)?;
                vertices.cells.plain_vertex(cell, quarter.edge)?
            } else {
                u32::from(quad[n])
            };
            corners[n] = corner(&mut self.names, vertices, vertex);
        }
        Some(corners)
    }

    /// The polygon of those of four corners that differ from the one before; equal ones follow each other.
    fn push_distinct(&mut self, axis: Axis, corners: [(Name, Vertex); 4], inside: bool) {
        let mut distinct = [Vertex::default(); 4];
        let mut count = 0;
        for n in 0..4 {
            if corners[n].0 != corners[(n + 3) % 4].0 {
                distinct[count] = corners[n].1;
                count += 1;
            }
        }
        let [a, b, c, d] = distinct;
        let mut triangle = |a, b, c| self.cutter.push_triangle([a, b, c], inside);
        match (count, diagonal(axis, distinct.map(|corner| corner.1))) {
            (4, Diagonal::Shorter) => {
                self.cutter.push(distinct, if inside { Shape::Quad } else { Shape::Turned }, BOTH)
            }
            (4, Diagonal::First) => {
                triangle(a, b, c);
                triangle(a, c, d);
            }
            (4, Diagonal::Second) => {
                triangle(b, c, d);
                triangle(b, d, a);
            }
            (3, _) => triangle(a, b, c),
            _ => {}
        }
    }
}

/// The corner that stands for a vertex, by the number with which its cell was made.
fn corner(names: &mut Names, vertices: &LeafVertices, vertex: u32) -> (Name, Vertex) {
    let Shared { leaf, number, position } = vertices.vertex(vertex);
    ((leaf, number), (names.of(leaf, number), position))
}

/// Where a quadrilateral is cut.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Diagonal {
    Shorter,
    /// From corner 0 to corner 2.
    First,
    Second,
}

/// Where a quadrilateral around an edge along `axis` is cut so that no half is folded back: seen along the edge its
/// corners lie in one quadrant each, so that at least one diagonal lies within it.
fn diagonal(axis: Axis, corners: [[f32; 3]; 4]) -> Diagonal {
    let turns = |n: usize| turns(axis, [n + 3, n, n + 1].map(|n| corners[n % 4]));
    // Halves of the first diagonal have their tips at the corners 1 and 3.
    match (turns(1) && turns(3), turns(0) && turns(2)) {
        (true, false) => Diagonal::First,
        (false, true) => Diagonal::Second,
        _ => Diagonal::Shorter,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dented_quadrilateral_is_cut_from_its_dent() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        for (dented, expected) in
            [Diagonal::First, Diagonal::Second, Diagonal::First, Diagonal::Second].into_iter().enumerate()
        {
            for axis in Axis::ALL {
                let place = |square: [[f32; 2]; 4]| {
                    let (u, v) = axis.others();
                    square.map(|[x, y]| {
                        let mut corner = [7.0; 3];
                        (corner[u.index()], corner[v.index()]) = (x, y);
                        corner
                    })
                };
                assert_eq!(diagonal(axis, place(square)), Diagonal::Shorter);
                let mut dent = square;
                let opposite = square[(dented + 2) % 4];
                dent[dented] = std::array::from_fn(|a| 1.0 + 0.4 * (opposite[a] - 1.0));
                assert_eq!(diagonal(axis, place(dent)), expected);
            }
        }
    }
}
