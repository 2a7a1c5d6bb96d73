//! Moments of far clusters as the derivatives of their fields at a cell's centre, in vectors of 64 or 32 bits.

use super::wide::{Simd, SimdFloat};
use std::marker::PhantomData;

/// Moments and coefficients are used as far as their degrees add up to this.
pub(in crate::winding) const DEGREE: usize = 6;
/// Coefficients along an axis.
pub(in crate::winding) const C: usize = DEGREE;
/// Clusters translated at a time in 64 bits, which vectorises.
pub(in crate::winding) const LANES: usize = 8;

/// The moments that count, by degree: orders in x, y, z.
const MOMENTS: [&[[usize; 3]]; 3] = [
    &[[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    &[[2, 0, 0], [0, 2, 0], [1, 1, 0], [0, 1, 1], [1, 0, 1]],
    &[[3, 0, 0], [0, 3, 0], [2, 1, 0], [2, 0, 1], [1, 2, 0], [0, 2, 1], [1, 1, 1]],
];

/// Sums over clusters, one in each lane, of the derivatives of their fields.
pub(in crate::winding) struct Translation<S, V, N> {
    /// By order in z, y, x, those in z to the first.
    pub sums: [[[V; C]; C]; 2],
    /// Derivatives of 1/r by order in z, y, x, those in z to the second, of the clusters that are being added.
    derivatives: [[[V; DEGREE + 1]; DEGREE + 1]; 3],
    /// A number as those of the vectors.
    number: N,
    simd: PhantomData<S>,
}

impl<S: Simd, V: SimdFloat<S>, N: Fn(f64) -> V::Element> Translation<S, V, N> {
    #[inline(always)]
    pub fn new(simd: S, number: N) -> Translation<S, V, N> {
        let zero = V::splat(simd, number(0.0));
        let derivatives = [[[zero; DEGREE + 1]; DEGREE + 1]; 3];
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
            for y in 0..=DEGREE - z {
                for x in usize::from(y + z == 0)..=DEGREE - z - y {
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
        for y in 0..=DEGREE - 2 {
            for x in 0..=DEGREE - 2 - y {
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
        let d = &self.derivatives;
        let mut moment = moments.iter();
        for (degree, orders) in (1..).zip(MOMENTS) {
            for (&[i, j, k], m) in orders.iter().zip(&mut moment) {
                let m = V::from_slice(simd, m);
                let last = DEGREE - degree;
                for z in 0..2 {
                    for y in 0..=last - z {
                        let from = &d[k + z][j + y][i..];
                        let to = &mut self.sums[z][y];
                        // Rows of fixed lengths are unrolled: a third of a translation's time.
                        match last - z - y {
                            0 => add_row::<1, S, V>(to, m, from),
                            1 => add_row::<2, S, V>(to, m, from),
                            2 => add_row::<3, S, V>(to, m, from),
                            3 => add_row::<4, S, V>(to, m, from),
                            4 => add_row::<5, S, V>(to, m, from),
                            _ => add_row::<C, S, V>(to, m, from),
                        }
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn add_row<const N: usize, S: Simd, V: SimdFloat<S>>(sums: &mut [V; C], m: V, terms: &[V]) {
    let terms = terms.first_chunk::<N>().expect("orders add up to no more than the degree");
    for (sum, &term) in sums.iter_mut().zip(terms) {
        *sum += m * term;
    }
}
