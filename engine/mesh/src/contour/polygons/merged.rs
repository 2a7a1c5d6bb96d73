//! The polygons of a leaf some of whose vertices stand for others ([`super::super::adaptive`]): corners that fall
//! together count once, and what has less than three vanishes.

use super::{Border, Corner, Edge, FacetMaker, Quarter, name};
use crate::brick::SignChanges;
use crate::contour::adaptive::{NumberedEdge, OWN, SharedVertex, turns};
use crate::contour::cut::{BOTH, QuadSplit, Vertex};
use crate::contour::edges::{NO_VERTEX, Quad};
use crate::error::Result;
use crate::lattice::Axis;

impl FacetMaker<'_> {
    /// Some edges of the leaf; `quads` as in [`crate::contour::cells::BrickCells::take_quads`].
    pub(super) fn merged_edges(
        &mut self,
        signs: &SignChanges,
        quads: &[Quad],
        edges: &[NumberedEdge],
    ) -> Result<()> {
        for &(n, axis, low) in edges {
            let Quad { vertices, fraction } = quads.get(n as usize).unwrap_or(&Quad::UNKNOWN);
            let low = low.map(usize::from);
            let (edge, inside) = ((axis, low, *fraction), signs.is_inside(low));
            if vertices.contains(&NO_VERTEX) {
                self.merged_border(edge, vertices, inside)?;
            } else if let Some(own) = &self.neighbours[OWN] {
                let corners = vertices.map(|vertex| own.vertex(vertex.into()));
                self.push_merged(edge, &corners, inside);
            }
        }
        Ok(())
    }

    /// As [`FacetMaker::border`].
    fn merged_border(&mut self, edge: Edge, quad: &[u16; 4], inside: bool) -> Result<()> {
        let (axis, low, _) = edge;
        let place = self.border_place(axis, low)?;
        match self.borders[place] {
            Border::Foreign => return Ok(()),
            Border::Equal(ref quarters) => {
                if let Some(corners) = self.merged_equal(axis, low, quarters, quad) {
                    self.push_merged(edge, &corners, inside);
                    return Ok(());
                }
            }
            Border::Unknown | Border::Uneven => {}
        }
        self.general(edge, inside)
    }

    /// As [`FacetMaker::equal`].
    fn merged_equal(
        &self,
        axis: Axis,
        low: [usize; 3],
        quarters: &[Quarter; 4],
        quad: &[u16; 4],
    ) -> Option<[SharedVertex; 4]> {
        let mut corners = [Default::default(); 4];
        for (n, quarter) in quarters.iter().enumerate() {
            let vertices = self.neighbours[quarter.direction].as_ref()?;
            let vertex = self.among_plain(vertices, axis, low, (n, quarter), quad)?;
            corners[n] = vertices.vertex(vertex);
        }
        Some(corners)
    }

    /// The polygon of four corners: as without a tolerance if none of them is merged, else of those that differ from the
    /// one before; equal ones follow each other.
    fn push_merged(&mut self, edge: Edge, corners: &[SharedVertex; 4], inside: bool) {
        if self.only_wide && !corners.iter().any(|corner| corner.is_wide) {
            return;
        }
        let named = corners.each_ref().map(|corner| name(&mut self.names, corner));
        if !corners.iter().any(|corner| corner.is_merged) {
            let shape = if inside { QuadSplit::Quad } else { QuadSplit::Turned };
            self.cutter.push_around(&self.placed(edge), named, shape, BOTH);
            return;
        }
        let is_new = |n: usize| {
            let (this, before) = (&corners[n], &corners[(n + 3) % 4]);
            (this.leaf, this.number) != (before.leaf, before.number)
        };
        let mut distinct = [Vertex::default(); 4];
        let mut count = 0;
        for (n, corner) in named.into_iter().enumerate() {
            if is_new(n) {
                distinct[count] = corner;
                count += 1;
            }
        }
        if count < 3 {
            // All around the edge is merged into one vertex, or into two. It takes no mark, so that the polygons before and
            // after it are told apart.
            return;
        }
        let mark = self.next_mark();
        let distinct = distinct.map(|(name, position)| (name | mark, position));
        self.push_distinct(edge.0, count, distinct, inside);
    }

    /// The polygon of the first `count` corners.
    fn push_distinct(&mut self, axis: Axis, count: usize, distinct: [Vertex; 4], inside: bool) {
        let [a, b, c, d] = distinct;
        let mut triangle = |a, b, c| self.cutter.push_triangle([a, b, c], inside);
        let cut = match count {
            4 => diagonal(axis, [a.1, b.1, c.1, d.1]),
            _ => Diagonal::Shorter,
        };
        match (count, cut) {
            (4, Diagonal::Shorter) => {
                self.cutter.push(distinct, if inside { QuadSplit::Quad } else { QuadSplit::Turned }, BOTH)
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
    let turns = |n: usize| turns(axis, [corners[(n + 3) % 4], corners[n], corners[(n + 1) % 4]]);
    // Halves of the first diagonal have their tips at the corners 1 and 3.
    match (turns(1) && turns(3), turns(0) && turns(2)) {
        (true, false) => Diagonal::First,
        (false, true) => Diagonal::Second,
        _ => Diagonal::Shorter,
    }
}

/// True if a quadrilateral is to be cut from corner 0 to corner 2: along the shorter of the diagonals that
/// are allowed, along this one if they are equal.
#[inline(always)]
fn shorter(p: &[[f32; 3]; 4], is_first_allowed: bool, is_second_allowed: bool) -> bool {
    let squared =
        |a: [f32; 3], b: [f32; 3]| (0..3).map(|n| (f64::from(a[n]) - f64::from(b[n])).powi(2)).sum::<f64>();
    is_first_allowed && (!is_second_allowed || squared(p[0], p[2]) <= squared(p[1], p[3]))
}

/// Cuts a polygon into triangles by the rules of [`super`].
pub(super) fn triangulate(corners: &[Corner], mut triangle: impl FnMut(usize, usize, usize)) {
    let count = corners.len();
    let extra = corners.iter().position(|c| c.is_extra && c.is_finest);
    let is_plain_quad = count == 4 && corners.iter().all(|c| !c.is_extra);
    let apex = match extra {
        Some(extra) => extra,
        None if is_plain_quad => {
            let finest = |n: usize| corners[n].is_finest || corners[n + 2].is_finest;
            let positions = std::array::from_fn(|n| corners[n].vertex.position);
            usize::from(!shorter(&positions, finest(0), finest(1)))
        }
        None => corners.iter().position(|c| c.is_finest).unwrap_or(0),
    };
    for n in 1..count.saturating_sub(1) {
        triangle(apex, (apex + n) % count, (apex + n + 1) % count);
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
