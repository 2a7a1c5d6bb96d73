//! Integer predicates on one snapped triangle: its normal, and whether it touches a box.

use super::{Triangle, Units};

/// Cross product of two edges: the outward normal scaled by twice the area, in units². Components stay
/// below 2^49. The zero vector means that the triangle has no area and crosses no lattice line.
#[inline]
pub fn normal(t: &Triangle) -> [i64; 3] {
    [normal_along(t, 0), normal_along(t, 1), normal_along(t, 2)]
}

/// Whether [`normal`] is not the zero vector. One component mostly tells.
#[inline]
pub fn has_area(t: &Triangle) -> bool {
    [2, 0, 1].into_iter().any(|axis| normal_along(t, axis) != 0)
}

/// The normal's component along an axis.
#[inline(always)]
fn normal_along(t: &Triangle, axis: usize) -> i64 {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let e = |i: usize, a: usize| i64::from(t[i][a]) - i64::from(t[0][a]);
    e(1, u) * e(2, v) - e(1, v) * e(2, u)
}

/// Smallest and largest coordinate along each axis.
#[inline]
pub fn bounds(t: &Triangle) -> (Units, Units) {
    let min = std::array::from_fn(|a| t[0][a].min(t[1][a]).min(t[2][a]));
    let max = std::array::from_fn(|a| t[0][a].max(t[1][a]).max(t[2][a]));
    (min, max)
}

/// Asks of cubes of one size whether a triangle touches them.
///
/// Separating axes (Akenine-Möller 2001) in exact arithmetic: the three box normals are the caller's
/// overlap test, the nine edge cross products are edge functions in the three projections, and the plane is
/// compared in 128 bits. What does not depend on the cube is kept: a triangle is asked of several.
pub struct CubeTest {
    /// Per projection, along an axis, and edge.
    edges: [[EdgeRange; 3]; 3],
    normal: [i64; 3],
    /// Of the normal times the cube's lower corner, where the plane meets the cube.
    plane: [i128; 2],
}

/// The values of an edge function at a cube's lower corner for which a line along the edge, seen in a projection, has
/// not the cube on one side and the triangle on the other.
#[derive(Clone, Copy)]
struct EdgeRange {
    along: [i64; 2],
    from: i64,
    /// Not negative.
    width: i64,
}

impl CubeTest {
    /// Of a triangle and closed cubes `low..low + size`.
    #[inline]
    pub fn new(t: &Triangle, size: i32) -> CubeTest {
        let edges = [0, 1, 2].map(|axis| {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            [0, 1, 2]
                .map(|i| EdgeRange::new([t[i], t[(i + 1) % 3], t[(i + 2) % 3]].map(|p| [p[u], p[v]]), size))
        });
        let normal = normal(t);
        let n = normal.map(i128::from);
        let at_triangle: i128 = (0..3).map(|a| n[a] * i128::from(t[0][a])).sum();
        let grow = n.map(|c| c * i128::from(size));
        let growth = |pick: fn(i128, i128) -> i128| grow.iter().map(|g| pick(*g, 0)).sum::<i128>();
        CubeTest { edges, normal, plane: [at_triangle - growth(i128::max), at_triangle - growth(i128::min)] }
    }

    /// Whether the triangle shares a point with the cube that begins at `low`, given that its bounding box does.
    #[inline]
    pub fn touches(&self, low: Units) -> bool {
        let in_projection = |(axis, edges): (usize, &[EdgeRange; 3])| {
            let low = [low[(axis + 1) % 3], low[(axis + 2) % 3]].map(i64::from);
            edges.iter().all(|edge| edge.holds(low))
        };
        self.edges.iter().enumerate().all(in_projection) && {
            let at = (0..3).map(|a| i128::from(self.normal[a]) * i128::from(low[a])).sum::<i128>();
            (self.plane[0]..=self.plane[1]).contains(&at)
        }
    }
}

