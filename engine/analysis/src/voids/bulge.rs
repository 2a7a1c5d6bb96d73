//! What a smooth surface has beyond the polygon that stands for it.
//!
//! Corners stand on the surface and so does the crossing within the polygon. Of the quadratic forms that pass them all the
//! one that bends least is integrated over the polygon's triangles, exactly for its volume.

use crate::contour::EdgeFacet;
use crate::lattice::{dot, frame, minus, solved_positive};

/// The points are of one smooth surface if the form passes them within this share of the polygon's extent.
const MISS: f64 = 0.02;
/// How high they may stand above the polygon's plane through the crossing, as a share of its extent.
const HIGH: f64 = 0.3;
/// How steep the form may be in the middle of a side: steeper ones are of creases that the corners miss.
const STEEPEST: f64 = 0.6;
/// Triangles, and corners, of a polygon at most.
const MOST: usize = 16;
/// What terms of the form weigh beside the points: as little as suffices to choose among forms that pass these.
const LEAST: f64 = 1e-4;
/// Slopes cost little, and what bends both ways alike costs as much as a twist does.
const WEIGHTS: [f64; 5] = [0.01, 0.01, 1.0, 2.0, 1.0];

/// A place in the frame of a polygon around the crossing, in extents of the polygon: two along its plane, and height.
type Local = [f64; 3];

/// The volume between the triangles of a polygon and the surface, positive where the surface lies beyond them on the side
/// of `vector`, the sum of their vectors of area; and the area of the surface. `None` if the points are not those of a
/// smooth one.
pub(super) fn bulge(polygon: &[&EdgeFacet], crossing: [f64; 3], vector: [f64; 3]) -> Option<(f64, f64)> {
    let square = dot(vector, vector).sqrt();
    let extent = square.sqrt();
    if square <= 0.0 {
        return None;
    }
    let normal = vector.map(|c| c / square);
    let [u, v] = frame(normal);
    let local = |corner: [f32; 3]| {
        let away = minus(corner.map(f64::from), crossing);
        [dot(away, u), dot(away, v), dot(away, normal)].map(|c| c / extent)
    };
    let mut triangles = [[[0.0; 3]; 3]; MOST];
    let triangles = triangles.get_mut(..polygon.len())?;
    for (triangle, facet) in triangles.iter_mut().zip(polygon) {
        *triangle = facet.corners.map(local);
    }
    let (volume, area) = Form::through(triangles)?.over(triangles)?;
    Some((volume * extent.powi(3), area * square))
}

/// A surface that passes the origin: its slopes there, and its bends xx, xy, yy.
struct Form([f64; 5]);

impl Form {
    fn row([x, y, _]: Local) -> [f64; 5] {
        [x, y, 0.5 * x * x, x * y, 0.5 * y * y]
    }

    /// Height and slopes.
    fn at(&self, place: Local) -> (f64, [f64; 2]) {
        let ([p, q, xx, xy, yy], [x, y, _]) = (self.0, place);
        let height = Form::row(place).iter().zip(self.0).map(|(a, b)| a * b).sum();
        (height, [p + xx * x + xy * y, q + xy * x + yy * y])
    }

    /// The form that passes the corners of triangles.
    fn through(triangles: &[[Local; 3]]) -> Option<Form> {
        let (mut corners, mut count) = ([[0.0; 3]; MOST], 0);
        for corner in triangles.as_flattened() {
            if !corners[..count].contains(corner) {
                *corners.get_mut(count)? = *corner;
                count += 1;
            }
        }
        let corners = &corners[..count];
        let (mut matrix, mut rhs) = ([[0.0; 5]; 5], [0.0; 5]);
        for corner in corners {
            let row = Form::row(*corner);
            for n in 0..5 {
                (0..5).for_each(|m| matrix[n][m] += row[n] * row[m]);
                rhs[n] += row[n] * corner[2];
            }
        }
        (0..5).for_each(|n| matrix[n][n] += LEAST * WEIGHTS[n]);
        let form = Form(solved_positive(matrix, rhs, 5)?);
        let passes =
            |corner: &Local| corner[2].abs() <= HIGH && (form.at(*corner).0 - corner[2]).abs() <= MISS;
        corners.iter().all(passes).then_some(form)
    }

