//! Local expansions: the field of far clusters as a polynomial about a cell's centre.
//!
//! A cluster at r = c − b from the centre b of a cell gives, at b + t, w = −Σ_α M_α ∂^α φ(r − t) with φ = 1/(4π|r|)
//! and the moments M_α of degree m = |α| from 1 to 3. Taylor's series in t, cut off where m + |β| exceeds [`DEGREE`],
//! is Σ_β L_β t^β with L_β = −(−1)^|β|/β!
//!
//! Σ_α M_α ∂^{α+β} φ(r) (Greengard & Rokhlin 1987; in Cartesian form Duan & Krasny 2001, whose recurrence gives the
//! derivatives). φ is harmonic, and so is the polynomial for each m and |β|: ∂_z² = −∂_x² − ∂_y² leaves 15 of the 19
//! moments, and only the coefficients with β_z ≤ 1 need to be summed.

use super::moments::{Expansion, GROUP, Reach, error_bound};
use super::translation::{C, DEGREE, LANES, Translation};
use super::wide::{Simd, SimdBase, dispatch, each_of, level};
use std::f64::consts::PI;

/// A polynomial: coefficients by power of z, y, x, where these add up to less than [`DEGREE`].
#[derive(Clone, Debug, PartialEq)]
pub(in crate::winding) struct LocalExpansion([[[f64; C]; C]; C]);

impl Default for LocalExpansion {
    fn default() -> Self {
        LocalExpansion([[[0.0; C]; C]; C])
    }
}

/// Bound on the error, anywhere within `radius` of a cell's centre, of what a cluster at the distance r adds to the
/// cell's polynomial.
///
/// With s the way from the cluster's centre to a source and t that from the cell's centre to a point, 1/|r + s − t|
/// has in degree m of s and n − m of t a part C(n,m) H(s,…,s,t,…,t), H being the symmetric form of the solid harmonic
/// |u|^n P_n/r^{n+1}. On a Euclidean space such a form is nowhere larger than its polynomial (Banach 1938), so a
/// dipole of area A has there at most A C(n,m) m s^{m−1} t^{n−m}/r^{n+1}. All parts with m ≥ 4 together are the error
/// of the cluster's own expansion at r − t.
///
/// Those with m ≤ 3 and n > N are, with s̄ the root of the mean of s² and q = (s̄ + t)/r, at most A/r² Σ_{n>N} n
/// q^{n−1} = A/r² · q^N ((N + 1) − N q)/(1 − q)².
pub(in crate::winding) fn local_bound(reach: Reach, distance: f64, radius: f64) -> f64 {
    let q = (reach.spread + radius) / distance;
    // Beyond, the sums of bounds would lose too many digits.
    if q > 0.9 || distance == 0.0 {
        return f64::INFINITY;
    }
    const N: f64 = DEGREE as f64;
    let power = q * q * q;
    let power = power * power;
    const { assert!(DEGREE == 6, "the power above") };
    let cut = reach.area / (distance * distance) * power * ((N + 1.0) - N * q)
        / ((1.0 - q) * (1.0 - q))
        / (4.0 * PI);
    cut + error_bound(reach, distance - radius)
}

impl LocalExpansion {
    /// Adds the fields of clusters, each given by the way from the cell's centre to its own.
    pub fn add(&mut self, clusters: &[([f64; 3], &Expansion)]) {
        dispatch!(level(), simd => self.add_with(simd, clusters));
    }

    #[inline(always)]
    fn add_with<S: Simd>(&mut self, simd: S, clusters: &[([f64; 3], &Expansion)]) {
        let mut translation = Translation::new(simd, |number| number);
        for some in clusters.chunks(LANES) {
            // Idle lanes have no moments.
            let mut way = [[1.0; LANES]; 3];
            let mut moments = [[0.0; LANES]; 15];
            for (lane, (r, expansion)) in some.iter().enumerate() {
                (0..3).for_each(|a| way[a][lane] = r[a]);
                let own = expansion.moments();
                moments.iter_mut().zip(own).for_each(|(m, own)| m[lane] = own);
            }
            translation.add(simd, each_of(simd, &way), &moments);
        }
        self.add_sums(
            &translation.sums.map(|plane| plane.map(|row| row.map(|lanes| lanes.as_array().iter().sum()))),
        );
    }

    /// Adds sums of derivatives by order in z, y, x, those in z to the first, from which all coefficients follow.
    pub fn add_sums(&mut self, sums: &[[[f64; C]; C]; 2]) {
        let mut found = LocalExpansion::default();
        let mut factorial = [1.0; C];
        (1..C).for_each(|i| factorial[i] = factorial[i - 1] * i as f64);
        for (z, planes) in sums.iter().enumerate() {
            for (y, rows) in planes[..C - z].iter().enumerate() {
                for (x, sum) in rows[..C - z - y].iter().enumerate() {
                    let sign = if (x + y + z) % 2 == 0 { -1.0 } else { 1.0 };
                    found.0[z][y][x] = sign * sum / (factorial[x] * factorial[y]);
                }
            }
        }
        for z in 2..C {
            for y in 0..C - z {
                for x in 0..C - z - y {
                    let across = ((x + 2) * (x + 1)) as f64 * found.0[z - 2][y][x + 2]
                        + ((y + 2) * (y + 1)) as f64 * found.0[z - 2][y + 2][x];
                    found.0[z][y][x] = -across / (z * (z - 1)) as f64;
                }
            }
        }
        let all = self.0.as_flattened_mut().as_flattened_mut();
        all.iter_mut().zip(found.0.as_flattened().as_flattened()).for_each(|(a, b)| *a += b);
    }

