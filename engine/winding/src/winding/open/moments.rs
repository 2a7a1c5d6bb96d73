//! Multipole expansion of the solid angle of oriented surface elements.
//!
//! An element with the area vector a at x contributes a·(x − p)/|x − p|³ to the solid angle seen from p. With r = c −
//! p and d = x − c, and g(r) = r/|r|³ = −∇(1/|r|), Taylor's series about the centre c is a_i g_i + a_i d_j ∂_j g_i + ½
//! a_i d_j d_k ∂_j ∂_k g_i + … (Barill et al. 2018, eq. 16 to 20).
//!
//! The derivatives of 1/|r| are symmetric and without trace, so only that part of each moment counts:
//!
//!   w = [ D·r − 3 Q(r,r)/r² + 15 T(r,r,r)/r⁴ ] / (4π |r|³).

use super::wide::{Simd, SimdBase, SimdFloat, dispatch, f64x8, level};
use crate::lattice::Units;
use bytemuck::{Pod, Zeroable};
use std::f64::consts::PI;

/// Samples evaluated at a time.
pub const GROUP: usize = 8;

/// How far an element reaches from a centre.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Reach {
    /// Its farthest point's distance.
    pub farthest: f64,
    /// Its area.
    pub area: f64,
    /// At least the root of the mean of the squared distance over its area; of the fifth power where the cluster has high
    /// moments.
    pub spread: f64,
    /// At least the integrals over its area of the distance to the third, fourth and fifth.
    pub powers: [f64; 3],
}

/// One oriented piece of surface.
pub trait SurfaceElement: Pod + Send + Sync {
    /// Elements of a cluster that is not divided, without high moments.
    const LEAF_ELEMENTS: usize;
    /// A point to sort by.
    fn position(&self) -> [f64; 3];
    /// Area in units².
    fn area(&self) -> f64;
    /// How far it reaches from a centre.
    fn reach(&self, center: [f64; 3]) -> Reach;
    /// Whether clusters have moments up to the sixth degree if there are not too many.
    const HAS_HIGH_MOMENTS: bool = false;
    /// Calls `each` with places and area vectors of dipoles whose moments about any point are those of the element up to
    /// the sixth degree.
    fn dipoles(&self, _each: &mut dyn FnMut([f64; 3], [f64; 3])) {}
    /// Adds its moments about a centre.
    fn add_to(&self, center: [f64; 3], moments: &mut Moments);
    /// Its solid angle over 4π seen from a lattice position.
    fn share_at(&self, p: Units) -> f64;
    /// Adds the same of some elements for a group of positions, given as coordinates by axis and one by one.
    fn add_shares<'a>(
        elements: impl Iterator<Item = &'a Self>,
        at: &[[f64; GROUP]; 3],
        position: impl Fn(usize) -> Units,
        sums: &mut [f64; GROUP],
    ) where
        Self: 'a;
}

/// Sums of symmetrised moments: D = Σa, Q = Σ a⊗d, T = ½ Σ a⊗d⊗d.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    dipole: [f64; 3],
    /// xx, yy, zz, xy, yz, zx.
    quadrupole: [f64; 6],
    /// xxx, yyy, zzz, xxy, xxz, yyx, yyz, zzx, zzy, xyz.
    octupole: [f64; 10],
}

/// Indices of [`Moments::quadrupole`].
const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)];
/// Indices of [`Moments::octupole`].
const TRIPLES: [(usize, usize, usize); 10] = [
    (0, 0, 0),
    (1, 1, 1),
    (2, 2, 2),
    (0, 0, 1),
    (0, 0, 2),
    (1, 1, 0),
    (1, 1, 2),
    (2, 2, 0),
    (2, 2, 1),
    (0, 1, 2),
];

impl Moments {
    /// Adds an element from its area vector and the means over it of d and of d dᵀ.
    pub fn add(&mut self, area: [f64; 3], mean: [f64; 3], second: impl Fn(usize, usize) -> f64) {
        self.dipole.iter_mut().zip(area).for_each(|(sum, a)| *sum += a);
        for (sum, (i, j)) in self.quadrupole.iter_mut().zip(PAIRS) {
            *sum += 0.5 * (area[i] * mean[j] + area[j] * mean[i]);
        }
        let s = [0, 1, 2].map(|i| [0, 1, 2].map(|j| second(i, j)));
        for (sum, (i, j, k)) in self.octupole.iter_mut().zip(TRIPLES) {
            *sum += (area[i] * s[j][k] + area[j] * s[i][k] + area[k] * s[i][j]) / 6.0;
        }
    }
}

/// The expansion: the moments without their traces, with all constant factors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Expansion {
    dipole: [f64; 3],
    quadrupole: [f64; 6],
    octupole: [f64; 10],
}

