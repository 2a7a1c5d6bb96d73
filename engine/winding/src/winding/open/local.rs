//! Local expansions: the field of far clusters as a polynomial about a cell's centre.
//!
//! A cluster at r = c − b from the centre b of a cell gives, at b + t, w = −Σ_α M_α ∂^α φ(r − t) with φ = 1/(4π|r|)
//! and the moments M_α of degree m = |α| from 1 to M. Taylor's series in t, cut off where m + |β| exceeds C, is
//! Σ_β L_β t^β with L_β = −(−1)^|β|/β! Σ_α M_α ∂^{α+β} φ(r) (Greengard & Rokhlin 1987; in Cartesian form Duan & Krasny
//! 2001, whose recurrence gives the derivatives). φ is harmonic, and so is the polynomial for each m and |β|:
//! ∂_z² = −∂_x² − ∂_y² leaves 2m + 1 moments of degree m, and only the coefficients with β_z ≤ 1 need to be summed.
//!
//! Points of a cloud take C = 6 and M = 3. Caps, which are long and few, take C = 8 and M = 6.

use super::high_moments::{HIGH_DEGREE, high_error_bound};
use super::moments::{GROUP, Reach, error_bound};
use super::translation::{LANES, Translation};
use super::wide::{Simd, SimdBase, dispatch, each_of, f64x8, level};
use crate::lattice::Units;
use std::f64::consts::PI;

/// Coefficients along an axis of the polynomials that cells over a [`super::ClusterTree`] have.
pub(super) const CELL_DEGREE: usize = 8;
/// Such a polynomial.
pub(super) type CellExpansion = LocalExpansion<CELL_DEGREE>;

/// A polynomial: coefficients by power of z, y, x, where these add up to less than C.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::winding) struct LocalExpansion<const C: usize>([[[f64; C]; C]; C]);

impl<const C: usize> Default for LocalExpansion<C> {
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
/// dipole of area A has there at most A C(n,m) m s^{m−1} t^{n−m}/r^{n+1}. All parts with m > M together are the error
/// of the cluster's own moments at r − t.
///
/// Those with m ≤ M and n > C are, with s̄ the root of the mean of s^{M−1} and q = (s̄ + t)/r, at most A/r² Σ_{n>C} n
/// q^{n−1} = A/r² · q^C ((C + 1) − C q)/(1 − q)².
pub(in crate::winding) fn local_bound<const C: usize, const M: usize>(
    reach: Reach,
    distance: f64,
    radius: f64,
) -> f64 {
    const { assert!((C == 6 || C == 8) && (M == 3 || M == HIGH_DEGREE)) };
    let q = (reach.spread + radius) / distance;
    // Beyond, the sums of bounds would lose too many digits.
    if q > 0.9 || distance == 0.0 {
        return f64::INFINITY;
    }
    let cubed = q * q * q;
    let power = if C == 6 { cubed * cubed } else { cubed * cubed * (q * q) };
    let n = C as f64;
    let cut = reach.area / (distance * distance) * power * ((n + 1.0) - n * q)
        / ((1.0 - q) * (1.0 - q))
        / (4.0 * PI);
    let beyond = if M == 3 { error_bound } else { high_error_bound };
    cut + beyond(reach, distance - radius)
}

impl<const C: usize> LocalExpansion<C> {
    /// Adds the fields of clusters, each given by the way from the cell's centre to its own and by its moments. D is C + 1.
    pub fn add<const D: usize, const COUNT: usize>(&mut self, clusters: &[([f64; 3], &[f64; COUNT])]) {
        dispatch!(level(), simd => self.add_with::<_, D, COUNT>(simd, clusters));
    }

