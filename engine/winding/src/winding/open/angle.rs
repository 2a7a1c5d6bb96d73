//! The share of the full view that one cap covers, its side decided as crossings are.

use super::atan::angle_of;
use super::moments::{GROUP, Moments, Reach, SurfaceElement};
use super::wide::{
    Select, Simd, SimdBase, SimdFloat, SimdMask, dispatch, each_of, f64x8, level, mask64x8, way,
};
use crate::lattice::{Triangle, Units, normal};
use bytemuck::{Pod, Zeroable};
use std::f64::consts::PI;

/// A triangle, prepared for its solid angle.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Cap {
    vertices: [[f64; 3]; 3],
    /// Twice the area vector; integers below 2^50.
    normal: [f64; 3],
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn exact_dot(a: [f64; 3], b: [f64; 3]) -> i128 {
    (0..3).map(|i| a[i] as i128 * b[i] as i128).sum()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Squared, as a share of 1: nearer to an edge than this, seen from there, f64 is not enough.
const NEAR: f64 = 1.0 / (1u64 << 40) as f64;
/// The rounding of num, three products and two sums of numbers with exact factors, as a share of Σ|terms|.
const NUM_ERROR: f64 = 1.0 / (1u64 << 51) as f64;

/// Caps whose angles are added before an arc tangent is taken. Each factor is at least 2^-20 and at most 4 long, and at
/// that shortest still more exact than the bound needs.
const CAPS_AN_ANGLE: usize = 8;

/// The vertices of a triangle's 16 equal parts: barycentric coordinates in quarters, and how many parts meet there.
const PARTS: [(f64, f64, f64); 15] = [
    (4.0, 0.0, 1.0),
    (0.0, 4.0, 1.0),
    (0.0, 0.0, 1.0),
    (1.0, 3.0, 3.0),
    (2.0, 2.0, 3.0),
    (3.0, 1.0, 3.0),
    (0.0, 1.0, 3.0),
    (0.0, 2.0, 3.0),
    (0.0, 3.0, 3.0),
    (1.0, 0.0, 3.0),
    (2.0, 0.0, 3.0),
    (3.0, 0.0, 3.0),
    (1.0, 1.0, 6.0),
    (1.0, 2.0, 6.0),
    (2.0, 1.0, 6.0),
];

impl Cap {
    /// Of a triangle on even lattice positions, with an area.
    pub fn new(t: &Triangle) -> Cap {
        Cap { vertices: t.map(|v| v.map(f64::from)), normal: normal(t).map(|c| c as f64) }
    }

    /// Its corners.
    pub fn vertices(&self) -> Triangle {
        self.vertices.map(|v| v.map(|c| c as i32))
    }

    /// Twice its area vector.
    pub fn normal(&self) -> [f64; 3] {
        self.normal
    }

    /// The signed solid angle of the cap over 4π, seen from p + (ε, ε², ε³) for an odd lattice position p
    /// within 2^26 units of the root, in the limit ε → 0. Positive from behind.
    ///
    /// tan(Ω/2) = num/den (Van Oosterom & Strackee 1983, eq. 8), where num = n·(a − p) with the integer normal n. The
    /// sign of num is that of an integer, and where that is 0 the perturbation decides, as it does for a crossing at a
    /// sample.
    ///
    /// num² + den² is small, and the quotient ill-conditioned, only next to an edge; there both are taken to twice the
    /// digits, and on an edge itself the limit is taken.
    #[inline(never)]
    pub fn share_at(&self, p: Units) -> f64 {
        // Exact, as are the scalar products of positions in the root.
        let [a, b, c] = self.vertices.map(|v| std::array::from_fn(|i| v[i] - f64::from(p[i])));
        let [aa, bb, cc] = [a, b, c].map(|v| dot(v, v));
        let [la, lb, lc] = [aa, bb, cc].map(f64::sqrt);
        let (ab, bc, ca) = (dot(a, b), dot(b, c), dot(c, a));
        let terms: [f64; 3] = std::array::from_fn(|i| self.normal[i] * a[i]);
        let mut num = terms[0] + terms[1] + terms[2];
        let mut den = la * lb * lc + ab * lc + bc * la + ca * lb;
        if num.abs() <= NUM_ERROR * (terms[0].abs() + terms[1].abs() + terms[2].abs()) {
            num = exact_dot(self.normal, a) as f64;
        }
        if num * num + den * den <= NEAR * (aa * bb * cc) {
            num = exact_dot(self.normal, a) as f64;
            den = den_precisely([a, b, c]);
            if num == 0.0
                && let Some(edge) = self.edge_under([a, b, c])
            {
                return self.share_on_edge(edge);
            }
        }
        self.sign(num) * angle_of(num.abs(), den) / (2.0 * PI)
    }

    /// Numerators and denominators as in [`Cap::share_at`] at some positions, divided by |a||b||c|, and where f64 is
    /// not enough for them.
    #[inline(always)]
    fn terms<S: Simd>(&self, simd: S, at: &[f64x8<S>; 3]) -> (f64x8<S>, f64x8<S>, mask64x8<S>) {
        let [a, b, c] = [
            way(simd, &self.vertices[0], at),
            way(simd, &self.vertices[1], at),
            way(simd, &self.vertices[2], at),
        ];
        let (aa, bb, cc) = (each_dot(&a, &a), each_dot(&b, &b), each_dot(&c, &c));
        let (la, lb, lc) = (aa.sqrt(), bb.sqrt(), cc.sqrt());
        let n = &self.normal;
        let terms = [a[0] * n[0], a[1] * n[1], a[2] * n[2]];
        let num = terms[0] + terms[1] + terms[2];
        let den = la * lb * lc + each_dot(&a, &b) * lc + each_dot(&b, &c) * la + each_dot(&c, &a) * lb;
        let small = (terms[0].abs() + terms[1].abs() + terms[2].abs()) * NUM_ERROR;
        let size = f64x8::splat(simd, 1.0) / (la * lb * lc);
        let poor = num.abs().simd_le(small) | (num * num + den * den).simd_le(aa * bb * cc * NEAR);
        (num * size, den * size, poor)
    }

    /// Which side of the plane the perturbed point is on: 1 behind it.
    fn sign(&self, num: f64) -> f64 {
        if num != 0.0 {
            return num.signum();
        }
        // num falls by the normal's component when the point moves up an axis.
        -self.normal.iter().find(|&&n| n != 0.0).map_or(0.0, |n| n.signum())
    }

    /// The edge on which the origin lies, for vertices relative to it: the number of its first vertex.
    fn edge_under(&self, v: [[f64; 3]; 3]) -> Option<usize> {
        (0..3).find(|&i| {
            let (a, b) = (v[i], v[(i + 1) % 3]);
            // Products of integers below 2^26: exact.
            cross(a, b) == [0.0; 3] && dot(a, b) < 0.0
        })
    }

    /// The limit on an edge: near it the cap is a half-plane, and covers a lune of twice the angle between
    /// the way in which the point is moved off the edge, and the half-plane's own direction, both reversed
    /// and seen along the edge.
    fn share_on_edge(&self, edge: usize) -> f64 {
        let (from, to) = (self.vertices[edge], self.vertices[(edge + 1) % 3]);
        let along: [f64; 3] = std::array::from_fn(|i| to[i] - from[i]);
        // Into the cap, perpendicular to the edge and the normal; rounding cannot make a zero of it, nor
        // the reverse: products of exact numbers that cancel exactly do so here too.
        let inward: [i128; 3] = std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            self.normal[j] as i128 * along[k] as i128 - self.normal[k] as i128 * along[j] as i128
        });
        let moved = (0..3).find(|&i| self.normal[i] != 0.0 || inward[i] != 0);
        let axis = moved.expect("a cap has an area");
        let height = self.normal[axis].abs() * dot(along, along).sqrt();
        self.sign(0.0) * angle_of(height, -(inward[axis] as f64)) / (2.0 * PI)
    }
}

