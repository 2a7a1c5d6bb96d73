//! Dipoles and clusters far from a cell as its polynomial, as [`LocalExpansion`] adds them, but in 32 bits.

use super::super::open::{Expansion, LocalExpansion, Translation};
use crate::wide::{Simd, SimdBase, dispatch, f32x8, f32x16, level, transposed};

/// What is added at a time.
const LANES: usize = 16;

/// Coefficients of a cell's polynomial along an axis: what is cut off is within the errors of clouds.
pub(super) const C: usize = 6;

/// Moments of a cluster as [`Expansion::moments`] has them, and a 0.
pub(super) type ClusterMoments = [f32; 16];

/// A dipole, and the way to it from the middle of a cell, in units of the cell's radius.
#[derive(Clone, Copy)]
pub(super) struct FarDipole {
    pub way: [f32; 3],
    /// Its area over 4π.
    pub dipole: [f32; 3],
}

/// A cluster, and the way to its centre.
pub(super) struct FarCluster<'a> {
    /// In units of the cell's radius.
    pub way: [f32; 3],
    /// In those of the lattice.
    pub moments: &'a ClusterMoments,
}

/// The moments of an expansion in 32 bits.
pub(super) fn moments_of(expansion: &Expansion) -> ClusterMoments {
    let mut all = [0.0; 16];
    all.iter_mut().zip(expansion.moments()).for_each(|(to, from)| *to = from as f32);
    all
}

/// Adds dipoles to the polynomial of a cell, in which no sample is farther than `radius` from the middle.
pub(super) fn add_dipoles(local: &mut LocalExpansion<C>, dipoles: &[FarDipole], radius: f64) {
    dispatch!(level(), simd => add_dipoles_with(simd, local, dipoles, radius));
}

/// The same of clusters.
pub(super) fn add_clusters(local: &mut LocalExpansion<C>, clusters: &[FarCluster<'_>], radius: f64) {
    dispatch!(level(), simd => add_clusters_with(simd, local, clusters, radius));
}

#[inline(always)]
fn add_dipoles_with<S: Simd>(simd: S, local: &mut LocalExpansion<C>, dipoles: &[FarDipole], radius: f64) {
    let mut translation: Translation<S, f32x16<S>, _, C, { C + 1 }> =
        Translation::new(simd, |number| number as f32);
    for some in dipoles.chunks(LANES) {
        let mut way = [[1.0f32; LANES]; 3];
        let mut moments = [[0.0f32; LANES]; 3];
        for (lane, far) in some.iter().enumerate() {
            (0..3).for_each(|a| way[a][lane] = far.way[a]);
            (0..3).for_each(|a| moments[a][lane] = far.dipole[a]);
        }
        translation.add(simd, vectors_of(simd, &way), &moments);
    }
    add_sums(local, &translation, radius);
}

#[inline(always)]
fn add_clusters_with<S: Simd>(
    simd: S,
    local: &mut LocalExpansion<C>,
    clusters: &[FarCluster<'_>],
    radius: f64,
) {
    // In units in which all numbers are near 1.
    let scale = (1.0 / radius) as f32;
    let squared = scale * scale;
    let by_degree = [squared, squared * scale, squared * squared];
    let mut translation: Translation<S, f32x16<S>, _, C, { C + 1 }> =
        Translation::new(simd, |number| number as f32);
    for some in clusters.chunks(LANES) {
        // Idle lanes have no moments.
        let mut way = [[1.0f32; LANES]; 3];
        let mut rows = [&[0.0f32; 16]; LANES];
        for (lane, far) in some.iter().enumerate() {
            (0..3).for_each(|a| way[a][lane] = far.way[a]);
            rows[lane] = far.moments;
        }
        let mut moments = [[0.0f32; LANES]; 15];
        for (rows, from) in rows.as_chunks::<8>().0.iter().zip([0, 8]) {
            let mut first = [f32x8::splat(simd, 0.0); 8];
            let mut second = first;
            for lane in 0..8 {
                first[lane] = f32x8::from_slice(simd, &rows[lane][..8]);
                second[lane] = f32x8::from_slice(simd, &rows[lane][8..]);
            }
            let (first, second) = (transposed(first), transposed(second));
            for number in 0..15 {
                let column = if number < 8 { first[number] } else { second[number - 8] };
                let degree = usize::from(number >= 3) + usize::from(number >= 8);
                (column * by_degree[degree]).store_slice(&mut moments[number][from..from + 8]);
            }
        }
        translation.add(simd, vectors_of(simd, &way), &moments);
    }
    add_sums(local, &translation, radius);
}

#[inline(always)]
fn vectors_of<S: Simd>(simd: S, way: &[[f32; LANES]; 3]) -> [f32x16<S>; 3] {
    [f32x16::from_slice(simd, &way[0]), f32x16::from_slice(simd, &way[1]), f32x16::from_slice(simd, &way[2])]
}

/// Adds what all lanes have found, in units of the cell's radius, to its polynomial.
#[inline(always)]
fn add_sums<S: Simd, N>(
    local: &mut LocalExpansion<C>,
    translation: &Translation<S, f32x16<S>, N, C, { C + 1 }>,
    radius: f64,
) {
    let scale = 1.0 / radius;
    let mut powers = [1.0; C];
    (1..C).for_each(|n| powers[n] = powers[n - 1] * scale);
    let mut found = [[[0.0f64; C]; C]; 2];
    for (z, planes) in translation.sums.iter().enumerate() {
        for (y, rows) in planes[..C - z].iter().enumerate() {
            for (x, &lanes) in rows[..C - z - y].iter().enumerate() {
                let lanes: [f32; LANES] = lanes.into();
                let sum: f64 = lanes.iter().map(|lane| f64::from(*lane)).sum();
                found[z][y][x] = sum * powers[x + y + z];
            }
        }
    }
    local.add_sums(&found);
}
