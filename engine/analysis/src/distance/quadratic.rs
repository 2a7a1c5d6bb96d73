//! The quadratic form that a patch is bent by, and small systems of equations.

use crate::lattice::{dot, minus, solved_positive};

/// How far a corner may be from the quadratic form through all, in cells; beyond, the polygon is taken as it is.
const MISS: f64 = 0.015;
/// How steeply corners may stand above the tangent plane.
const STEEP: f64 = 0.6;
/// What slopes at neighbours weigh against heights of corners: as little as suffices to tell what corners on two lines leave
/// open.
const SLOPES: f64 = 2e-4;
/// The least cosine between normals of neighbours that are of one smooth surface.
const SMOOTH: f64 = 0.6;

/// Where the surface crosses a lattice edge, and its unit normal there.
pub(super) type Crossing = ([f64; 3], [f64; 3]);

/// How a patch bends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Plane = 0,
    /// By a quadratic form.
    Bent = 1,
    /// Triangles between the crossing and the corners.
    Rough = 2,
}

/// The solution of a symmetric system of two equations that is safely positive.
pub(super) fn solved([xx, xy, yy]: [f64; 3], [p, q]: [f64; 2]) -> Option<[f64; 2]> {
    let determinant = xx * yy - xy * xy;
    (xx > 0.05 && determinant > 0.05)
        .then(|| [(yy * p - xy * q) / determinant, (xx * q - xy * p) / determinant])
}

/// Real roots of a t² + b t + c.
pub(super) fn roots(a: f64, b: f64, c: f64) -> [Option<f64>; 2] {
    if a.abs() < 1e-12 {
        return [(b != 0.0).then(|| -c / b), None];
    }
    let square = b * b - 4.0 * a * c;
    if square < 0.0 {
        return [None, None];
    }
    let q = -0.5 * (b + square.sqrt().copysign(b));
    [Some(q / a), (q != 0.0).then(|| c / q)]
}

/// Where a neighbour lies in the tangent plane, the slope of the surface there, and its height; `None` of another face.
pub(super) fn slope(
    (at, normal): Crossing,
    [u, v]: [[f64; 3]; 2],
    (there, turned): Crossing,
) -> Option<[f64; 5]> {
    let up = dot(turned, normal);
    let away = minus(there, at);
    let slope = [-dot(turned, u) / up, -dot(turned, v) / up];
    (up > SMOOTH).then(|| [dot(away, u), dot(away, v), slope[0], slope[1], dot(away, normal)])
}

/// The quadratic form that passes corners best, by least squares over all of them, and over slopes where corners leave it open.
pub(super) fn bent(corners: &[[f64; 3]], slopes: &[[f64; 5]]) -> ([f64; 3], Shape) {
    let steep = |[x, y, z]: &[f64; 3]| z.abs() > STEEP * (x * x + y * y).sqrt();
    if corners.len() < 3 || corners.iter().any(steep) {
        return ([0.0; 3], Shape::Rough);
    }
    let (mut matrix, mut rhs) = ([[0.0f64; 3]; 3], [0.0f64; 3]);
    for [x, y, z] in corners {
        let row = [0.5 * x * x, x * y, 0.5 * y * y];
        for n in 0..3 {
            (0..3).for_each(|m| matrix[n][m] += row[n] * row[m]);
            rhs[n] += row[n] * z;
        }
    }
    for &[x, y, p, q, _] in slopes {
        for (row, value) in [([x, y, 0.0], p), ([0.0, x, y], q)] {
            for n in 0..3 {
                (0..3).for_each(|m| matrix[n][m] += SLOPES * row[n] * row[m]);
                rhs[n] += SLOPES * row[n] * value;
            }
        }
    }
    // Without neighbours what corners on two lines leave open bends as little as it can.
    let trace = matrix[0][0] + matrix[1][1] + matrix[2][2];
    (0..3).for_each(|n| matrix[n][n] += 1e-6 * trace);
    let Some(bend) = solved_positive(matrix, rhs, 3) else { return ([0.0; 3], Shape::Rough) };
    let miss = |[x, y, z]: &[f64; 3]| (0.5 * (bend[0] * x * x + bend[2] * y * y) + bend[1] * x * y - z).abs();
    let is_good = corners.iter().all(|corner| miss(corner) <= MISS) && bend.iter().all(|b| b.abs() < 2.0);
    if is_good { (bend, Shape::Bent) } else { ([0.0; 3], Shape::Rough) }
}