/// |a||b||c| + (a·b)|c| + (b·c)|a| + (c·a)|b| to some 100 bits, for integer vectors whose scalar products f64
/// holds.
fn den_precisely(v: [[f64; 3]; 3]) -> f64 {
    let [a, b, c] = v;
    let [la, lb, lc] = v.map(|v| DoubleDouble::sqrt(dot(v, v)));
    let mut sum = la.times(lb).plus(DoubleDouble(dot(a, b), 0.0)).times(lc);
    sum = sum.plus(la.times(DoubleDouble(dot(b, c), 0.0)));
    sum = sum.plus(lb.times(DoubleDouble(dot(c, a), 0.0)));
    sum.0
}

/// A number as the sum of two, the second below half an ulp of the first (Dekker 1971).
#[derive(Clone, Copy)]
struct DoubleDouble(f64, f64);

impl DoubleDouble {
    fn sum(a: f64, b: f64) -> DoubleDouble {
        let s = a + b;
        let from_b = s - a;
        DoubleDouble(s, (a - (s - from_b)) + (b - from_b))
    }

    fn product(a: f64, b: f64) -> DoubleDouble {
        let p = a * b;
        DoubleDouble(p, a.mul_add(b, -p))
    }

    /// The root of an exact number.
    fn sqrt(x: f64) -> DoubleDouble {
        let root = x.sqrt();
        let rest = (-root).mul_add(root, x);
        DoubleDouble::sum(root, rest / (2.0 * root))
    }

