//! One triangle: its nearest point, where a ray meets it.

use crate::lattice::{cross, dot, minus};

/// The point of a triangle that is nearest to `p` (Ericson 2005, §5.1.5).
pub(super) fn nearest_of_triangle(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    let (ab, ac, ap) = (minus(b, a), minus(c, a), minus(p, a));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = minus(p, b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let on = |from: [f64; 3], along: [f64; 3], t: f64| std::array::from_fn(|n| from[n] + t * along[n]);
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return on(a, ab, if d1 > d3 { d1 / (d1 - d3) } else { 0.0 });
    }
    let cp = minus(p, c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return on(a, ac, if d2 > d6 { d2 / (d2 - d6) } else { 0.0 });
    }
    let va = d3 * d6 - d5 * d4;
    let (s, t) = (d4 - d3, d5 - d6);
    if va <= 0.0 && s >= 0.0 && t >= 0.0 {
        return on(b, minus(c, b), if s + t > 0.0 { s / (s + t) } else { 0.0 });
    }
    let sum = va + vb + vc;
    if sum <= 0.0 {
        return a;
    }
    std::array::from_fn(|n| a[n] + ab[n] * (vb / sum) + ac[n] * (vc / sum))
}

/// What a ray of this direction, from p, passes through: how far along it the triangle's plane is met, where it is met within
/// the triangle.
pub(super) fn through_triangle(p: [f64; 3], d: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> Option<f64> {
    let (ab, ac) = (minus(b, a), minus(c, a));
    let q = cross(d, ac);
    let turn = dot(ab, q);
    if turn == 0.0 {
        return None;
    }
    let away = minus(p, a);
    let u = dot(away, q) / turn;
    let r = cross(away, ab);
    let v = dot(d, r) / turn;
    (u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9).then_some(dot(ac, r) / turn)
}
