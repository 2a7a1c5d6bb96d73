//! How local thickness is spread over the volume, in integers, so that no order matters.

use crate::brick::{Samples, point_index};
use crate::lattice::{BRICK_CELLS, NodeKey};
use std::collections::BTreeSet;

/// Bars of the histogram over all that samples hold.
const BARS: usize = 256;
const BAR_BITS: u32 = 7;
/// What diameters are off by in cells, of distances.
const OFF: f64 = 0.01;

/// Sums over samples, by which of them are even along each axis: eight lattices, of which each tells the same.
#[derive(Default)]
pub(super) struct LocalTally {
    counted: BTreeSet<NodeKey>,
    parts: [ThicknessSums; 8],
    bars: Vec<u64>,
    most: u64,
}

#[derive(Clone, Copy, Default)]
struct ThicknessSums {
    count: u64,
    sum: u64,
    squares: u128,
}

/// How local thickness is spread over the volume. Lengths are in world units.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalSpread {
    /// Samples that were measured.
    pub samples: u64,
    /// The mean over the volume, and what it is off by: a quarter of the range of the lattices of every other sample, which is twice the standard error; and the step
    /// of numbers.
    pub mean: f64,
    /// See `mean`.
    pub mean_error: f64,
    /// The standard deviation over the volume, with its error.
    pub deviation: f64,
    /// See `deviation`.
    pub deviation_error: f64,
    /// The largest.
    pub max: f64,
    /// The step that numbers are rounded to.
    pub step: f64,
    /// Samples by thickness: bars of equal width from 0, up to the last one with a sample.
    pub histogram: Vec<u64>,
    /// The width of a bar.
    pub bar: f64,
}

impl ThicknessSums {
    fn add(&mut self, other: &ThicknessSums) {
        self.count += other.count;
        self.sum += other.sum;
        self.squares += other.squares;
    }

    /// The mean and the standard deviation.
    fn moments(&self) -> [f64; 2] {
        let count = self.count.max(1) as f64;
        let mean = self.sum as f64 / count;
        [mean, (self.squares as f64 / count - mean * mean).max(0.0).sqrt()]
    }
}

impl LocalTally {
    /// Whether a brick was counted.
    pub fn knows(&self, key: NodeKey) -> bool {
        self.counted.contains(&key)
    }

    /// Counts a brick, once.
    pub fn add(&mut self, key: NodeKey, samples: &Samples) {
        if !self.counted.insert(key) {
            return;
        }
        self.bars.resize(BARS, 0);
        for k in 0..BRICK_CELLS {
            for j in 0..BRICK_CELLS {
                for i in 0..BRICK_CELLS {
                    let value = samples.0[point_index([i, j, k])] as u64;
                    if value == 0 {
                        continue;
                    }
                    self.most = self.most.max(value);
                    let part = i & 1 | (j & 1) << 1 | (k & 1) << 2;
                    self.parts[part].add(&ThicknessSums {
                        count: 1,
                        sum: value,
                        squares: u128::from(value * value),
                    });
                    self.bars[(value >> BAR_BITS) as usize] += 1;
                }
            }
        }
    }

    /// With `unit` the world length of 1, and that of a cell.
    pub fn spread(&self, unit: f64, cell: f64) -> LocalSpread {
        let mut all = ThicknessSums::default();
        self.parts.iter().for_each(|part| all.add(part));
        let [mean, deviation] = all.moments();
        let apart = |n: usize| {
            let found = self.parts.iter().filter(|part| part.count > 0).map(|part| part.moments()[n]);
            let (low, high) = found.fold((f64::INFINITY, 0.0f64), |(low, high), m| (low.min(m), high.max(m)));
            0.25 * (high - low).max(0.0) * unit + 0.5 * unit + OFF * cell
        };
        let last = self.bars.iter().rposition(|&bar| bar > 0).map_or(0, |last| last + 1);
        LocalSpread {
            samples: all.count,
            mean: mean * unit,
            mean_error: apart(0),
            deviation: deviation * unit,
            deviation_error: apart(1),
            max: self.most as f64 * unit,
            step: unit,
            histogram: self.bars[..last].to_vec(),
            bar: unit * f64::from(1u32 << BAR_BITS),
        }
    }
}
