//! Sign-changing edges as merging sees them, and the corners of the polygons around them.

use super::super::topology::{SQUARE, cell_around};
use super::crossings::{FROZEN, SignChangeEdge};
use crate::lattice::Axis;

/// The direction of the leaf itself.
pub(in super::super) const OWN: usize = 13;
/// Stands for the direction of what several leaves have.
pub(super) const ACROSS: usize = 27;

/// A sign-changing edge of a leaf.
pub(super) struct Edge {
    pub axis: Axis,
    /// Its lower sample.
    pub low: [u8; 3],
    /// As [`SignChangeEdge::vertices`].
    pub vertices: [u32; 4],
}

/// A corner of a polygon.
#[derive(Clone, Copy, Default)]
pub(super) struct Corner {
    /// Leaf, as a direction, and what tells its vertices apart.
    pub name: (usize, bool, u32),
    pub position: [f32; 3],
    /// The level of its node, 0 for a cell.
    pub level: u8,
}

impl Edge {
    pub(super) fn of(crossing: &SignChangeEdge) -> Edge {
        Edge { axis: crossing.axis, low: crossing.low, vertices: crossing.vertices }
    }

    /// The cell in a quadrant, from -1 to 32 along each axis.
    pub(super) fn cell(&self, quadrant: usize) -> [i32; 3] {
        cell_around(self.axis, self.low.map(i32::from), SQUARE[quadrant])
    }

    /// Whether a cell around it is frozen or beyond the leaf.
    pub(super) fn is_outer(&self) -> bool {
        self.vertices.iter().any(|vertex| *vertex >= FROZEN)
    }
}

/// Whether a triangle runs counter-clockwise, seen from the upper end of `axis`.
#[inline]
pub(in super::super) fn turns(axis: Axis, [p, q, r]: [[f32; 3]; 3]) -> bool {
    let (u, v) = axis.others();
    // The way from one corner to the next, seen from there.
    let way = |from: [f32; 3], to: [f32; 3], axis: Axis| {
        f64::from(to[axis.index()]) - f64::from(from[axis.index()])
    };
    way(p, q, u) * way(q, r, v) - way(p, q, v) * way(q, r, u) > 0.0
}
