//! Where one vertex may stand for a part of the surface.
//!
//! The measure is a length. Let `d` be a direction that all normals of the part face, so that it is a height field
//! along `d`. Suppose that along `d` the vertex is within τ of the tangent plane at every point of the part.
//!
//! Then the part is within τ, along `d`, of the cone from the vertex over the part's border. For with `g(r)` the
//! height above the vertex along a ray and `|g − r·g'| ≤ τ`, the slope `g/r` changes by no more than `∫τ/r²` on the
//! way from `r` to the border.
//!
//! What is left is the border, whose planes the vertices on both of its sides fit. The planes known are those at the
//! crossings of the lattice; what the surface does within a cell is not seen.
//!
//! Without the direction the planes would say little: all planes of a thin fin pass close to a vertex at its foot.

use super::super::constrained_qef::{cell, minimisers};
use super::super::lanes::GROUP;
use super::super::qef::{Qef, Vector};
use super::super::solve::LoopGroup;
use super::super::symmetric::dot;
use super::crossings::SignChangeEdge;
use super::parts::Planes;
use crate::lattice::{BRICK_CELLS, Octant};
use crate::wide::{dispatch, level};

/// Least cosine of the angle between a normal and the common direction: what is steeper is no height field that the
/// planes of a few crossings would tell.
const LEAST_COSINE: f64 = 0.1;
/// With all normals this close to their sum, 60°, no better direction is looked for.
const GOOD_COSINE: f64 = 0.5;

/// A node of a leaf's cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellNode {
    /// Its first cell.
    corner: [u8; 3],
    /// 2 to this power cells an axis.
    pub level: u8,
}

impl CellNode {
    /// The node of a level that holds a cell.
    pub(super) fn around(cell: [usize; 3], level: u8) -> CellNode {
        CellNode { corner: cell.map(|c| (c >> level << level) as u8), level }
    }

    /// Its first cell.
    pub(super) fn corner(&self) -> [usize; 3] {
        self.corner.map(usize::from)
    }

    pub(super) fn size(&self) -> f64 {
        f64::from(1u32 << self.level)
    }

    /// A point of the node's unit cube in cells of the leaf.
    pub(super) fn point(&self, at: Vector) -> Vector {
        std::array::from_fn(|a| f64::from(self.corner[a]) + at[a] * self.size())
    }
}

impl Qef {
    /// Adds the plane of a crossing, with the leaf as the unit cube.
    pub(super) fn add_crossing(&mut self, crossing: &SignChangeEdge) {
        self.add(crossing.point.map(|c| c / BRICK_CELLS as f64), crossing.normal);
    }

    /// Adds all planes of another.
    pub(super) fn add_all(&mut self, other: &Qef) {
        for (sum, more) in self.matrix.0.iter_mut().zip(&other.matrix.0) {
            *sum += more;
        }
        for a in 0..3 {
            self.rhs[a] += other.rhs[a];
            self.point_sum[a] += other.point_sum[a];
            self.normal_sum[a] += other.normal_sum[a];
        }
        self.constant += other.constant;
        self.count += other.count;
    }

    /// The same planes, the unit cube being a node of the leaf.
    pub(super) fn within(&self, node: &CellNode) -> Qef {
        let scale = BRICK_CELLS as f64 / node.size();
        self.about(node.point([0.5; 3]).map(|c| c / BRICK_CELLS as f64 - 0.5), scale)
    }

    /// The same planes, the unit cube being the parent of the one that is its child `octant`.
    pub(super) fn within_parent(&self, octant: Octant) -> Qef {
        self.about(octant.offset().map(|upper| 0.5 - upper as f64), 0.5)
    }

