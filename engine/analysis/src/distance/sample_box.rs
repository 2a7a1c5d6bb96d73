//! Boxes of samples of a brick, which are halved until what is in them is known.

use crate::brick::point_index;
use crate::lattice::BRICK_POINTS;

/// The samples from `low` up to and without `high`.
#[derive(Clone, Copy)]
pub(super) struct SampleBox {
    pub low: [usize; 3],
    pub high: [usize; 3],
}

impl SampleBox {
    /// All samples of a brick.
    pub const BRICK: SampleBox = SampleBox { low: [0; 3], high: [BRICK_POINTS; 3] };

    /// Whether it has one sample.
    pub fn is_single(&self) -> bool {
        (0..3).all(|a| self.high[a] - self.low[a] == 1)
    }

    /// The middle between its first and its last sample.
    pub fn middle(&self) -> [f64; 3] {
        std::array::from_fn(|a| 0.5 * (self.low[a] + self.high[a] - 1) as f64)
    }

    /// The way from its middle to its corners, in steps.
    pub fn reach(&self) -> f64 {
        let sides: [f64; 3] = std::array::from_fn(|a| (self.high[a] - self.low[a] - 1) as f64);
        0.5 * crate::lattice::dot(sides, sides).sqrt()
    }

    /// Both halves across its longest side.
    pub fn halves(&self) -> [SampleBox; 2] {
        let axis = (0..3).max_by_key(|&a| self.high[a] - self.low[a]).unwrap_or(0);
        let cut = usize::midpoint(self.low[axis], self.high[axis]);
        let (mut lower, mut upper) = (*self, *self);
        (lower.high[axis], upper.low[axis]) = (cut, cut);
        [lower, upper]
    }

    /// Whether there are at most two samples along each side: halves are seldom known then where the whole is not.
    pub fn is_small(&self) -> bool {
        (0..3).all(|a| self.high[a] - self.low[a] <= 2)
    }

    /// Each sample by itself.
    pub fn singles(self) -> impl Iterator<Item = SampleBox> {
        let SampleBox { low, high } = self;
        let rows = (low[2]..high[2]).flat_map(move |k| (low[1]..high[1]).map(move |j| (j, k)));
        rows.flat_map(move |(j, k)| {
            (low[0]..high[0]).map(move |i| SampleBox { low: [i, j, k], high: [i + 1, j + 1, k + 1] })
        })
    }

    /// Gives all of its samples a value.
    pub fn fill<T: Copy>(&self, samples: &mut [T], value: T) {
        for k in self.low[2]..self.high[2] {
            for j in self.low[1]..self.high[1] {
                let row = point_index([self.low[0], j, k]);
                samples[row..row + self.high[0] - self.low[0]].fill(value);
            }
        }
    }
}
