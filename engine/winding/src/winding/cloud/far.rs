//! Dipoles and clusters far from a cell as its polynomial, as [`LocalExpansion`] adds them, but in 32 bits.

use super::super::open::{COEFFICIENTS as C, DEGREE, Expansion, LocalExpansion, MOMENTS};
use crate::wide::{Simd, SimdBase, SimdFloat, dispatch, f32x8, level};

/// Dipoles at a time.
const LANES: usize = 8;

/// A dipole over 4π, and the way to it from the middle of a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct FarDipole {
    pub way: [f64; 3],
    pub dipole: [f64; 3],
}

/// A cluster, and the way to its centre.
#[derive(Clone, Copy)]
pub(super) struct FarCluster<'a> {
    pub way: [f64; 3],
    pub expansion: &'a Expansion,
}

/// Sums over dipoles of the derivatives of their fields, by order in z, y, x, those in z to the first.
type DerivativeSums<S> = [[[f32x8<S>; C]; C]; 2];

/// NarrowDerivatives of 1/r by order in z, y, x, those in z to the second, of some dipoles.
type NarrowDerivatives<S> = [[[f32x8<S>; DEGREE + 1]; DEGREE + 1]; 3];

/// Adds dipoles to the polynomial of a cell, in which no sample is farther than `radius` from the middle.
pub(super) fn add_dipoles(local: &mut LocalExpansion, dipoles: &[FarDipole], radius: f64) {
    let of = |far: &FarDipole| (far.way, far.dipole);
    dispatch!(level(), simd => add_with::<_, _, 3>(simd, local, (dipoles, of), radius));
}

/// The same of clusters.
pub(super) fn add_clusters(local: &mut LocalExpansion, clusters: &[FarCluster<'_>], radius: f64) {
    let of = |far: &FarCluster<'_>| (far.way, far.expansion.moments());
    dispatch!(level(), simd => add_with::<_, _, 15>(simd, local, (clusters, of), radius));
}

/// Adds what has so many moments: see [`MOMENTS`].
#[inline(always)]
fn add_with<S: Simd, F, const N: usize>(
    simd: S,
    local: &mut LocalExpansion,
    (all, of): (&[F], impl Fn(&F) -> ([f64; 3], [f64; N])),
    radius: f64,
) {
    // In units in which all numbers are near 1.
    let scale = 1.0 / radius;
    let zero = f32x8::splat(simd, 0.0);
    let mut sums: DerivativeSums<S> = [[[zero; C]; C]; 2];
    let mut derivatives: NarrowDerivatives<S> = [[[zero; DEGREE + 1]; DEGREE + 1]; 3];
    for some in all.chunks(LANES) {
        // Idle lanes have no moments.
        let mut way = [[1.0f32; LANES]; 3];
        let mut moments = [[0.0f32; LANES]; N];
        for (lane, far) in some.iter().enumerate() {
            let (to, own) = of(far);
            (0..3).for_each(|a| way[a][lane] = (to[a] * scale) as f32);
            for (number, moment) in own.into_iter().enumerate() {
                let squared = scale * scale;
                let by = [squared, squared * scale, squared * squared]
                    [usize::from(number >= 3) + usize::from(number >= 8)];
                moments[number][lane] = (moment * by) as f32;
            }
        }
        derive(
            simd,
            [
                f32x8::from_slice(simd, &way[0]),
                f32x8::from_slice(simd, &way[1]),
                f32x8::from_slice(simd, &way[2]),
            ],
            &mut derivatives,
        );
        contract(simd, &moments, &derivatives, &mut sums);
    }
    let mut found = [[[0.0f64; C]; C]; 2];
    for z in 0..2 {
        for y in 0..C - z {
            for x in 0..C - z - y {
                let lanes: [f32; LANES] = sums[z][y][x].into();
                let sum: f64 = lanes.iter().map(|lane| f64::from(*lane)).sum();
                found[z][y][x] = sum * scale.powi((x + y + z) as i32);
            }
        }
    }
    local.add_sums(&found);
}

/// n r² D_γ = −(2n − 1) Σ γ_i r_i D_{γ−e_i} − (n − 1) Σ γ_i (γ_i − 1) D_{γ−2e_i}, n = |γ|.
#[inline(always)]
fn derive<S: Simd>(simd: S, r: [f32x8<S>; 3], d: &mut NarrowDerivatives<S>) {
    let inverse = f32x8::splat(simd, 1.0) / (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    let zero = f32x8::splat(simd, 0.0);
    d[0][0][0] = inverse.sqrt();
    for z in 0..2 {
        for y in 0..=DEGREE - z {
            for x in usize::from(y + z == 0)..=DEGREE - z - y {
                let n = (x + y + z) as f32;
                let (mut first, mut second) = (zero, zero);
                if x > 0 {
                    first += r[0] * d[z][y][x - 1] * x as f32;
                }
                if y > 0 {
                    first += r[1] * d[z][y - 1][x] * y as f32;
                }
                if z > 0 {
                    first += r[2] * d[z - 1][y][x] * z as f32;
                }
                if x > 1 {
                    second += d[z][y][x - 2] * (x * (x - 1)) as f32;
                }
                if y > 1 {
                    second += d[z][y - 2][x] * (y * (y - 1)) as f32;
                }
                d[z][y][x] = -inverse * (first * ((2.0 * n - 1.0) / n) + second * ((n - 1.0) / n));
            }
        }
    }
    for y in 0..=DEGREE - 2 {
        for x in 0..=DEGREE - 2 - y {
            d[2][y][x] = -(d[0][y][x + 2] + d[0][y + 2][x]);
        }
    }
}

/// Σ_α M_α D_{α+β} for every β with β_z ≤ 1, added to `sums`.
#[inline(always)]
fn contract<S: Simd, const N: usize>(
    simd: S,
    moments: &[[f32; LANES]; N],
    d: &NarrowDerivatives<S>,
    sums: &mut DerivativeSums<S>,
) {
    let mut moment = moments.iter();
    for (degree, orders) in (1..).zip(MOMENTS) {
        for (&[i, j, k], m) in orders.iter().zip(&mut moment) {
            let m = f32x8::from_slice(simd, m);
            let last = DEGREE - degree;
            for z in 0..2 {
                for y in 0..=last - z {
                    let from = &d[k + z][j + y][i..];
                    let to = &mut sums[z][y];
                    // Rows of fixed lengths are unrolled.
                    match last - z - y {
                        0 => add_row::<1, S>(to, m, from),
                        1 => add_row::<2, S>(to, m, from),
                        2 => add_row::<3, S>(to, m, from),
                        3 => add_row::<4, S>(to, m, from),
                        4 => add_row::<5, S>(to, m, from),
                        _ => add_row::<C, S>(to, m, from),
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn add_row<const N: usize, S: Simd>(sums: &mut [f32x8<S>; C], m: f32x8<S>, terms: &[f32x8<S>]) {
    let terms = terms.first_chunk::<N>().expect("orders add up to no more than the degree");
    for (sum, &term) in sums.iter_mut().zip(terms) {
        *sum += m * term;
    }
}