    /// The volume under it above triangles, and its area, by the middles of sides: of quadratic functions these know the
    /// integral.
    fn over(&self, triangles: &[[Local; 3]]) -> Option<(f64, f64)> {
        let (mut volume, mut area, mut steepest) = (0.0, 0.0, 0.0f64);
        for &[a, b, c] in triangles {
            let flat = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
            for [from, to] in [[a, b], [b, c], [c, a]] {
                let middle: Local = [0, 1, 2].map(|n| 0.5 * (from[n] + to[n]));
                let (height, [p, q]) = self.at(middle);
                let (above, square) = (height - middle[2], p * p + q * q);
                volume += flat * above / 3.0;
                area += flat * (1.0 + square).sqrt() / 3.0;
                // Beyond a side of the polygon the surface goes on to the plane that halves the angle with the next one, by
                // its height times its slope. On diagonals both sides cancel.
                area -= 2.0 / 3.0 * above * (p * (to[1] - from[1]) - q * (to[0] - from[0]));
                steepest = steepest.max(square);
            }
        }
        (steepest <= STEEPEST * STEEPEST).then_some((volume, area))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::{Axis, cross, unit};
    use std::f64::consts::PI;

    /// The two triangles of a polygon of four corners.
    fn halves([a, b, c, d]: [[f64; 3]; 4]) -> [EdgeFacet; 2] {
        let facet = |corners: [[f64; 3]; 3]| EdgeFacet {
            axis: Axis::X,
            low: [0; 3],
            low_is_inside: true,
            fraction: 0.5,
            corners: corners.map(|corner| corner.map(|c| c as f32)),
        };
        [facet([a, b, c]), facet([a, c, d])]
    }

    /// Volume and area of a closed surface of polygons, each with a place of the surface within.
    fn measured(polygons: &[([[f64; 3]; 4], [f64; 3])]) -> (f64, f64) {
        let (mut volume, mut area) = (0.0, 0.0);
        for &(corners, within) in polygons {
            let facets = halves(corners);
            let mut vector = [0.0; 3];
            for facet in &facets {
                let [a, b, c] = facet.corners.map(|corner| corner.map(f64::from));
                let doubled = cross(minus(b, a), minus(c, a));
                volume += dot(a, doubled) / 6.0;
                vector = [0, 1, 2].map(|n| vector[n] + 0.5 * doubled[n]);
            }
            let (beyond, own) = bulge(&facets.each_ref(), within, vector).unwrap();
            volume += beyond;
            area += own;
        }
        (volume, area)
    }

    /// A cube's faces cut into squares and blown up to a ball.
    fn ball(radius: f64, parts: i32) -> Vec<([[f64; 3]; 4], [f64; 3])> {
        let at = |axis: usize, side: f64, u: f64, v: f64| {
            let mut place = [side; 3];
            let half = f64::from(parts) / 2.0;
            (place[(axis + 1) % 3], place[(axis + 2) % 3]) = (side * (u / half - 1.0), v / half - 1.0);
            unit(place).map(|c| c * radius)
        };
        let faces = (0..3).flat_map(|axis| [-1.0, 1.0].map(|side| (axis, side)));
        let squares = faces.flat_map(|face| (0..parts * parts).map(move |n| (face, n)));
        let polygon = |((axis, side), n)| {
            let (u, v) = (f64::from(n % parts), f64::from(n / parts));
            let corner = |i: f64, j: f64| at(axis, side, u + i, v + j);
            let corners = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            // Not in the middle, as crossings are not.
            (corners, corner(0.6, 0.45))
        };
        squares.map(polygon).collect()
    }

    #[test]
    fn polygons_of_a_ball_have_its_volume_and_area() {
        for (radius, parts, most) in [(1.0, 4, 0.006), (3.0, 8, 0.0005), (10.0, 16, 0.0001)] {
            let (volume, area) = measured(&ball(radius, parts));
            assert!((volume / (4.0 / 3.0 * PI * radius.powi(3)) - 1.0).abs() < most, "{parts}: {volume}");
            assert!((area / (4.0 * PI * radius * radius) - 1.0).abs() < most, "{parts}: {area}");
        }
    }

    #[test]
    fn flat_polygons_have_nothing_beyond_them() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [1.0, 1.0, 0.5], [0.0, 1.0, 0.0]];
        let (beyond, area) = bulge(&halves(corners).each_ref(), [0.4, 0.6, 0.2], [-0.5, 0.0, 1.0]).unwrap();
        assert!(beyond.abs() < 1e-12 && (area - 1.25f64.sqrt()).abs() < 1e-12, "{beyond} {area}");
    }

    #[test]
    fn a_crossing_high_above_its_polygon_tells_nothing_of_curvature() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(bulge(&halves(corners).each_ref(), [0.5, 0.5, 0.4], [0.0, 0.0, 1.0]), None);
    }
}
