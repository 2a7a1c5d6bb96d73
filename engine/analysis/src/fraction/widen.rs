//! Fractions of wide tents from those of narrow ones at the same samples.

use super::lattice::{CoarseBrick, FULL, Lattice};
use crate::lattice::{BRICK_CELLS, NodeKey};
use rayon::prelude::*;
use std::collections::BTreeSet;

impl Lattice {
    /// The lattice whose tents are `width` times as wide, with the same samples. It must be complete and its tents narrow.
    ///
    /// A wide tent is a sum of narrow ones: those at `width` − 1 samples before and behind, each with the height that the wide
    /// one has there. Sums are of integers, so their order does not matter.
    pub(super) fn widened(mut self, width: u32) -> Lattice {
        let reached: BTreeSet<NodeKey> = self.mixed().flat_map(around).collect();
        // Where all bricks around are alike, nothing changes.
        let made: Vec<(NodeKey, Option<CoarseBrick>)> =
            reached.into_par_iter().map(|key| (key, self.widened_brick(key, width as usize))).collect();
        for (key, brick) in made {
            match brick {
                Some(brick) => self.bricks.insert(key, brick),
                None => self.bricks.remove(&key),
            };
        }
        self.width = width;
        self.count();
        self
    }

    /// One brick of wider tents; `None` if it is empty.
    fn widened_brick(&self, key: NodeKey, width: usize) -> Option<CoarseBrick> {
        let size = BRICK_CELLS + 2 * (width - 1);
        let mut sums = vec![0u64; size.pow(3)];
        self.for_around(key, (width - 1, size), |place, fractions| {
            let row = sums[place..].iter_mut().zip(fractions);
            row.for_each(|(sum, &fraction)| *sum = u64::from(fraction));
        });
        // Along x, y and z, each of which leaves 32 samples of its axis.
        let mut sizes = [size; 3];
        for axis in 0..3 {
            sums = widened_along(&sums, sizes, axis, width);
            sizes[axis] = BRICK_CELLS;
        }
        let all = (width as u64).pow(6);
        let full = all * u64::from(FULL);
        if sums.iter().all(|&sum| sum == 0) {
            return None;
        }
        if sums.iter().all(|&sum| sum == full) {
            return Some(CoarseBrick::Full);
        }
        // None and all are kept apart from what is nearly so.
        let stored = |&sum: &u64| match sum {
            0 => 0,
            sum if sum == full => FULL,
            sum => ((sum + all / 2) / all).clamp(1, u64::from(FULL - 1)) as u16,
        };
        Some(CoarseBrick::Mixed(sums.iter().map(stored).collect()))
    }

    /// Counts samples by fraction anew.
    fn count(&mut self) {
        self.counts.fill(0);
        let mut full = 0;
        for brick in self.bricks.values() {
            match brick {
                CoarseBrick::Mixed(fractions) => {
                    fractions.iter().for_each(|&fraction| self.counts[usize::from(fraction)] += 1);
                }
                CoarseBrick::Full => full += BRICK_CELLS.pow(3) as u64,
                CoarseBrick::Open(_) => {}
            }
        }
        self.counts[usize::from(FULL)] += full;
    }
}

/// A brick and those around it that there are.
fn around(key: NodeKey) -> impl Iterator<Item = NodeKey> {
    (0..27).filter_map(move |n| key.neighbour([n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1]))
}

/// Sums of a box along one axis by the tent of half-width `width`, of places which it does not leave.
fn widened_along(sums: &[u64], sizes: [usize; 3], axis: usize, width: usize) -> Vec<u64> {
    let row: usize = sizes[..axis].iter().product();
    let slab = row * sizes[axis];
    let mut wide = vec![0; sums.len() / sizes[axis] * BRICK_CELLS];
    for (sums, wide) in sums.chunks_exact(slab).zip(wide.chunks_exact_mut(row * BRICK_CELLS)) {
        for (n, into) in wide.chunks_exact_mut(row).enumerate() {
            for m in 0..2 * width - 1 {
                let weight = (width - m.abs_diff(width - 1)) as u64;
                let from = &sums[(n + m) * row..][..row];
                into.iter_mut().zip(from).for_each(|(sum, value)| *sum += weight * value);
            }
        }
    }
    wide
}