impl From<&Moments> for Expansion {
    fn from(m: &Moments) -> Expansion {
        let view = 1.0 / (4.0 * PI);
        let q = &m.quadrupole;
        let trace = (q[0] + q[1] + q[2]) / 3.0;
        let quadrupole = [q[0] - trace, q[1] - trace, q[2] - trace, 2.0 * q[3], 2.0 * q[4], 2.0 * q[5]];
        let t = &m.octupole;
        // A fifth of T_iik.
        let [x, y, z] =
            [t[0] + t[5] + t[7], t[1] + t[3] + t[8], t[2] + t[4] + t[6]].map(|component| component / 5.0);
        let octupole = [
            t[0] - 3.0 * x,
            t[1] - 3.0 * y,
            t[2] - 3.0 * z,
            3.0 * (t[3] - y),
            3.0 * (t[4] - z),
            3.0 * (t[5] - x),
            3.0 * (t[6] - z),
            3.0 * (t[7] - x),
            3.0 * (t[8] - y),
            6.0 * t[9],
        ];
        Expansion {
            dipole: m.dipole.map(|v| v * view),
            quadrupole: quadrupole.map(|v| v * (-3.0 * view)),
            octupole: octupole.map(|v| v * (15.0 * view)),
        }
    }
}

impl Expansion {
    /// Factors of the negative derivatives of 1/r of the first three orders, without those of second or third order in
    /// z, which are sums of others. They are x, y, z; xx, yy, xy, yz, zx; xxx, yyy, xxy, xxz, yyx, yyz, xyz.
    pub fn moments(&self) -> [f64; 15] {
        let (d, q, t) = (&self.dipole, &self.quadrupole, &self.octupole);
        let q = q.map(|v| v / -3.0);
        let t = t.map(|v| v / 15.0);
        [
            d[0],
            d[1],
            d[2],
            q[0] - q[2],
            q[1] - q[2],
            q[3],
            q[4],
            q[5],
            t[0] - t[7],
            t[1] - t[8],
            t[3] - t[8],
            t[4] - t[2],
            t[5] - t[7],
            t[6] - t[2],
            t[9],
        ]
    }

    /// A bound on the absolute value at this distance from the centre: that of a symmetric form is at most the root of the
    /// sum of its squared components.
    pub fn magnitude(&self, distance: f64) -> f64 {
        let squares = |some: &[f64]| some.iter().map(|c| c * c).sum::<f64>();
        let (q, t) = (&self.quadrupole, &self.octupole);
        let dipole = squares(&self.dipole).sqrt();
        let quadrupole = (squares(&q[..3]) + squares(&q[3..]) / 2.0).sqrt();
        let octupole = (squares(&t[..3]) + squares(&t[3..9]) / 3.0 + t[9] * t[9] / 6.0).sqrt();
        let inverse = 1.0 / distance;
        (dipole + inverse * (quadrupole + inverse * octupole)) * inverse * inverse
    }

    /// Factors of the dipole, the quadrupole and the octupole: see [`Expansion::at_each`].
    pub fn factors(&self) -> ([f64; 3], [f64; 6], [f64; 10]) {
        (self.dipole, self.quadrupole, self.octupole)
    }

    /// The winding number seen from a point, given the way `r` from there to the centre.
    pub fn at(&self, r: [f64; 3]) -> f64 {
        dispatch!(level(), simd => self.at_each(simd, r.map(|c| f64x8::splat(simd, c)))[0])
    }

    /// The winding numbers seen from some points, given the ways from there to the centre.
    #[inline(always)]
    pub fn at_each<S: Simd>(&self, simd: S, [x, y, z]: [f64x8<S>; 3]) -> f64x8<S> {
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let squared = xx + yy + zz;
        let inverse = f64x8::splat(simd, 1.0) / squared;
        let (d, q, t) = (&self.dipole, &self.quadrupole, &self.octupole);
        let linear = x * d[0] + y * d[1] + z * d[2];
        let square = xx * q[0] + yy * q[1] + zz * q[2] + y * (x * q[3] + z * q[4]) + z * q[5] * x;
        let cube = x * (xx * t[0] + yy * t[5] + zz * t[7])
            + y * (yy * t[1] + xx * t[3] + zz * t[8])
            + z * (zz * t[2] + xx * t[4] + yy * t[6])
            + x * t[9] * y * z;
        (linear + inverse * (square + inverse * cube)) * inverse * inverse.sqrt()
    }
}

/// Bound on the error of an [`Expansion`] at the distance D > R from its centre, R being the distance of its
/// farthest point and s that of any.
///
/// 1/|x − p| = Σ_m s^m P_m(cos γ)/D^{m+1}. The gradient of the solid harmonic s^m P_m is at most m s^{m−1} long
/// (Bernstein and Szegő: (1 − x²) P_m'² + m² P_m² ≤ m²), and the expansion holds m ≤ 3. What is left is at most
/// Σ_{m≥4} m ∫s^{m−1} / D^{m+1} ≤ 4 ∫s³/D⁵ + 5 ∫s⁴/D⁶ + ∫s⁵/D⁷ · (6 − 5q)/(1 − q)², q = R/D.
pub fn error_bound(reach: Reach, distance: f64) -> f64 {
    let inverse = 1.0 / distance;
    let q = reach.farthest * inverse;
    // Farther in, sums of bounds would lose too many digits.
    if q > 0.9 || distance <= 0.0 {
        return f64::INFINITY;
    }
    let [third, fourth, fifth] = reach.powers;
    let rest = (6.0 - 5.0 * q) / ((1.0 - q) * (1.0 - q));
    let squared = inverse * inverse;
    squared * squared * inverse * (4.0 * third + inverse * (5.0 * fourth + inverse * rest * fifth))
        / (4.0 * PI)
}
