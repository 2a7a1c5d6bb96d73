//! How a surface bends around a sample: its shape operator, by least squares over the normals around.

use super::samples::{SurfaceSample, SurfaceSamples};
use crate::lattice::{cross, dot, minus, unit};

/// Normals of one face are within 37 degrees of each other.
const SAME_FACE: f64 = 0.8;

/// A symmetric tensor: xx, xy, xz, yy, yz, zz. Half of its product with a length, twice, is the width of a slab.
pub(super) type BendTensor = [f64; 6];

/// Two unit vectors across a normal; the three turn as x, y and z do.
pub(super) fn across(normal: [f64; 3]) -> [[f64; 3]; 2] {
    let side = if normal[2].abs() < 0.8 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let first = unit(cross(side, normal));
    [first, cross(normal, first)]
}

pub(super) fn normal_of(sample: &SurfaceSample) -> [f64; 3] {
    unit(sample.normal.map(f64::from))
}

/// Adds a part of a vector, twice, to a tensor.
pub(super) fn add_square(to: &mut BendTensor, vector: [f64; 3], part: f64) {
    let [x, y, z] = vector;
    for (to, of) in to.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
        *to += of * part;
    }
}

/// A tensor times a vector.
pub(super) fn times(tensor: &BendTensor, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let [xx, xy, xz, yy, yz, zz] = *tensor;
    [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z]
}

/// Eigenvalues of a symmetric matrix of two rows, the larger first, and the direction of the larger.
pub(super) fn principal([xx, xy, yy]: [f64; 3]) -> ([f64; 2], [f64; 2]) {
    let (half, mean) = ((xx - yy) / 2.0, (xx + yy) / 2.0);
    let root = (half * half + xy * xy).sqrt();
    if root == 0.0 {
        return ([mean; 2], [1.0, 0.0]);
    }
    // Of two that are parallel, the longer one.
    let direction = if half >= 0.0 { [half + root, xy] } else { [xy, root - half] };
    let length = (direction[0] * direction[0] + direction[1] * direction[1]).sqrt();
    ([mean + root, mean - root], direction.map(|c| c / length))
}

/// Width of the slab around a sample, by samples within a radius; at least `floor` along each direction.
pub(super) fn bend(
    samples: &SurfaceSamples,
    sample: &SurfaceSample,
    radius: f64,
    circles: bool,
) -> BendTensor {
    let normal = normal_of(sample);
    let [u, v] = across(normal);
    let mut sums = [0.0; 6];
    let (low, high) = (sample.place.map(|c| c - radius), sample.place.map(|c| c + radius));
    samples.near(low, high, |_, other| {
        let from = minus(other.place, sample.place);
        let n = normal_of(other);
        if dot(from, from) > radius * radius || dot(n, normal) < SAME_FACE {
            return;
        }
        let (x, y, p, q) = (dot(from, u), dot(from, v), dot(n, u), dot(n, v));
        for (sum, add) in sums.iter_mut().zip([x * x, x * y, y * y, x * p, y * p + x * q, y * q]) {
            *sum += add;
        }
    });
    let (values, direction) = principal(shape_operator(sums));
    // Where the surface bends one way along one direction and another along the other, both add up.
    let is_saddle = values[0] * values[1] < 0.0;
    let [first, second] = values.map(f64::abs);
    let widths = match (circles, is_saddle) {
        (false, false) => [first, second],
        (false, true) => [2.0 * first, 2.0 * second],
        (true, false) => [first.max(second); 2],
        (true, true) => [first + second; 2],
    };
    let most = 1.0 / samples.cell;
    let along: [f64; 3] = std::array::from_fn(|a| u[a] * direction[0] + v[a] * direction[1]);
    let mut tensor = [0.0; 6];
    add_square(&mut tensor, along, widths[0].min(most));
    add_square(&mut tensor, cross(normal, along), widths[1].min(most));
    tensor
}

/// The symmetric matrix that takes places to normals, by sums of xx, xy, yy, xp, yp + xq, yq; none if they do not tell.
fn shape_operator([xx, xy, yy, xp, mixed, yq]: [f64; 6]) -> [f64; 3] {
    let rows = [[xx, xy, 0.0], [xy, xx + yy, xy], [0.0, xy, yy]];
    let right = [xp, mixed, yq];
    let column = |n: usize| -> [f64; 3] { std::array::from_fn(|row| rows[row][n]) };
    let columns = [column(0), column(1), column(2)];
    let volume = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| dot(a, cross(b, c));
    let all = volume(columns[0], columns[1], columns[2]);
    let size = xx + yy;
    if all <= 1e-6 * size * size * size {
        return [0.0; 3];
    }
    [
        volume(right, columns[1], columns[2]) / all,
        volume(columns[0], right, columns[2]) / all,
        volume(columns[0], columns[1], right) / all,
    ]
}
