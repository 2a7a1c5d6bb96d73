//! Vertices one at a time, written plainly: what the vectors of [`super::super::solve`] and [`super::super::constrained_qef`] are
//! tested against.

use super::super::qef::{Eigen, PULL, TRUNCATION_SQUARED, Vector};
use super::super::symmetric::{Symmetric, dot};
use ordered_float::OrderedFloat;
use proptest::prelude::*;

/// Planes about the mass point of their base points.
pub(in super::super) struct CentredPlanes {
    pub(in super::super) mass: Vector,
    pub(in super::super) matrix: Symmetric,
    pub(in super::super) rhs: Vector,
}

impl CentredPlanes {
    pub(in super::super) fn new(matrix: [f64; 6], rhs: Vector, mass: Vector) -> CentredPlanes {
        CentredPlanes { mass, matrix: Symmetric(matrix), rhs }
    }

    /// The minimiser anywhere, and the largest eigenvalue.
    pub(in super::super) fn free(&self) -> (Vector, f64) {
        let eigen = self.matrix.eigen();
        let largest = largest_of(&eigen);
        let x = truncated(&eigen, self.rhs, largest);
        (std::array::from_fn(|a| self.mass[a] + x[a]), largest)
    }

    /// The minimiser over the box where the free one, `free`, lies outside: at the faces that it is beyond, their
    /// edges and their corners, with the remaining variables free.
    ///
    /// Others need not be tried: from a minimiser that is at none of those faces one could go towards the free one
    /// without leaving the box, and the error, being convex, would shrink.
    pub(in super::super) fn constrained(&self, free: Vector, largest: f64, margin: f64) -> Vector {
        let bounds = [margin, 1.0 - margin];
        let beyond = (0..3).fold(0u8, |faces, a| {
            faces | u8::from(free[a] < bounds[0]) << (2 * a) | u8::from(free[a] > bounds[1]) << (2 * a + 1)
        });
        let threshold = TRUNCATION_SQUARED * largest;
        let mut best = (OrderedFloat(f64::INFINITY), [0.5; 3]);
        for (code, faces) in FACES.into_iter().enumerate() {
            if faces & beyond == 0 {
                continue;
            }
            let digits = [code % 3, code / 3 % 3, code / 9];
            let fixed = digits.map(|d| d < 2);
            let at: Vector =
                std::array::from_fn(|a| if fixed[a] { bounds[digits[a]] - self.mass[a] } else { 0.0 });
            let x = self.with_fixed(fixed, at, threshold);
            let point: Vector =
                std::array::from_fn(|a| if fixed[a] { bounds[digits[a]] } else { self.mass[a] + x[a] });
            if point.into_iter().any(|p| p < bounds[0] || p > bounds[1]) {
                continue;
            }
            let error =
                OrderedFloat(dot(x, self.matrix.times(x)) - 2.0 * dot(x, self.rhs) + PULL * dot(x, x));
            if error < best.0 {
                best = (error, point);
            }
        }
        best.1
    }

    /// The minimiser along the one or two axes that are not fixed, `at` along the others, without the eigenvalues
    /// up to `threshold`.
    fn with_fixed(&self, fixed: [bool; 3], at: Vector, threshold: f64) -> Vector {
        let mut x = at;
        let moved = self.matrix.times(at);
        let rhs: Vector = std::array::from_fn(|a| self.rhs[a] - moved[a]);
        let [xx, yy, zz, xy, yz, zx] = self.matrix.0;
        let diagonal = [xx, yy, zz];
        match fixed {
            [true, true, true] => {}
            [false, false, _] => [x[0], x[1]] = truncated_pair([xx, yy, xy], [rhs[0], rhs[1]], threshold),
            [false, true, false] => [x[0], x[2]] = truncated_pair([xx, zz, zx], [rhs[0], rhs[2]], threshold),
            [true, false, false] => [x[1], x[2]] = truncated_pair([yy, zz, yz], [rhs[1], rhs[2]], threshold),
            _ => {
                let free = fixed.iter().position(|&fixed| !fixed).unwrap_or(0);
                if diagonal[free] > threshold {
                    x[free] = rhs[free] / diagonal[free];
                }
            }
        }
        x
    }
}

/// The faces of the box, numbers 2·axis + side as bits, that each way of fixing axes is on: per axis a base-3 digit, at
/// the lower bound, at the upper bound, free.
static FACES: [u8; 26] = {
    let mut faces = [0; 26];
    let mut code = 0;
    while code < 26 {
        let digits = [code % 3, code / 3 % 3, code / 9];
        let mut a = 0;
        while a < 3 {
            if digits[a] < 2 {
                faces[code] |= 1 << (2 * a + digits[a]);
            }
            a += 1;
        }
        code += 1;
    }
    faces
};

/// Pseudo-inverse of the matrix [[a, c], [c, b]] times `rhs` without the eigenvalues up to `threshold`.
fn truncated_pair([a, b, c]: [f64; 3], rhs: [f64; 2], threshold: f64) -> [f64; 2] {
    let half = 0.5 * (a - b);
    let largest = 0.5 * (a + b) + (half * half + c * c).sqrt();
    let determinant = a * b - c * c;
    if largest <= threshold {
        return [0.0; 2];
    }
    if determinant > threshold * largest {
        return [(b * rhs[0] - c * rhs[1]) / determinant, (a * rhs[1] - c * rhs[0]) / determinant];
    }
    // Of the two forms of the larger one's eigenvector the longer.
    let v = if a >= b { [largest - b, c] } else { [c, largest - a] };
    let along = (v[0] * rhs[0] + v[1] * rhs[1]) / (largest * (v[0] * v[0] + v[1] * v[1]));
    v.map(|c| c * along)
}

pub(in super::super) fn largest_of((values, _): &Eigen) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// Pseudo-inverse of a matrix times `rhs` without the eigenvalues that are small next to `largest`.
pub(in super::super) fn truncated((values, vectors): &Eigen, rhs: Vector, largest: f64) -> Vector {
    let mut x = [0.0; 3];
    for (&value, &vector) in values.iter().zip(vectors) {
        if value > TRUNCATION_SQUARED * largest {
            let along = dot(vector, rhs) / value;
            x = std::array::from_fn(|a| x[a] + along * vector[a]);
        }
    }
    x
}

proptest! {
    #[test]
    fn pairs_truncate_as_rotations_do(
        m in prop::array::uniform3(-1.0f64..1.0), rhs in prop::array::uniform2(-1.0f64..1.0), threshold in 1e-3f64..0.5,
    ) {
        // A matrix times its transpose has no eigenvalue below zero.
        let pair = [m[0] * m[0] + m[1] * m[1], m[1] * m[1] + m[2] * m[2], m[1] * (m[0] + m[2])];
        let eigen = Symmetric([pair[0], pair[1], 0.0, pair[2], 0.0, 0.0]).eigen();
        prop_assume!(eigen.0.iter().all(|v| (v / threshold - 1.0).abs() > 1e-6));
        let [x, y, _] = truncated(&eigen, [rhs[0], rhs[1], 0.0], threshold / TRUNCATION_SQUARED);
        let found = truncated_pair(pair, rhs, threshold);
        prop_assert!((x - found[0]).hypot(y - found[1]) < 1e-6);
    }
}
