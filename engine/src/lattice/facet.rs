//! Integer predicates on one snapped triangle: its normal, and whether it touches a box.

use super::{Triangle, Units};
use crate::wide::{Simd, SimdBase, SimdFrom, SimdMask, dispatch, f64x4, level, mask64x4};

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
    /// In the projections along the three axes.
    edges: [EdgeRanges; 3],
    normal: [i64; 3],
    /// Smallest and largest product of the normal and a cube's lower corner at which the plane meets the cube.
    plane: [i128; 2],
}

/// The edges of a projected triangle, the first one twice. In f64 without rounding: coordinates stay below 2^25, so
/// that no product or sum of two passes 2^52.
struct EdgeRanges {
    /// Where the edges go along the two axes.
    along: [[f64; 4]; 2],
    /// Smallest and largest value of the edge function at a cube's lower corner for which a line along the edge has not
    /// the cube on one side and the triangle on the other.
    range: [[f64; 4]; 2],
}

impl CubeTest {
    /// Of a triangle and closed cubes `low..low + size`.
    pub fn new(t: &Triangle, size: i32) -> CubeTest {
        let edges = dispatch!(level(), simd => edge_ranges(simd, t, f64::from(size)));
        let normal = normal(t);
        let at_triangle: i128 = (0..3).map(|a| i128::from(normal[a]) * i128::from(t[0][a])).sum();
        // Of one sign, each is below 2^51.
        let growth = |sign: i64| normal.iter().map(|n| (sign * n).max(0)).sum::<i64>();
        let [back, ahead] = [growth(1), growth(-1)].map(|sum| i128::from(sum) * i128::from(size));
        CubeTest { edges, normal, plane: [at_triangle - back, at_triangle + ahead] }
    }

    /// Whether the triangle shares a point with the cube that begins at `low`, given that its bounding box does.
    pub fn touches(&self, low: Units) -> bool {
        let at = low.map(f64::from);
        dispatch!(level(), simd => self.meets_in_projections(simd, at)) && {
            let at = (0..3).map(|a| i128::from(self.normal[a]) * i128::from(low[a])).sum::<i128>();
            (self.plane[0]..=self.plane[1]).contains(&at)
        }
    }

    #[inline(always)]
    fn meets_in_projections<S: Simd>(&self, simd: S, low: [f64; 3]) -> bool {
        let [x, y, z] = &self.edges;
        let all =
            x.hold(simd, [low[1], low[2]]) & y.hold(simd, [low[2], low[0]]) & z.hold(simd, [low[0], low[1]]);
        all.all_true()
    }
}

#[inline(always)]
fn edge_ranges<S: Simd>(simd: S, t: &Triangle, size: f64) -> [EdgeRanges; 3] {
    let [x, y, z] = [corners(simd, t, 0), corners(simd, t, 1), corners(simd, t, 2)];
    [EdgeRanges::new(simd, y, z, size), EdgeRanges::new(simd, z, x, size), EdgeRanges::new(simd, x, y, size)]
}

/// Along an axis: where the edges begin, where they end, and the corners opposite to them.
#[inline(always)]
fn corners<S: Simd>(simd: S, t: &Triangle, axis: usize) -> [f64x4<S>; 3] {
    let [p, q, r] = [f64::from(t[0][axis]), f64::from(t[1][axis]), f64::from(t[2][axis])];
    [
        f64x4::simd_from(simd, [p, q, r, p]),
        f64x4::simd_from(simd, [q, r, p, q]),
        f64x4::simd_from(simd, [r, p, q, r]),
    ]
}

impl EdgeRanges {
    #[inline(always)]
    fn new<S: Simd>(simd: S, u: [f64x4<S>; 3], v: [f64x4<S>; 3], size: f64) -> EdgeRanges {
        let (du, dv) = (u[1] - u[0], v[1] - v[0]);
        let (line, third) = (du * v[0] - dv * u[0], du * v[2] - dv * u[2]);
        let (grow_u, grow_v) = (-dv * size, du * size);
        let zero = f64x4::splat(simd, 0.0);
        let from = line.min(third) - grow_u.max(zero) - grow_v.max(zero);
        let to = line.max(third) - grow_u.min(zero) - grow_v.min(zero);
        EdgeRanges { along: [du.into(), dv.into()], range: [from.into(), to.into()] }
    }

    /// Where the edge functions lie in their ranges.
    #[inline(always)]
    fn hold<S: Simd>(&self, simd: S, [u, v]: [f64; 2]) -> mask64x4<S> {
        let load = |values: &[f64; 4]| f64x4::simd_from(simd, *values);
        let at = load(&self.along[0]) * v - load(&self.along[1]) * u;
        at.simd_ge(load(&self.range[0])) & at.simd_le(load(&self.range[1]))
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
