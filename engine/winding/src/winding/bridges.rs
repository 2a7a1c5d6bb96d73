//! Samples that are neighbours on one side of the boundary while a wall or a gap keeps them apart.
//!
//! At the rim of a wall before a cavity a lattice edge enters through one face of the wall and leaves through the side of
//! the cavity. No two faces are opposite there, so the edge counts as no thin wall. Yet its samples join what is apart.

use super::crossings::Hit;
use super::evaluate::Evaluation;
use super::thin::WORDS;
use crate::brick::{point_index, point_position};
use crate::lattice::{Axis, BRICK_CELLS};

/// A lattice edge on which the boundary passes and returns.
struct HiddenEdge {
    axis: Axis,
    lower: usize,
    /// Whether both facets meet at a vertex: then the edge cuts off no more than a convex or a concave edge of the mesh.
    cuts_crease: bool,
}

/// Sets of lattice edges, by axis, a bit for each sample that one begins at.
type EdgeSets = [[u64; WORDS]; 3];

impl Evaluation<'_> {
    /// Whether two neighbouring samples on one side of the boundary have a sheet between them and no way around it: none
    /// along the three other edges of a lattice face of the brick. What lies beyond the brick is not known.
    pub(super) fn bridges_sheet(&self) -> bool {
        let mut edges = Vec::new();
        Axis::ALL.into_iter().for_each(|axis| self.add_hidden_edges(axis, &mut edges));
        let mut hidden = [[0; WORDS]; 3];
        for edge in &edges {
            hidden[edge.axis.index()][edge.lower / 64] |= 1 << (edge.lower % 64);
        }
        let is_bridge = |edge: &HiddenEdge| {
            let upper = edge.lower + step_along(edge.axis);
            !edge.cuts_crease
                && self.is_inside(edge.lower) == self.is_inside(upper)
                && !self.has_way_around(edge, &hidden)
        };
        edges.iter().any(is_bridge)
    }

    fn add_hidden_edges(&self, axis: Axis, edges: &mut Vec<HiddenEdge>) {
        let mut hits = self.evaluator.hits_of_double_edges(axis, self.key);
        hits.sort_unstable_by_key(|hit| (hit.lower, hit.offset));
        for edge in hits.chunk_by(|p, q| p.lower == q.lower) {
            let lower = usize::from(edge[0].lower);
            let mut w = i32::from(self.samples.0[lower]);
            let mut passages = Vec::new();
            for place in edge.chunk_by(|p, q| p.offset == q.offset) {
                let before = w >= 1;
                w += place.iter().map(|hit| hit.jump).sum::<i32>();
                if before != (w >= 1) {
                    passages.push(place);
                }
            }
            if passages.len() > 1 {
                let cuts_crease = passages.len() == 2 && self.meet_at_vertex(passages[0], passages[1]);
                edges.push(HiddenEdge { axis, lower, cuts_crease });
            }
        }
    }

    fn meet_at_vertex(&self, first: &[Hit], second: &[Hit]) -> bool {
        let facet = |hit: &Hit| self.evaluator.facet(hit.facet);
        first.iter().any(|p| second.iter().any(|q| facet(p).shares_vertex(facet(q))))
    }

    fn is_inside(&self, sample: usize) -> bool {
        self.samples.0[sample] >= 1
    }

    fn has_way_around(&self, edge: &HiddenEdge, hidden: &EdgeSets) -> bool {
        let along = step_along(edge.axis);
        let at = point_position(edge.lower);
        let is_clear = |axis: Axis, lower: usize| {
            hidden[axis.index()][lower / 64] >> (lower % 64) & 1 == 0
                && self.is_inside(lower) == self.is_inside(lower + step_along(axis))
        };
        Axis::ALL.into_iter().filter(|&across| across != edge.axis).any(|across| {
            let step = step_along(across);
            // The two edges across begin at `from`, the one beside at `beside`.
            let is_way = |from: usize, beside: usize| {
                is_clear(across, from) && is_clear(across, from + along) && is_clear(edge.axis, beside)
            };
            (at[across.index()] < BRICK_CELLS && is_way(edge.lower, edge.lower + step))
                || (at[across.index()] > 0 && is_way(edge.lower - step, edge.lower - step))
        })
    }
}

/// How far the next sample along an axis is.
fn step_along(axis: Axis) -> usize {
    point_index(Axis::ALL.map(|other| usize::from(other == axis)))
}