    /// A bound on its absolute value in the cube that reaches so far from its centre along each axis.
    pub fn magnitude(&self, half: f64) -> f64 {
        let mut sum = 0.0;
        for plane in self.0.iter().rev() {
            let mut of_plane = 0.0;
            for row in plane.iter().rev() {
                of_plane = of_plane * half + row.iter().rev().fold(0.0, |sum, c| sum * half + c.abs());
            }
            sum = sum * half + of_plane;
        }
        sum
    }

    /// Powers of x, y, z with their coefficients, in the order of [`LocalExpansion::at`]: falling, those of z first.
    pub fn coefficients(&self) -> impl Iterator<Item = ([usize; 3], f64)> {
        let falling = |last: usize| (0..=last).rev();
        let powers = falling(C - 1).flat_map(move |z| {
            falling(C - 1 - z).flat_map(move |y| falling(C - 1 - z - y).map(move |x| [x, y, z]))
        });
        powers.map(|[x, y, z]| ([x, y, z], self.0[z][y][x]))
    }

    /// The same polynomial about another centre, `way` from this one.
    pub fn shifted(&self, way: [f64; 3]) -> LocalExpansion {
        let mut to = self.clone();
        let c = &mut to.0;
        // Taylor's shift along one axis after the other, a line at a time.
        for (axis, way) in way.into_iter().enumerate() {
            for i in 0..C {
                for j in 0..C - i {
                    let at = |k: usize| match axis {
                        0 => [i, j, k],
                        1 => [i, k, j],
                        _ => [k, i, j],
                    };
                    let last = C - 1 - i - j;
                    for from in 0..last {
                        for k in (from..last).rev() {
                            let ([z, y, x], [w, v, u]) = (at(k), at(k + 1));
                            c[z][y][x] += way * c[w][v][u];
                        }
                    }
                }
            }
        }
        to
    }

    /// The values at a grid of points: by axis how far they are from the centre. `row` tells where in `all` a row along x
    /// belongs, by its numbers along y and z: the first place, and how many.
    #[inline(always)]
    pub fn at_grid(&self, ways: [&[f64]; 3], row: impl Fn(usize, usize) -> (usize, usize), all: &mut [f64]) {
        let [xs, ys, zs] = ways;
        for (j, y) in ys.iter().enumerate() {
            // By power of z, the coefficients by power of x.
            let mut planes = [[0.0; C]; C];
            for (k, (plane, of_z)) in planes.iter_mut().zip(&self.0).enumerate() {
                for of_y in of_z[..C - k].iter().rev() {
                    plane.iter_mut().zip(of_y).for_each(|(sum, c)| *sum = *sum * y + c);
                }
            }
            for (k, z) in zs.iter().enumerate() {
                let mut line = [0.0; C];
                for plane in planes.iter().rev() {
                    line.iter_mut().zip(plane).for_each(|(sum, c)| *sum = *sum * z + c);
                }
                let (first, count) = row(j, k);
                let values = &mut all[first..first + count];
                values.fill(0.0);
                for c in line.iter().rev() {
                    for (value, x) in values.iter_mut().zip(xs) {
                        *value = *value * x + c;
                    }
                }
            }
        }
    }

    /// The value at a point, given by its way from the centre, and how fast it grows along each axis.
    pub fn with_slope(&self, [x, y, z]: [f64; 3]) -> (f64, [f64; 3]) {
        let (mut value, mut slope) = (0.0, [0.0; 3]);
        for (k, plane) in self.0.iter().enumerate().rev() {
            let (mut of_plane, mut along) = (0.0, [0.0; 2]);
            for (j, row) in plane[..C - k].iter().enumerate().rev() {
                let (mut of_row, mut growth) = (0.0, 0.0);
                for c in row[..C - k - j].iter().rev() {
                    growth = growth * x + of_row;
                    of_row = of_row * x + c;
                }
                along = [along[0] * y + growth, along[1] * y + of_plane];
                of_plane = of_plane * y + of_row;
            }
            slope = [slope[0] * z + along[0], slope[1] * z + along[1], slope[2] * z + value];
            value = value * z + of_plane;
        }
        (value, slope)
    }

    /// The values at some points, given by their ways from the centre.
    #[inline(always)]
    pub fn at(&self, x: &[f64; GROUP], y: &[f64; GROUP], z: &[f64; GROUP]) -> [f64; GROUP] {
        let mut value = [0.0; GROUP];
        for k in (0..C).rev() {
            let mut plane = [0.0; GROUP];
            for j in (0..C - k).rev() {
                let mut row = [self.0[k][j][C - 1 - k - j]; GROUP];
                for i in (0..C - 1 - k - j).rev() {
                    let c = self.0[k][j][i];
                    (0..GROUP).for_each(|l| row[l] = row[l] * x[l] + c);
                }
                (0..GROUP).for_each(|l| plane[l] = plane[l] * y[l] + row[l]);
            }
            (0..GROUP).for_each(|l| value[l] = value[l] * z[l] + plane[l]);
        }
        value
    }
}