    fn plus(self, other: DoubleDouble) -> DoubleDouble {
        let high = DoubleDouble::sum(self.0, other.0);
        let low = DoubleDouble::sum(self.1, other.1);
        let first = DoubleDouble::sum(high.0, high.1 + low.0);
        DoubleDouble::sum(first.0, first.1 + low.1)
    }

    fn times(self, other: DoubleDouble) -> DoubleDouble {
        let product = DoubleDouble::product(self.0, other.0);
        DoubleDouble::sum(product.0, product.1 + (self.0 * other.1 + self.1 * other.0))
    }
}

impl SurfaceElement for Cap {
    /// An expansion costs about half as much as a solid angle.
    const LEAF_ELEMENTS: usize = 2;

    fn position(&self) -> [f64; 3] {
        let [a, b, c] = self.vertices;
        std::array::from_fn(|i| (a[i] + b[i] + c[i]) / 3.0)
    }

    fn area(&self) -> f64 {
        0.5 * dot(self.normal, self.normal).sqrt()
    }

    fn reach(&self, center: [f64; 3]) -> Reach {
        let d = self.vertices.map(|v| -> [f64; 3] { std::array::from_fn(|i| v[i] - center[i]) });
        let squares = d.map(|d| dot(d, d));
        let farthest = squares[0].max(squares[1]).max(squares[2]);
        let area = self.area();
        let [ab, bc, ca] = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| {
            let edge: [f64; 3] = std::array::from_fn(|k| d[j][k] - d[i][k]);
            dot(edge, edge)
        });
        // Powers of a distance are convex, so their means over a triangle are at most those over its vertices. That is
        // close where the triangle is small against its distance; otherwise it is cut in parts.
        let mut means = [0.0; 4];
        let mut add = |squared: f64, weight: f64| {
            let distance = squared.sqrt();
            let cubed = squared * distance;
            let powers = [squared, cubed, squared * squared, squared * cubed];
            means.iter_mut().zip(powers).for_each(|(mean, power)| *mean += weight * power);
        };
        if ab.max(bc).max(ca) * 16.0 < farthest {
            squares.iter().for_each(|&s| add(s, 1.0 / 3.0));
        } else {
            for (i, j, parts) in PARTS {
                let k = 4.0 - i - j;
                let at: [f64; 3] = std::array::from_fn(|a| 0.25 * (i * d[0][a] + j * d[1][a] + k * d[2][a]));
                add(dot(at, at), parts / 48.0);
            }
        }
        let [second, powers @ ..] = means;
        Reach {
            farthest: farthest.sqrt(),
            area,
            spread: second.sqrt(),
            powers: powers.map(|mean| area * mean),
        }
    }

    const HAS_HIGH_MOMENTS: bool = true;

    /// The rule of seven points that is exact up to the fifth degree (Radon 1948).
    fn dipoles(&self, each: &mut dyn FnMut([f64; 3], [f64; 3])) {
        let root = 15f64.sqrt();
        let [a, b, c] = self.vertices;
        let mut add = |weight: f64, [u, v, w]: [f64; 3]| {
            let at = std::array::from_fn(|i| u * a[i] + v * b[i] + w * c[i]);
            each(at, self.normal.map(|n| 0.5 * weight * n));
        };
        add(9.0 / 40.0, [1.0 / 3.0; 3]);
        for sign in [-1.0, 1.0] {
            let (near, weight) = ((6.0 + sign * root) / 21.0, (155.0 + sign * root) / 1200.0);
            let far = 1.0 - 2.0 * near;
            [[far, near, near], [near, far, near], [near, near, far]]
                .into_iter()
                .for_each(|at| add(weight, at));
        }
    }

    fn add_to(&self, center: [f64; 3], moments: &mut Moments) {
        let area = self.normal.map(|n| 0.5 * n);
        let d = self.vertices.map(|v| -> [f64; 3] { std::array::from_fn(|i| v[i] - center[i]) });
        let sum: [f64; 3] = std::array::from_fn(|i| d[0][i] + d[1][i] + d[2][i]);
        // Mean of x xᵀ over a triangle: (Σ d dᵀ + s sᵀ)/12.
        let second = |i: usize, j: usize| {
            (d[0][i] * d[0][j] + d[1][i] * d[1][j] + d[2][i] * d[2][j] + sum[i] * sum[j]) / 12.0
        };
        moments.add(area, sum.map(|s| s / 3.0), second);
    }

    fn share_at(&self, p: Units) -> f64 {
        Cap::share_at(self, p)
    }

    /// Angles are added by multiplying complex numbers den + i·num, counting how often the product passes the
    /// negative real axis; an arc tangent is taken once for some caps.
    fn add_shares<'a>(
        caps: impl Iterator<Item = &'a Cap>,
        at: &[[f64; GROUP]; 3],
        position: impl Fn(usize) -> Units,
        sums: &mut [f64; GROUP],
    ) {
        dispatch!(level(), simd => add_angles(simd, caps, at, position, sums));
    }
}

