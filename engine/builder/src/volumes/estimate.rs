//! From lengths on lines to volumes with their standard errors.

use super::strata::LINES;
use crate::store::Estimate;

/// Sums over strata of `N` lengths, and of the products of the differences between their two lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StratumMoments<const N: usize> {
    sums: [f64; N],
    products: [[f64; N]; N],
}

impl<const N: usize> Default for StratumMoments<N> {
    fn default() -> Self {
        StratumMoments { sums: [0.0; N], products: [[0.0; N]; N] }
    }
}

impl<const N: usize> StratumMoments<N> {
    /// Adds a stratum.
    pub fn add(&mut self, lines: [[f64; N]; LINES]) {
        let [a, b] = lines;
        for i in 0..N {
            self.sums[i] += a[i] + b[i];
            for j in 0..=i {
                self.products[i][j] += (a[i] - b[i]) * (a[j] - b[j]);
            }
        }
    }

    /// Joins those of other strata.
    pub fn merge(&mut self, other: &StratumMoments<N>) {
        for i in 0..N {
            self.sums[i] += other.sums[i];
            for j in 0..=i {
                self.products[i][j] += other.products[i][j];
            }
        }
    }

    /// The integral of length `i` where each line stands for an area of `area`.
    ///
    /// With lines a and b in each stratum the variance of the sum is Σ (a − b)², of which the square root is taken.
    pub fn estimate(&self, i: usize, area: f64) -> Estimate {
        Estimate { value: self.sums[i] * area, standard_error: self.products[i][i].sqrt() * area }
    }

    /// The same with length `c` as control variate, whose integral is exactly `known`.
    pub fn controlled(&self, i: usize, (c, known): (usize, f64), area: f64) -> Estimate {
        let variance = self.products[c][c];
        if variance == 0.0 {
            return self.estimate(i, area);
        }
        let product = self.products[i.max(c)][i.min(c)];
        let slope = product / variance;
        let rest = (self.products[i][i] - slope * product).max(0.0);
        let value = (self.sums[i] - slope * self.sums[c]) * area + slope * known;
        Estimate { value, standard_error: rest.sqrt() * area }
    }
}
