//! Moments of far clusters as the derivatives of their fields at a cell's centre, in vectors of 64 or 32 bits.

use super::wide::{Simd, SimdFloat};
use std::marker::PhantomData;

/// Clusters translated at a time in 64 bits, which vectorises.
pub(in crate::winding) const LANES: usize = 8;

/// The moments that count, by degree: orders in x, y, z, the last of which is 0 or 1.
const MOMENTS: [&[[usize; 3]]; 6] = [
    &[[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    &[[2, 0, 0], [0, 2, 0], [1, 1, 0], [0, 1, 1], [1, 0, 1]],
    &[[3, 0, 0], [0, 3, 0], [2, 1, 0], [2, 0, 1], [1, 2, 0], [0, 2, 1], [1, 1, 1]],
    &[[4, 0, 0], [3, 1, 0], [2, 2, 0], [1, 3, 0], [0, 4, 0], [3, 0, 1], [2, 1, 1], [1, 2, 1], [0, 3, 1]],
    &[
        [5, 0, 0],
        [4, 1, 0],
        [3, 2, 0],
        [2, 3, 0],
        [1, 4, 0],
        [0, 5, 0],
        [4, 0, 1],
        [3, 1, 1],
        [2, 2, 1],
        [1, 3, 1],
        [0, 4, 1],
    ],
    &[
        [6, 0, 0],
        [5, 1, 0],
        [4, 2, 0],
        [3, 3, 0],
        [2, 4, 0],
        [1, 5, 0],
        [0, 6, 0],
        [5, 0, 1],
        [4, 1, 1],
        [3, 2, 1],
        [2, 3, 1],
        [1, 4, 1],
        [0, 5, 1],
    ],
];

/// Orders in x, y, z of all moments up to the sixth degree that count.
pub(super) fn orders() -> impl Iterator<Item = [usize; 3]> {
    MOMENTS.into_iter().flatten().copied()
}

/// Sums over clusters, one in each lane, of the derivatives of their fields. The degrees of moments and coefficients add
/// up to at most C, so there are C coefficients along an axis; D is one more.
pub(in crate::winding) struct Translation<S, V, N, const C: usize, const D: usize> {
    /// By order in z, y, x, those in z to the first.
    pub sums: [[[V; C]; C]; 2],
    /// Derivatives of 1/r by order in z, y, x, those in z to the second, of the clusters that are being added.
    derivatives: [[[V; D]; D]; 3],
    /// A number as those of the vectors.
    number: N,
    simd: PhantomData<S>,
}

impl<S: Simd, V: SimdFloat<S>, N: Fn(f64) -> V::Element, const C: usize, const D: usize>
    Translation<S, V, N, C, D>
{
    #[inline(always)]
    pub fn new(simd: S, number: N) -> Translation<S, V, N, C, D> {
        const { assert!(D == C + 1 && C <= 8) };
        let zero = V::splat(simd, number(0.0));
        let derivatives = [[[zero; D]; D]; 3];
        Translation { sums: [[[zero; C]; C]; 2], derivatives, number, simd: PhantomData }
    }

    /// Adds clusters, given by the ways to them and the first of their moments.
    #[inline(always)]
    pub fn add<const WIDTH: usize, const COUNT: usize>(
        &mut self,
        simd: S,
        way: [V; 3],
        moments: &[[V::Element; WIDTH]; COUNT],
    ) {
        self.derive(simd, way);
        self.contract(simd, moments);
    }

    /// n r² D_γ = −(2n − 1) Σ γ_i r_i D_{γ−e_i} − (n − 1) Σ γ_i (γ_i − 1) D_{γ−2e_i}, n = |γ|.
    #[inline(always)]
    fn derive(&mut self, simd: S, r: [V; 3]) {
        let (d, number) = (&mut self.derivatives, &self.number);
        let zero = V::splat(simd, number(0.0));
        let inverse = V::splat(simd, number(1.0)) / (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
        d[0][0][0] = inverse.sqrt();
        for z in 0..2 {
            for y in 0..=C - z {
                for x in usize::from(y + z == 0)..=C - z - y {
                    let n = (x + y + z) as f64;
                    let (mut first, mut second) = (zero, zero);
                    if x > 0 {
                        first += r[0] * d[z][y][x - 1] * number(x as f64);
                    }
                    if y > 0 {
                        first += r[1] * d[z][y - 1][x] * number(y as f64);
                    }
                    if z > 0 {
                        first += r[2] * d[z - 1][y][x] * number(z as f64);
                    }
                    if x > 1 {
                        second += d[z][y][x - 2] * number((x * (x - 1)) as f64);
                    }
                    if y > 1 {
                        second += d[z][y - 2][x] * number((y * (y - 1)) as f64);
                    }
                    let (of_first, of_second) = (number((2.0 * n - 1.0) / n), number((n - 1.0) / n));
                    d[z][y][x] = -inverse * (first * of_first + second * of_second);
                }
            }
        }
        for y in 0..=C - 2 {
            for x in 0..=C - 2 - y {
                d[2][y][x] = -(d[0][y][x + 2] + d[0][y + 2][x]);
            }
        }
    }

    /// Σ_α M_α D_{α+β} for every β with β_z ≤ 1, added to the sums.
    #[inline(always)]
    fn contract<const WIDTH: usize, const COUNT: usize>(
        &mut self,
        simd: S,
        moments: &[[V::Element; WIDTH]; COUNT],
    ) {
        for z in 0..2 {
            for y in 0..C - z {
                // Rows of fixed lengths stay in registers.
                match C - z - y {
                    1 => self.contract_row::<1, WIDTH, COUNT>(simd, moments, z, y),
                    2 => self.contract_row::<2, WIDTH, COUNT>(simd, moments, z, y),
                    3 => self.contract_row::<3, WIDTH, COUNT>(simd, moments, z, y),
                    4 => self.contract_row::<4, WIDTH, COUNT>(simd, moments, z, y),
                    5 => self.contract_row::<5, WIDTH, COUNT>(simd, moments, z, y),
                    6 => self.contract_row::<6, WIDTH, COUNT>(simd, moments, z, y),
                    7 => self.contract_row::<7, WIDTH, COUNT>(simd, moments, z, y),
                    _ => self.contract_row::<8, WIDTH, COUNT>(simd, moments, z, y),
                }
            }
        }
    }

    /// The same for the coefficients of one row.
    #[inline(always)]
    fn contract_row<const ROW: usize, const WIDTH: usize, const COUNT: usize>(
        &mut self,
        simd: S,
        moments: &[[V::Element; WIDTH]; COUNT],
        z: usize,
        y: usize,
    ) {
        let d = &self.derivatives;
        let mut sums: [V; ROW] = std::array::from_fn(|x| self.sums[z][y][x]);
        // Degree by degree, for moments of a higher one have fewer coefficients. Those of a degree m begin behind m² − 1.
        macro_rules! add {
            ($($degree:literal)*) => {$(
                if $degree * $degree <= COUNT && $degree <= ROW {
                    let own = &moments[$degree * $degree - 1..];
                    for ([i, j, k], m) in MOMENTS[$degree - 1].iter().zip(own) {
                        let m = V::from_slice(simd, m);
                        let terms = &d[k + z][j + y][*i..][..ROW + 1 - $degree];
                        for (sum, &term) in sums.iter_mut().zip(terms) {
                            *sum += m * term;
                        }
                    }
                }
            )*};
        }
        add!(1 2 3 4 5 6);
        self.sums[z][y][..ROW].copy_from_slice(&sums);
    }
}
