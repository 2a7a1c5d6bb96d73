//! The area that a point of a cloud stands for.

use crate::lattice::dot;

/// From what half of the square of a neighbour's distance, in squares of the distance of the farthest corner, the neighbour does not
/// bound a cell: that is 2, and a little for rounding.
const WELL_BEYOND: f64 = 2.000_001;

/// The area of the part of the tangent plane that is nearer to a point than to its neighbours (the Voronoi cell
/// among them, Barill et al. 2018, section 6), within a square that reaches as far as the neighbours do. On a
/// regular grid that is the grid's cell; over scattered points the cells fill the plane. `around` are the ways
/// to the neighbours, `normal` has length 1.
pub(super) fn cell_area(normal: [f64; 3], around: impl Iterator<Item = [f64; 3]>, reach: f64) -> f64 {
    let (u, v) = plane_axes(normal);
    let mut cell = vec![[-reach, -reach], [reach, -reach], [reach, reach], [-reach, reach]];
    let mut kept = Vec::with_capacity(16);
    let farthest =
        |cell: &[[f64; 2]]| cell.iter().fold(0.0f64, |most, p| most.max(p[0] * p[0] + p[1] * p[1]));
    let mut farthest_corner = farthest(&cell);
    for way in around {
        let seen = [dot(way, u), dot(way, v)];
        let half = 0.5 * (seen[0] * seen[0] + seen[1] * seen[1]);
        // Right above or below there is no direction to divide along, and whose middle lies beyond all corners divides nothing.
        if half > 0.0 && half < WELL_BEYOND * farthest_corner {
            cut(&cell, &mut kept, seen, half);
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
        let flat = cell_area([0.0, 0.0, 1.0], around().map(|[x, y]| [2.0 * x, 3.0 * y, 0.0]), 9.0);
        assert!((flat - 6.0).abs() < 1e-12);
        // The same in the plane x = z, and a point behind, which counts for nothing.
        let s = 0.5f64.sqrt();
        let tilted = around().map(|[x, y]| [2.0 * x * s, 3.0 * y, 2.0 * x * s]);
        let area = cell_area([-s, 0.0, s], tilted.chain([[-s, 0.0, s]]), 9.0);
        assert!((area - 6.0).abs() < 1e-9, "{area}");
        assert_eq!(cell_area([1.0, 0.0, 0.0], std::iter::empty(), 2.0), 16.0);
    }
}
