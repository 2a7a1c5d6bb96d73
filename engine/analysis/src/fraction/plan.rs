//! A leaf on a coarse lattice: which coarse samples its lines add to.

use super::kernel::tent;
use crate::lattice::{BRICK_CELLS, BRICK_POINTS, NodeKey};

/// Weights of one line of samples at coarse samples, from the first of the block on.
pub(super) type Weights = Vec<(usize, f64)>;

/// A leaf on the coarse lattice: along each axis where it begins and what weight each of its lines of samples has.
pub(super) struct Plan {
    pub first: [i64; 3],
    pub size: [usize; 3],
    /// Its first sample in coarse cells.
    pub base: [f64; 3],
    /// A cell of its own in coarse cells.
    pub step: f64,
    /// Where a sample stands for more than one of the finest spacing, the one of the apron has a share, too.
    pub lines: [Vec<Weights>; 3],
}

impl Plan {
    /// Of a leaf of a tree whose finest level is `finest`, `factor` of whose cells are one coarse cell.
    pub fn new(key: NodeKey, finest: u8, factor: u32) -> Plan {
        let fine = 1usize << (finest - key.level());
        let begins = key.first_sample().map(|n| n as usize * fine);
        let factor_wide = f64::from(factor);
        let first = begins.map(|b| (b / factor as usize) as i64);
        let ends = begins.map(|b| ((b + BRICK_CELLS * fine) / factor as usize) as i64);
        // An end adds to three samples.
        let size = std::array::from_fn(|a| (ends[a] - first[a]) as usize + 3);
        let lines = std::array::from_fn(|a| {
            (0..BRICK_POINTS).map(|n| weights(begins[a], n, fine, factor_wide, first[a])).collect()
        });
        let base = begins.map(|b| b as f64 / factor_wide);
        Plan { first, size, base, step: fine as f64 / factor_wide, lines }
    }

    /// The sums of all lines along an axis.
    pub fn all_lines(&self, axis: usize) -> Vec<f64> {
        let mut sums = vec![0.0; self.size[axis]];
        self.lines[axis].iter().flatten().for_each(|&(at, weight)| sums[at] += weight);
        sums
    }
}

/// Weights of line `n` of a leaf: those of the finest samples that the leaf owns, shared between the lines beside each.
fn weights(begin: usize, n: usize, fine: usize, factor: f64, first: i64) -> Weights {
    let mut found = Weights::new();
    let mut add = |fine_sample: usize, share: f64| {
        let (at, [lower, upper]) = tent(fine_sample as f64 / factor);
        for (at, weight) in [(at, lower), (at + 1, upper)] {
            let (place, weight) = ((at - first) as usize, weight * share / factor);
            match found.iter_mut().find(|(known, _)| *known == place) {
                Some((_, sum)) => *sum += weight,
                None if weight > 0.0 => found.push((place, weight)),
                None => {}
            }
        }
    };
    let own = begin + n * fine;
    if n > 0 {
        (1..fine).for_each(|i| add(own - i, 1.0 - i as f64 / fine as f64));
    }
    if n < BRICK_CELLS {
        (0..fine).for_each(|i| add(own + i, 1.0 - i as f64 / fine as f64));
    }
    found
}
