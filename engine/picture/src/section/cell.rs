//! The boundary w = 0.5 within a square of a brick's lattice in a plane: which of its points lie inside.
//!
//! Used where a picture, or a finer lattice, looks between the corners of a square.

use super::arc::{ArcEnd, BoundaryArc};
use super::face::{Layer, PlaneCrossing};

/// Of two opposite corners inside each has a part of its own.
const PARTS_MAX: usize = 2;

/// A square with the boundary in it, in its own edges from its lower left corner.
pub(super) struct SectionCell {
    /// Corners counter-clockwise from the lower left one.
    inside: [bool; 4],
    /// Polygons of what lies inside, and how many of their corners are the boundary's, first of all.
    parts: Vec<(Vec<[f64; 2]>, usize)>,
    /// The largest bound of its passages, in edges.
    bound: f64,
}

/// Corners counter-clockwise from the lower left one.
const CORNERS: [[usize; 2]; 4] = [[0, 0], [1, 0], [1, 1], [0, 1]];
/// Edges by their lower corner and side, each from its corner to the next one counter-clockwise.
const EDGES: [([usize; 2], usize); 4] = [([0, 0], 0), ([1, 0], 1), ([0, 1], 0), ([0, 0], 1)];

/// Pairs of edges that stretches of the boundary lead from and to, the inside to their left. Of two opposite corners each
/// is kept for itself.
pub(super) fn stretches(inside: [bool; 4]) -> impl Iterator<Item = (usize, usize)> {
    (0..4).filter(move |&n| inside[n] && !inside[(n + 1) % 4]).map(move |leaving| {
        // Back along the corners inside to where they begin.
        let mut entering = (leaving + 3) % 4;
        while inside[entering] {
            entering = (entering + 3) % 4;
        }
        (leaving, entering)
    })
}

impl SectionCell {
    /// The square from sample `uv` of a layer.
    pub fn new(layer: &Layer, uv: [usize; 2]) -> SectionCell {
        let at = |corner: [usize; 2]| [uv[0] + corner[0], uv[1] + corner[1]];
        let inside = CORNERS.map(|corner| layer.is_inside(at(corner)));
        let mut cell = SectionCell { inside, parts: Vec::new(), bound: 0.0 };
        let pairs: Vec<(usize, usize)> = stretches(inside).take(PARTS_MAX).collect();
        for &(leaving, entering) in &pairs {
            let [from, to] = [leaving, entering].map(|edge| {
                let (corner, side) = EDGES[edge];
                let PlaneCrossing { at: along, normal, bound } = layer.passage(at(corner), side);
                cell.bound = cell.bound.max(bound);
                let mut place = corner.map(|c| c as f64);
                place[side] += along;
                ArcEnd { at: place, normal }
            });
            let arc = if pairs.len() == 1 {
                BoundaryArc::new([0.0; 2], from, to)
            } else {
                BoundaryArc::straight(from, to)
            };
            let mut polygon = vec![from.at];
            polygon.extend(arc.corners());
            polygon.push(to.at);
            let of_boundary = polygon.len();
            let behind = (1..=4).map(|n| (entering + n) % 4);
            let count = (leaving + 4 - entering) % 4;
            polygon.extend(behind.take(count).map(|corner| CORNERS[corner].map(|c| c as f64)));
            cell.bound = cell.bound.max(arc.area_bound());
            cell.parts.push((polygon, of_boundary));
        }
        cell
    }

    /// Whether a point within the square lies inside.
    pub fn is_inside(&self, point: [f64; 2]) -> bool {
        if self.parts.is_empty() {
            return self.inside[0];
        }
        self.parts.iter().any(|(polygon, _)| is_in(polygon, point))
    }

    /// Where the boundary passes a line in the square from a point to the right (0) or upward (1), at most `length` away:
    /// how far along it, with the boundary's normal; by how much it may be off, too. The line's ends lie on two sides.
    pub fn passage(&self, from: [f64; 2], side: usize, length: f64) -> PlaneCrossing {
        for (polygon, of_boundary) in &self.parts {
            for pair in polygon[..*of_boundary].windows(2) {
                let [[a, da], [b, db]] =
                    [pair[0], pair[1]].map(|p| [p[side] - from[side], p[1 - side] - from[1 - side]]);
                if (da > 0.0) == (db > 0.0) {
                    continue;
                }
                let along = (a + (b - a) * da / (da - db)) / length;
                if (-1e-9..=1.0 + 1e-9).contains(&along) {
                    // To the right of the direction of the boundary.
                    let run = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
                    let size = (run[0] * run[0] + run[1] * run[1]).sqrt();
                    let normal = Some([run[1] / size, -run[0] / size, 0.0]);
                    return PlaneCrossing { at: along.clamp(0.0, 1.0), normal, bound: self.bound / length };
                }
            }
        }
        PlaneCrossing { bound: 0.5f64.max(self.bound / length), ..PlaneCrossing::UNKNOWN }
    }
}

/// Whether a polygon holds a point.
fn is_in(polygon: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let mut is_in = false;
    for (n, [bx, by]) in polygon.iter().enumerate() {
        let [ax, ay] = polygon[(n + polygon.len() - 1) % polygon.len()];
        if (ay > y) != (*by > y) && x < ax + (bx - ax) * (y - ay) / (by - ay) {
            is_in = !is_in;
        }
    }
    is_in
}

impl Layer {
    /// Whether the point of the plane at `uv`, in samples from the brick's first one, lies inside. At samples and on the
    /// edges between them it is as [`Layer::is_inside`] and [`Layer::passage`] say, so that bricks that meet there agree.
    pub fn is_inside_at(&self, uv: [f64; 2]) -> bool {
        let low = uv.map(|c| c as usize);
        let part: [f64; 2] = std::array::from_fn(|n| uv[n] - low[n] as f64);
        match [part[0] > 0.0, part[1] > 0.0] {
            [false, false] => self.is_inside(low),
            [true, true] => self.cell(low).map_or_else(|| self.is_inside(low), |cell| cell.is_inside(part)),
            [is_along, _] => {
                let side = usize::from(!is_along);
                let mut end = low;
                end[side] += 1;
                let [first, last] = [low, end].map(|uv| self.is_inside(uv));
                if first == last { first } else { (part[side] < self.passage(low, side).at) == first }
            }
        }
    }

    /// The square from sample `uv`, if the boundary passes it.
    pub fn cell(&self, uv: [usize; 2]) -> Option<SectionCell> {
        let inside = CORNERS.map(|[u, v]| self.is_inside([uv[0] + u, uv[1] + v]));
        (inside != [inside[0]; 4]).then(|| SectionCell::new(self, uv))
    }
}