#[inline(always)]
fn each_dot<S: Simd>(a: &[f64x8<S>; 3], b: &[f64x8<S>; 3]) -> f64x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// [`SurfaceElement::add_shares`] of caps in vectors of one kind.
#[inline(always)]
pub(super) fn add_angles<'a, S: Simd>(
    simd: S,
    mut caps: impl Iterator<Item = &'a Cap>,
    at: &[[f64; GROUP]; 3],
    position: impl Fn(usize) -> Units,
    sums: &mut [f64; GROUP],
) {
    let at = each_of(simd, at);
    let (zero, one) = (f64x8::splat(simd, 0.0), f64x8::splat(simd, 1.0));
    while let Some(first) = caps.next() {
        let (mut re, mut im, mut turns) = (one, zero, zero);
        for cap in std::iter::once(first).chain(caps.by_ref().take(CAPS_AN_ANGLE - 1)) {
            let (mut num, mut den, poor) = cap.terms(simd, &at);
            if poor.any_true() {
                for l in (0..GROUP).filter(|&l| poor.test(l)) {
                    (num[l], den[l]) = (0.0, 1.0);
                    sums[l] += cap.share_at(position(l));
                }
            }
            let product = (re * den - im * num, re * num + im * den);
            let up = im.simd_ge(zero) & num.simd_ge(zero) & product.1.simd_lt(zero);
            let down = im.simd_lt(zero) & num.simd_lt(zero) & product.1.simd_ge(zero);
            turns += up.select(one, zero) - down.select(one, zero);
            (re, im) = product;
        }
        for l in 0..GROUP {
            let angle = angle_of(im[l].abs(), re[l]);
            sums[l] += (if im[l] < 0.0 { -angle } else { angle }) / (2.0 * PI) + turns[l];
        }
    }
}
