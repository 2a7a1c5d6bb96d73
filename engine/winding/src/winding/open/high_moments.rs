//! Moments of clusters up to the sixth degree, for elements that are long against their distance.
//!
//! A dipole a at the way d from a centre gives M_α = Σ_i a_i d^{α−e_i}/(α − e_i)! / 4π (see [`super::local`]). About
//! another centre, δ from there to the old one, moments are M'_α = Σ_γ M_{α−γ} δ^γ/γ! (Greengard & Rokhlin 1987,
//! lemma 2.3, in Cartesian form). What is not harmonic adds nothing, so ∂_z² = −∂_x² − ∂_y² leaves those of order 0 and 1
//! in z.

use super::moments::{Reach, SurfaceElement};
use super::translation::orders;
use bytemuck::{Pod, Zeroable};
use std::f64::consts::PI;

/// The highest degree.
pub(super) const HIGH_DEGREE: usize = 6;
/// Moments that count.
pub(super) const HIGH_MOMENTS: usize = 48;
/// Orders along an axis.
const N: usize = HIGH_DEGREE + 1;
/// 1/k!
const INVERSE_FACTORIAL: [f64; N] = [1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0];

/// The moments of a cluster in the order of [`orders`], over 4π.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::winding) struct HighMoments(pub [f64; HIGH_MOMENTS]);

/// Moments by order in z, y, x, not yet reduced to those that count.
struct AllMoments([[[f64; N]; N]; N]);

impl HighMoments {
    /// Of elements about a centre.
    pub fn of<E: SurfaceElement>(elements: &[E], center: [f64; 3]) -> HighMoments {
        let mut all = AllMoments([[[0.0; N]; N]; N]);
        for element in elements {
            element.dipoles(&mut |at, area| {
                let way = std::array::from_fn(|a| at[a] - center[a]);
                all.add_dipole(way, area.map(|a| a / (4.0 * PI)));
            });
        }
        all.reduced()
    }

    /// Of two clusters together, each with the way from the centre of both to its own.
    pub fn of_both(parts: [(&HighMoments, [f64; 3]); 2]) -> HighMoments {
        let mut sum = [0.0; HIGH_MOMENTS];
        for (moments, way) in parts {
            let HighMoments(moved) = AllMoments::from(moments).moved(way).reduced();
            sum.iter_mut().zip(moved).for_each(|(sum, m)| *sum += m);
        }
        HighMoments(sum)
    }
}

impl From<&HighMoments> for AllMoments {
    fn from(moments: &HighMoments) -> AllMoments {
        let mut all = AllMoments([[[0.0; N]; N]; N]);
        orders().zip(moments.0).for_each(|([x, y, z], m)| all.0[z][y][x] = m);
        all
    }
}

impl AllMoments {
    fn add_dipole(&mut self, way: [f64; 3], area: [f64; 3]) {
        let [px, py, pz] = way.map(powers);
        for z in 0..N {
            for y in 0..N - z {
                for x in usize::from(y + z == 0)..N - z - y {
                    let mut sum = 0.0;
                    if x > 0 {
                        sum += area[0] * px[x - 1] * py[y] * pz[z];
                    }
                    if y > 0 {
                        sum += area[1] * px[x] * py[y - 1] * pz[z];
                    }
                    if z > 0 {
                        sum += area[2] * px[x] * py[y] * pz[z - 1];
                    }
                    self.0[z][y][x] += sum;
                }
            }
        }
    }

    /// About a centre from which the old one is seen along `way`.
    fn moved(mut self, way: [f64; 3]) -> AllMoments {
        for (axis, way) in way.into_iter().enumerate() {
            let powers = powers(way);
            for i in 0..N {
                for j in 0..N - i {
                    let at = |k: usize| match axis {
                        0 => [i, j, k],
                        1 => [i, k, j],
                        _ => [k, i, j],
                    };
                    for to in (1..N - i - j).rev() {
                        let mut sum = 0.0;
                        for from in 0..=to {
                            let [z, y, x] = at(from);
                            sum += self.0[z][y][x] * powers[to - from];
                        }
                        let [z, y, x] = at(to);
                        self.0[z][y][x] = sum;
                    }
                }
            }
        }
        self
    }

    fn reduced(mut self) -> HighMoments {
        for z in (2..N).rev() {
            for y in 0..N - z {
                for x in 0..N - z - y {
                    let moment = self.0[z][y][x];
                    self.0[z - 2][y][x + 2] -= moment;
                    self.0[z - 2][y + 2][x] -= moment;
                }
            }
        }
        let mut found = [0.0; HIGH_MOMENTS];
        found.iter_mut().zip(orders()).for_each(|(to, [x, y, z])| *to = self.0[z][y][x]);
        HighMoments(found)
    }
}

/// x^k/k!
fn powers(x: f64) -> [f64; N] {
    let mut power = 1.0;
    std::array::from_fn(|k| {
        let term = power * INVERSE_FACTORIAL[k];
        power *= x;
        term
    })
}

/// The same as [`super::moments::error_bound`] where moments up to the sixth degree are held: Σ_{m≥7} m ∫s^{m−1}/D^{m+1} ≤
/// ∫s⁶/D⁸ · (7 − 6q)/(1 − q)², and ∫s⁶ is at most R ∫s⁵.
pub(super) fn high_error_bound(reach: Reach, distance: f64) -> f64 {
    let inverse = 1.0 / distance;
    let q = reach.farthest * inverse;
    // Farther in, sums of bounds would lose too many digits.
    if q > 0.9 || distance <= 0.0 {
        return f64::INFINITY;
    }
    let sixth = reach.farthest * reach.powers[2];
    let squared = inverse * inverse;
    let fourth = squared * squared;
    fourth * fourth * sixth * (7.0 - 6.0 * q) / ((1.0 - q) * (1.0 - q)) / (4.0 * PI)
}

/// At least the fifth root of a number, given a larger one than that.
pub(super) fn fifth_root(x: f64, larger: f64) -> f64 {
    // Newton's steps fall until rounding stops them: x⁵ is convex.
    let mut root = larger;
    loop {
        let squared = root * root;
        let next = root - (root - x / (squared * squared)) / 5.0;
        if next >= root || next.is_nan() {
            return root;
        }
        root = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fifth_roots_are_not_too_small() {
        for (x, larger) in [(32.0, 2.0), (32.0, 100.0), (1e-30, 3.0), (7.0, 1e9), (0.0, 0.0)] {
            let root = fifth_root(x, larger);
            assert!(
                (root - f64::powf(x, 0.2)).abs() <= 1e-12 * root && root.powi(5) >= x * (1.0 - 1e-14),
                "{x}: {root}"
            );
        }
    }
}
