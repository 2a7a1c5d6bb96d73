//! The oracle's term: the signed solid angle of one triangle.

use glam::DVec3;

/// Signed solid angle of the triangle `a b c` seen from the origin, in steradians, positive where it is
/// seen from behind (Van Oosterom & Strackee 1983, eq. 8).
pub fn solid_angle(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(DVec3::from);
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let numerator = a.dot(b.cross(c));
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * numerator.atan2(denominator)
}
