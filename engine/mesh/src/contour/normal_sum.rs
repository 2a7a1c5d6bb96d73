//! Sums of unit normals, and the directions of these.

use super::qef::Vector;
use super::symmetric::dot;

/// Sums of at most this length have vanished. Normals are known to within 4e-5 by their code, and a plain cell has twelve
/// of them at most: of what is shorter that may be the better part.
const VANISHING: f64 = 1e-3;

/// A sum of unit normals.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NormalSum {
    sum: Vector,
    /// The first one; zero before.
    first: [f32; 3],
}

impl NormalSum {
    /// Of some, in this order.
    pub(super) fn of(normals: impl IntoIterator<Item = [f32; 3]>) -> NormalSum {
        let mut sum = NormalSum::default();
        normals.into_iter().for_each(|normal| sum.add(normal));
        sum
    }

    #[inline(always)]
    pub(super) fn add(&mut self, normal: [f32; 3]) {
        self.add_all(&NormalSum { sum: normal.map(f64::from), first: normal });
    }

    #[inline(always)]
    pub(super) fn add_all(&mut self, other: &NormalSum) {
        if self.first == [0.0; 3] {
            self.first = other.first;
        }
        for (sum, more) in self.sum.iter_mut().zip(other.sum) {
            *sum += more;
        }
    }

    /// Its direction, of length one.
    pub(super) fn direction(&self) -> [f32; 3] {
        let length = dot(self.sum, self.sum).sqrt();
        let is_lost = length <= VANISHING;
        // Zeros are to have no sign.
        if is_lost { self.first.map(|c| c + 0.0) } else { self.sum.map(|c| (c / length) as f32 + 0.0) }
    }
}

/// The direction of a sum that does not vanish.
pub(super) fn direction(sum: Vector) -> [f32; 3] {
    NormalSum { sum, first: [0.0; 3] }.direction()
}
