//! Dipoles and clusters far from a cell as its polynomial, as [`LocalExpansion`] adds them, but in 32 bits.

use super::super::open::{COEFFICIENTS as C, Expansion, LANES, LocalExpansion, Translation};
use crate::wide::{Simd, SimdBase, dispatch, f32x8, level};

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

/// Adds what has so many moments: those of the lowest degrees.
#[inline(always)]
fn add_with<S: Simd, F, const N: usize>(
    simd: S,
    local: &mut LocalExpansion,
    (all, of): (&[F], impl Fn(&F) -> ([f64; 3], [f64; N])),
    radius: f64,
) {
    // In units in which all numbers are near 1.
    let scale = 1.0 / radius;
    let mut translation: Translation<S, f32x8<S>, _> = Translation::new(simd, |number| number as f32);
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
        let way = [
            f32x8::from_slice(simd, &way[0]),
            f32x8::from_slice(simd, &way[1]),
            f32x8::from_slice(simd, &way[2]),
        ];
        translation.add(simd, way, &moments);
    }
    let mut found = [[[0.0f64; C]; C]; 2];
    for (z, planes) in translation.sums.iter().enumerate() {
        for (y, rows) in planes[..C - z].iter().enumerate() {
            for (x, &lanes) in rows[..C - z - y].iter().enumerate() {
                let lanes: [f32; LANES] = lanes.into();
                let sum: f64 = lanes.iter().map(|lane| f64::from(*lane)).sum();
                found[z][y][x] = sum * scale.powi((x + y + z) as i32);
            }
        }
    }
    local.add_sums(&found);
}
