//! The area that a point of a cloud stands for.

use crate::lattice::dot;

/// What rounding may make of the distance of a line, as a part of its square: whose line lies so much beyond all corners bounds no
/// cell.
const WELL_BEYOND: f64 = 1.000_001;

/// The way from a point to a neighbour.
pub(super) struct NeighbourWay {
    pub way: [f64; 3],
    /// The neighbour's normal, if an edge of the surface lies between them.
    pub face: Option<[f64; 3]>,
}

/// The area of the part of the tangent plane that is nearer to a point than to its neighbours (the Voronoi cell
/// among them, Barill et al. 2018, section 6), within a square that reaches as far as the neighbours do. On a
/// regular grid that is the grid's cell; over scattered points the cells fill the plane. `around` are the
/// neighbours, `normal` has length 1.
///
/// Of a neighbour its place in the plane counts, since its height is mostly noise. One beyond an edge is on another face, which
/// the cell does not reach: it ends where the neighbour's tangent plane begins.
pub(super) fn cell_area(normal: [f64; 3], around: impl Iterator<Item = NeighbourWay>, reach: f64) -> f64 {
    let (u, v) = plane_axes(normal);
    let mut cell = vec![[-reach, -reach], [reach, -reach], [reach, reach], [-reach, reach]];
    let mut kept = Vec::with_capacity(16);
    let farthest =
        |cell: &[[f64; 2]]| cell.iter().fold(0.0f64, |most, p| most.max(p[0] * p[0] + p[1] * p[1]));
    let mut farthest_corner = farthest(&cell);
    for NeighbourWay { way, face } in around {
        let (direction, limit) = match face {
            None => {
                let seen = [dot(way, u), dot(way, v)];
                (seen, 0.5 * (seen[0] * seen[0] + seen[1] * seen[1]))
            }
            Some(other) => {
                let height = dot(way, other);
                let outward = height.signum();
                ([outward * dot(other, u), outward * dot(other, v)], height.abs())
            }
        };
        let square = direction[0] * direction[0] + direction[1] * direction[1];
        // Right above or below there is no direction to divide along, and what lies beyond all corners divides nothing.
        if square > 0.0 && limit * limit < WELL_BEYOND * square * farthest_corner {
            cut(&cell, &mut kept, direction, limit);
            std::mem::swap(&mut cell, &mut kept);
            farthest_corner = farthest(&cell);
        }
    }
    let corners = cell.iter().zip(cell.iter().cycle().skip(1));
    0.5 * corners.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>()
}

/// Two directions of length 1 that span the plane.
fn plane_axes(n: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    // Across the axis that the normal is farthest from.
    let axis = (0..3).fold(0, |best, a| if n[a].abs() < n[best].abs() { a } else { best });
    let mut u = [0.0; 3];
    u[(axis + 1) % 3] = -n[(axis + 2) % 3];
    u[(axis + 2) % 3] = n[(axis + 1) % 3];
    let length = dot(u, u).sqrt();
    let u = u.map(|c| c / length);
    (u, [n[1] * u[2] - n[2] * u[1], n[2] * u[0] - n[0] * u[2], n[0] * u[1] - n[1] * u[0]])
}

/// Keeps the part of a convex polygon where x·direction ≤ limit.
fn cut(polygon: &[[f64; 2]], kept: &mut Vec<[f64; 2]>, direction: [f64; 2], limit: f64) {
    let beyond = |p: [f64; 2]| p[0] * direction[0] + p[1] * direction[1] - limit;
    kept.clear();
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (a, b) = (beyond(p), beyond(q));
        if a <= 0.0 {
            kept.push(p);
        }
        if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
            let share = a / (a - b);
            kept.push([p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_grids() {
        let steps = || (-1..=1).flat_map(|i| (-1..=1).map(move |j| [f64::from(i), f64::from(j)]));
        let around = || steps().filter(|s| *s != [0.0; 2]);
        let smooth = |way| NeighbourWay { way, face: None };
        let flat = cell_area([0.0, 0.0, 1.0], around().map(|[x, y]| smooth([2.0 * x, 3.0 * y, 0.0])), 9.0);
        assert!((flat - 6.0).abs() < 1e-12);
        // The same in the plane x = z, and a point behind, which counts for nothing.
        let s = 0.5f64.sqrt();
        let tilted = around().map(|[x, y]| [2.0 * x * s, 3.0 * y, 2.0 * x * s]);
        let area = cell_area([-s, 0.0, s], tilted.chain([[-s, 0.0, s]]).map(smooth), 9.0);
        assert!((area - 6.0).abs() < 1e-9, "{area}");
        assert_eq!(cell_area([1.0, 0.0, 0.0], std::iter::empty(), 2.0), 16.0);
        // A column of the grid stands on the next face, beyond the edge at x = 0.7, wherever its points are there.
        for (below, sign) in [(0.1, 1.0), (2.0, 1.0), (1.0, -1.0)] {
            let folded = around().map(|[x, y]| match x > 0.0 {
                true => NeighbourWay { way: [0.7, 3.0 * y, -sign * below], face: Some([sign, 0.0, 0.0]) },
                false => smooth([2.0 * x, 3.0 * y, 0.0]),
            });
            assert!((cell_area([0.0, 0.0, 1.0], folded, 9.0) - 1.7 * 3.0).abs() < 1e-12);
        }
    }
}
