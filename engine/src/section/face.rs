//! Where the boundary w = 0.5 meets a plane between two layers of samples, in a brick of the finest level.
//!
//! Signs come from the samples and, between layers, from the crossing on the edge across the plane, so they are those of
//! the boundary that the Hermite edges describe. An edge in the plane is one side of a line through a face of four lattice
//! edges: the boundary passes the face from crossing to crossing in a straight line, which is exact where the plane holds
//! the samples or the boundary is flat, and off by the square of the cell elsewhere.

use super::plane::Plane;
use crate::brick::{Brick, Hermite, Ranks, Samples, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS};

/// The boundary in one layer of a brick's cells.
pub(super) struct Layer<'a> {
    samples: &'a Samples,
    signs: SignChanges,
    /// With the ranks of its edges; `None` where there are none, as in interior nodes.
    hermite: Option<(&'a Hermite, [Box<Ranks>; 3])>,
    plane: Plane,
    /// Number of the lower layer of samples, and the plane's distance from it in cells, below 1.
    layer: usize,
    part: f64,
}

impl<'a> Layer<'a> {
    /// Of the brick; the plane lies `height` samples above its first one, 0 to 32. `None` if the brick is uniform.
    pub fn new(brick: &'a Brick, plane: Plane, height: f64) -> Option<Layer<'a>> {
        let Brick::Counts { samples, hermite } = brick else { return None };
        let signs = SignChanges::of(samples);
        let complete = hermite.edges.each_ref().map(Vec::len) == signs.counts();
        let hermite = complete.then(|| (hermite, Axis::ALL.map(|axis| signs.ranks(axis))));
        let layer = (height as usize).min(BRICK_CELLS - 1);
        Some(Layer { samples, signs, hermite, plane, layer, part: height - layer as f64 })
    }

    /// Whether the point of the plane above sample `uv` lies inside.
    pub fn is_inside(&self, uv: [usize; 2]) -> bool {
        let low = self.plane.point(uv, self.layer);
        let is_inside = self.signs.is_inside(low);
        if self.part == 0.0 {
            return is_inside;
        }
        match self.crossing(self.plane.axis, low) {
            Some(at) if self.part >= at => !is_inside,
            _ => is_inside,
        }
    }

    /// Where along the edge from `uv` in the direction of a side, 0..1, the boundary passes the plane. The ends are known
    /// to differ.
    pub fn passage(&self, uv: [usize; 2], side: usize) -> f64 {
        const SOMEWHERE: f64 = 0.5;
        let mut end = uv;
        end[side] += 1;
        let along = self.plane.sides()[side];
        let [a, b] = [uv, end].map(|uv| self.plane.point(uv, self.layer));
        let above = self.plane.point(uv, self.layer + 1);
        // Corners of the passage through the face, as place along the edge and height.
        let lower = self.crossing(along, a).map(|at| [at, 0.0]);
        if self.part == 0.0 {
            return lower.map_or(SOMEWHERE, |[at, _]| at);
        }
        let upper = self.crossing(along, above).map(|at| [at, 1.0]);
        let first = self.crossing(self.plane.axis, a).map(|at| [0.0, at]);
        let last = self.crossing(self.plane.axis, b).map(|at| [1.0, at]);
        let ends = match (lower, upper, first, last) {
            // Two passages: the insides are kept apart, so each leads from an edge in a layer to the one across beside
            // what is inside.
            (Some(lower), Some(upper), Some(first), Some(last)) => {
                let beside = |at_start| if at_start { first } else { last };
                let starts_inside = self.signs.is_inside(a);
                match self.part < first[1].min(last[1]) {
                    true => [lower, beside(starts_inside)],
                    false => [upper, beside(!starts_inside)],
                }
            }
            _ => {
                let mut found = [lower, upper, first, last].into_iter().flatten();
                match (found.next(), found.next()) {
                    (Some(from), Some(to)) => [from, to],
                    _ => return SOMEWHERE,
                }
            }
        };
        let [[x0, y0], [x1, y1]] = ends;
        if y0 == y1 { SOMEWHERE } else { (x0 + (x1 - x0) * (self.part - y0) / (y1 - y0)).clamp(0.0, 1.0) }
    }

    /// Where on the lattice edge from the sample, 0..1, the boundary crosses it, if it does.
    fn crossing(&self, axis: Axis, [i, j, k]: [usize; 3]) -> Option<f64> {
        if self.signs.edges(axis, j, k) >> i & 1 == 0 {
            return None;
        }
        if let Some((hermite, ranks)) = &self.hermite {
            let rank = self.signs.rank(axis, [i, j, k], &ranks[axis.index()]);
            return Some(hermite.edges[axis.index()][rank].fraction());
        }
        let mut end = [i, j, k];
        end[axis.index()] += 1;
        let [a, b] = [[i, j, k], end].map(|ijk| self.samples.value(ijk).clamp(0.0, 1.0));
        Some(((0.5 - a) / (b - a)).clamp(0.0, 1.0))
    }
}