    /// The same planes, the unit cube being one about `centre`, counted from the centre of the present one, of which
    /// an edge is 1/`scale` long.
    fn about(&self, centre: Vector, scale: f64) -> Qef {
        let moved = self.matrix.times(centre);
        Qef {
            matrix: self.matrix,
            rhs: std::array::from_fn(|a| (self.rhs[a] - moved[a]) * scale),
            point_sum: std::array::from_fn(|a| (self.point_sum[a] - self.count * centre[a]) * scale),
            normal_sum: self.normal_sum,
            constant: (self.constant - 2.0 * dot(self.rhs, centre) + dot(moved, centre)) * scale * scale,
            count: self.count,
        }
    }

    /// Mean of the squared distances from the planes, of a point of the unit cube.
    fn mean_square(&self, at: Vector) -> f64 {
        let x = at.map(|c| c - 0.5);
        (dot(x, self.matrix.times(x)) - 2.0 * dot(x, self.rhs) + self.constant) / self.count
    }
}

/// For up to [`GROUP`] parts of the surface, each as the sums of its planes in a cube, `size` cells wide, the point
/// of the cube that fits them best, in the unit cube; `None` if on average it misses them by more than `tolerance`,
/// in cells. It stays `margin` cells away from the cube's faces.
pub(super) fn best_points(
    group: &mut LoopGroup,
    parts: &[Qef],
    (size, margin): (f64, f64),
    tolerance: f64,
) -> [Option<Vector>; GROUP] {
    let mut best = [None; GROUP];
    let margin = margin / size;
    for (lane, sums) in parts.iter().enumerate() {
        group.set(lane, sums);
    }
    let points = dispatch!(level(), simd => {
        let solved = group.solve(simd, parts.len(), margin, tolerance);
        let mut points = solved.points();
        if solved.left != 0 {
            let others = minimisers(&solved.terms, cell(margin));
            for lane in (0..parts.len()).filter(|lane| solved.left >> lane & 1 == 1) {
                points[lane] = others[lane];
            }
        }
        points
    });
    for (lane, sums) in parts.iter().enumerate() {
        let missed = sums.mean_square(points[lane]).max(0.0).sqrt() * size;
        // Some plane is missed by more than the mean. A hundredth for rounding.
        best[lane] = (missed <= 1.01 * tolerance).then_some(points[lane]);
    }
    best
}

/// Whether a vertex at `point`, in cells of the leaf, may stand for the crossings.
pub(super) fn fits<'a, I: Iterator<Item = &'a SignChangeEdge>>(
    point: Vector,
    normals: Vector,
    crossings: impl Fn() -> I,
    tolerance: f64,
) -> bool {
    let Some(up) = common_direction(normals, || crossings().map(|c| c.normal)) else { return false };
    crossings().all(|crossing| {
        let from: Vector = std::array::from_fn(|a| point[a] - crossing.point[a]);
        dot(from, crossing.normal).abs() <= tolerance * dot(crossing.normal, up)
    })
}

/// The same for planes of which no more is known than where they lie; `point` is counted from the root's first
/// sample.
pub(super) fn fits_planes(point: Vector, normals: Vector, planes: &Planes, tolerance: f64) -> bool {
    let Some(up) = common_direction(normals, || planes.normals()) else { return false };
    planes.missed(point).all(|(normal, missed)| missed <= tolerance * dot(normal, up))
}

/// A direction that all normals face; `sum` is their sum.
fn common_direction<I: Iterator<Item = Vector>>(sum: Vector, normals: impl Fn() -> I) -> Option<Vector> {
    let mut best = (LEAST_COSINE, None);
    let mut consider = |d: Vector| {
        let length = dot(d, d).sqrt();
        if length > 0.0 {
            let d = d.map(|c| c / length);
            // Most directions are ruled out by one of the first normals.
            let mut least = f64::INFINITY;
            let is_better = normals().all(|normal| {
                least = least.min(dot(normal, d));
                least > best.0
            });
            if is_better {
                best = (least, Some(d));
            }
        }
        best
    };
    if consider(sum).0 < GOOD_COSINE {
        for n in (0..27).filter(|&n| n != 13) {
            consider([n % 3, n / 3 % 3, n / 9].map(|c| f64::from(c - 1)));
        }
    }
    best.1
}
