//! The oracle: the sum of signed solid angles over every triangle.

use glam::DVec3;
use rayon::prelude::*;

/// Signed solid angle of the triangle `a b c` seen from the origin, in steradians, positive where it is
/// seen from behind (Van Oosterom & Strackee 1983, eq. 8).
pub fn solid_angle(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(DVec3::from);
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let numerator = a.dot(b.cross(c));
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * numerator.atan2(denominator)
}

/// The generalized winding number of a soup at `point` (Jacobson et al. 2013, eq. 5): 1/4π times the sum of
/// solid angles, in f64, in parallel over fixed blocks, so that the sum does not depend on the threads.
pub fn brute_winding(soup: &[[[f64; 3]; 3]], point: [f64; 3]) -> f64 {
    const BLOCK: usize = 1 << 14;
    let from_point = |v: [f64; 3]| std::array::from_fn(|a| v[a] - point[a]);
    let sums: Vec<f64> = soup
        .par_chunks(BLOCK)
        .map(|block| {
            block.iter().map(|t| solid_angle(from_point(t[0]), from_point(t[1]), from_point(t[2]))).sum()
        })
        .collect();
    sums.iter().sum::<f64>() / (4.0 * std::f64::consts::PI)
}
