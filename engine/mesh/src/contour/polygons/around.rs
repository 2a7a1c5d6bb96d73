//! The polygon of any edge: cells of several levels around it, some with extra vertices between them, or merged.

use super::{Corner, FacetMaker, Polygon, direction};
use crate::contour::adaptive::SharedVertex;
use crate::contour::face_vertices::{edge_key, face_key};
use crate::contour::leaves::{LeafNeighbour, broken, cell_in, direction_index};
use crate::contour::topology::{SQUARE, cell_around, edge_index};
use crate::contour::vertices::LeafVertices;
use crate::error::Result;
use crate::lattice::{Axis, NodeKey, Units};

/// One of the four cells around an edge.
struct Quadrant<'a> {
    key: NodeKey,
    cell: [usize; 3],
    vertices: &'a LeafVertices,
}

impl<'a> FacetMaker<'a> {
    /// The leaf in whose cells `cell` lies and its place among the directions.
    fn neighbour(&self, cell: [i32; 3]) -> Result<(u32, usize)> {
        let n = direction_index(direction(cell));
        let (LeafNeighbour::Same(leaf) | LeafNeighbour::Coarser(leaf)) = self.around[n] else {
            return Err(broken(self.key));
        };
        Ok((leaf, n))
    }

    /// The cell of the tree that holds `cell`; its neighbour's cells must have been fetched.
    fn quadrant(&self, cell: [i32; 3]) -> Result<Quadrant<'_>> {
        let (leaf, n) = self.neighbour(cell)?;
        let vertices = self.neighbours[n].as_ref().ok_or_else(|| broken(self.key))?;
        let key = self.field.leaves.get(leaf).key;
        Ok(Quadrant { key, cell: cell_in(key, self.key, cell), vertices })
    }

    /// The corners of an edge's polygon, counter-clockwise seen from the edge's upper end.
    pub(super) fn polygon(&mut self, axis: Axis, low: [usize; 3]) -> Result<Polygon> {
        let bits = self.key.spacing_bits();
        let lower: Units = std::array::from_fn(|a| self.key.base()[a] + ((low[a] as i32) << bits));
        let places = SQUARE.map(|quadrant| cell_around(axis, low.map(|c| c as i32), quadrant));
        for place in places {
            let (leaf, n) = self.neighbour(place)?;
            self.fetch(leaf, n)?;
        }
        let [a, b, c, d] = places.map(|place| self.quadrant(place));
        let quadrants = [a?, b?, c?, d?];
        let mut vertices = [SharedVertex::default(); 4];
        for (n, [qu, qv]) in SQUARE.into_iter().enumerate() {
            let this = &quadrants[n];
            let key = edge_key(relative(lower, this.key, this.cell), axis, self.key.level());
            let vertex = this.vertices.cells.vertex(this.cell, edge_index(axis, 1 - qu, 1 - qv), key);
            vertices[n] = this.vertices.vertex(vertex.ok_or_else(|| broken(this.key))?);
        }
        // A cell in two quadrants, or cells that have one vertex.
        let name = |n: usize| (vertices[n].leaf, vertices[n].number);
        let is_same = |a: usize, b: usize| name(a) == name(b);
        let mut polygon = Polygon::default();
        for n in 0..4 {
            let (before, after) = ((n + 3) % 4, (n + 1) % 4);
            let this = &quadrants[n];
            if !is_same(before, n) {
                polygon.push(Corner {
                    vertex: vertices[n],
                    is_finest: this.key.level() == self.key.level(),
                    is_extra: false,
                });
            }
            if !is_same(n, after)
                && let Some((owner, vertex)) = self.extra(axis, n, this, &quadrants[after], lower)
            {
                polygon.push(Corner {
                    vertex,
                    is_finest: owner.key.level() == self.key.level(),
                    is_extra: true,
                });
            }
        }
        Ok(polygon)
    }

    /// The extra vertex on the face between quadrant `n` and the next, with the leaf that owns the face.
    fn extra<'q>(
        &self,
        axis: Axis,
        n: usize,
        this: &'q Quadrant<'a>,
        after: &'q Quadrant<'a>,
        lower: Units,
    ) -> Option<(&'q Quadrant<'a>, SharedVertex)> {
        let (u, v) = axis.others();
        // Quadrants 0, 1 and 2, 3 differ along u, the others along v; 0 → 1 and 1 → 2 go up.
        let across = if n.is_multiple_of(2) { u } else { v };
        let (below, above) = if n < 2 { (this, after) } else { (after, this) };
        let owner = if below.key.level() > above.key.level() { below } else { above };
        let mut corner = owner.cell;
        corner[across.index()] += usize::from(std::ptr::eq(owner, below));
        let key = edge_key(relative(lower, owner.key, corner), axis, self.key.level());
        owner.vertices.extra(face_key(across, corner), key).map(|vertex| (owner, vertex))
    }
}

/// A position minus the lattice point (i, j, k) of a leaf.
#[inline]
fn relative(at: Units, key: NodeKey, point: [usize; 3]) -> Units {
    std::array::from_fn(|a| at[a] - key.base()[a] - ((point[a] as i32) << key.spacing_bits()))
}