impl EdgeRange {
    /// Of the edge from `a` to `b`, opposite to `c`.
    #[inline]
    fn new([a, b, c]: [[i32; 2]; 3], size: i32) -> EdgeRange {
        let [du, dv] = [0, 1].map(|i| i64::from(b[i] - a[i]));
        let at = |p: [i32; 2]| du * i64::from(p[1]) - dv * i64::from(p[0]);
        let (line, third) = (at(a), at(c));
        let (grow_u, grow_v) = (-dv * i64::from(size), du * i64::from(size));
        let from = line.min(third) - grow_u.max(0) - grow_v.max(0);
        let to = line.max(third) - grow_u.min(0) - grow_v.min(0);
        EdgeRange { along: [du, dv], from, width: to - from }
    }

    #[inline]
    fn holds(&self, [u, v]: [i64; 2]) -> bool {
        let [du, dv] = self.along;
        (0..=self.width).contains(&(du * v - dv * u - self.from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Clips the triangle against the cube's six planes in rationals scaled to f64; an independent answer
    /// away from grazing contacts.
    fn clipped_area(t: &Triangle, low: Units, size: i32) -> (f64, usize) {
        let mut polygon: Vec<[f64; 3]> = t.iter().map(|v| v.map(f64::from)).collect();
        for axis in 0..3 {
            for (sign, bound) in [(1.0, f64::from(low[axis])), (-1.0, -f64::from(low[axis] + size))] {
                let inside = |p: &[f64; 3]| sign * p[axis] - bound;
                let mut next = Vec::new();
                for i in 0..polygon.len() {
                    let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
                    let (dp, dq) = (inside(&p), inside(&q));
                    if dp >= 0.0 {
                        next.push(p);
                    }
                    if (dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0) {
                        let s = dp / (dp - dq);
                        next.push(std::array::from_fn(|a| p[a] + s * (q[a] - p[a])));
                    }
                }
                polygon = next;
            }
        }
        (polygon.len() as f64, polygon.len())
    }

    fn overlap(t: &Triangle, low: Units, size: i32) -> bool {
        let (min, max) = bounds(t);
        (0..3).all(|a| min[a] <= low[a] + size && max[a] >= low[a]) && CubeTest::new(t, size).touches(low)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn touching_agrees_with_clipping(t in prop::array::uniform3(prop::array::uniform3(-40i32..40)),
                                         low in prop::array::uniform3(-20i32..20)) {
            let t = t.map(|v| v.map(|c| 2 * c));
            let low = low.map(|c| 2 * c + 1);
            prop_assume!(normal(&t) != [0; 3]);
            let (_, corners) = clipped_area(&t, low, 16);
            let grown = clipped_area(&t, low.map(|c| c - 1), 18).1;
            let touches = overlap(&t, low, 16);
            if corners > 0 { prop_assert!(touches) }
            if grown == 0 { prop_assert!(!touches) }
        }
    }

    #[test]
    fn area_and_normal_agree() {
        let flat = [[[0, 0, 0], [2, 4, 6], [4, 8, 12]], [[2; 3]; 3], [[0, 0, 8], [6, 0, 8], [4, 0, 8]]];
        assert!(flat.iter().all(|t| normal(t) == [0; 3] && !has_area(t)));
        // The normal along one axis only.
        for axis in 0..3 {
            let mut t = [[6; 3]; 3];
            t[1][(axis + 1) % 3] = 10;
            t[2][(axis + 2) % 3] = 2;
            assert!(normal(&t)[axis] != 0 && has_area(&t));
        }
    }

    #[test]
    fn extreme_coordinates_do_not_overflow() {
        let top = (1 << 24) - 2;
        let t = [[2, 2, 2], [top, top, 2], [2, top, top]];
        assert!(overlap(&t, [1, 1, 1], 1 << 24));
        assert!(!overlap(&t, [(1 << 24) - 3, 1, 1], 2));
    }
}