    #[inline(always)]
    fn add_with<S: Simd, const D: usize, const COUNT: usize>(
        &mut self,
        simd: S,
        clusters: &[([f64; 3], &[f64; COUNT])],
    ) {
        let mut translation: Translation<S, f64x8<S>, _, C, D> = Translation::new(simd, |number| number);
        for some in clusters.chunks(LANES) {
            // Idle lanes have no moments.
            let mut way = [[1.0; LANES]; 3];
            let mut moments = [[0.0; LANES]; COUNT];
            for (lane, (r, own)) in some.iter().enumerate() {
                (0..3).for_each(|a| way[a][lane] = r[a]);
                moments.iter_mut().zip(*own).for_each(|(m, own)| m[lane] = *own);
            }
            translation.add(simd, each_of(simd, &way), &moments);
        }
        self.add_sums(
            &translation.sums.map(|plane| plane.map(|row| row.map(|lanes| lanes.as_array().iter().sum()))),
        );
    }

    /// Adds sums of derivatives by order in z, y, x, those in z to the first, from which all coefficients follow.
    pub fn add_sums(&mut self, sums: &[[[f64; C]; C]; 2]) {
        let mut found = LocalExpansion::<C>::default();
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
    pub fn shifted(&self, way: [f64; 3]) -> LocalExpansion<C> {
        let mut to = self.clone();
        to.shift(way);
        to
    }

    /// Moves its centre by this way.
    pub fn shift(&mut self, [x, y, z]: [f64; 3]) {
        let c = &mut self.0;
        // Taylor's shift along one axis after the other. What is beyond the degrees is 0 and stays so.
        for (depth, plane) in c.iter_mut().enumerate() {
            let last = C - 1 - depth;
            for (height, row) in plane[..C - depth].iter_mut().enumerate() {
                let last = last - height;
                for from in 0..last {
                    for k in (from..last).rev() {
                        row[k] += x * row[k + 1];
                    }
                }
            }
            for from in 0..last {
                for k in (from..last).rev() {
                    let (low, high) = plane.split_at_mut(k + 1);
                    low[k].iter_mut().zip(&high[0]).for_each(|(low, high)| *low += y * high);
                }
            }
        }
        for from in 0..C - 1 {
            for k in (from..C - 1).rev() {
                let (low, high) = c.split_at_mut(k + 1);
                let (low, high) = (low[k].as_flattened_mut(), high[0].as_flattened());
                low.iter_mut().zip(high).for_each(|(low, high)| *low += z * high);
            }
        }
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

    /// The values at some points, seen from the centre. Those in a row along x that follow each other cost least; a value has
    /// the same bits whatever the others are.
    #[inline(always)]
    pub fn at_points(&self, center: [f64; 3], points: &[Units], values: &mut [f64]) {
        let mut last = None;
        let mut plane = [[0.0; C]; C];
        let rows = points.chunk_by(|a, b| a[1..] == b[1..]).flat_map(|row| row.chunks(GROUP));
        let mut values = values.iter_mut();
        for row in rows {
            let [_, y, z] = row[0];
            if last != Some(z) {
                last = Some(z);
                plane = self.at_height(f64::from(z) - center[2]);
            }
            let y = f64::from(y) - center[1];
            let mut line = [0.0; C];
            for of_y in plane.iter().rev() {
                line.iter_mut().zip(of_y).for_each(|(sum, c)| *sum = *sum * y + c);
            }
            let x: [f64; GROUP] =
                std::array::from_fn(|l| row.get(l).map_or(0.0, |p| f64::from(p[0]) - center[0]));
            let mut found = [0.0; GROUP];
            for c in line.iter().rev() {
                found.iter_mut().zip(&x).for_each(|(value, x)| *value = *value * x + c);
            }
            values.by_ref().take(row.len()).zip(found).for_each(|(value, found)| *value = found);
        }
    }

    /// Coefficients by power of y and x where z is so far from the centre.
    #[inline(always)]
    fn at_height(&self, z: f64) -> [[f64; C]; C] {
        let mut plane = [[0.0; C]; C];
        for (k, of_z) in self.0.iter().enumerate().rev() {
            for (sums, row) in plane.iter_mut().zip(&of_z[..C - k]) {
                sums.iter_mut().zip(row).for_each(|(sum, c)| *sum = *sum * z + c);
            }
        }
        plane
    }
}
