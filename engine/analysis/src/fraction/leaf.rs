//! What one leaf adds to the samples of a coarse lattice: chords of solid between exact crossings, along all three axes.

use super::chords::add_chords;
use super::kernel::{rises, tent};
use crate::brick::{Brick, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey};
use crate::wide::{dispatch, level};

/// Sums of a box of coarse samples, x fastest.
pub(super) struct SumBox {
    /// The first sample, counted from the first one of the tree.
    pub first: [i64; 3],
    /// Samples along each axis.
    pub size: [usize; 3],
    pub sums: Vec<f64>,
}

impl SumBox {
    /// What it adds to the samples of a lattice whose cells are `factor` of these an axis.
    ///
    /// A tent is the sum of narrower ones: those of `factor`-th its width at their own spacing, each with the height that the
    /// wide one has there (the two-scale relation of linear B-splines: Chui 1992, *An Introduction to Wavelets*, ch. 4).
    pub fn coarsened(&self, factor: u32) -> SumBox {
        // The slowest axis first, which leaves the least to the others.
        dispatch!(level(), _ => self.coarser_along(2, factor).coarser_along(1, factor).coarser_along(0, factor))
    }

    #[inline(always)]
    fn coarser_along(&self, axis: usize, factor: u32) -> SumBox {
        let (mut first, mut size) = (self.first, self.size);
        let wide = i64::from(factor);
        first[axis] = self.first[axis].div_euclid(wide);
        // The last sample adds to the one at it or before, and to the next.
        let last = self.first[axis] + self.size[axis] as i64 - 1;
        size[axis] = (last.div_euclid(wide) - first[axis]) as usize + 2;
        let row: usize = size[..axis].iter().product();
        let mut sums = vec![0.0; size.iter().product()];
        // Of each sample the coarse one at it or before, and the weights of that and of the next.
        let shares: Vec<(usize, [f64; 2])> = (0..self.size[axis] as i64)
            .map(|n| self.first[axis] + n)
            .map(|at| {
                let upper = at.rem_euclid(wide) as f64 / f64::from(factor).powi(2);
                ((at.div_euclid(wide) - first[axis]) as usize, [1.0 / f64::from(factor) - upper, upper])
            })
            .collect();
        let slabs = self.sums.chunks_exact(row * self.size[axis]);
        for (slab, into) in slabs.zip(sums.chunks_exact_mut(row * size[axis])) {
            if row == 1 {
                for (value, &(place, [lower, upper])) in slab.iter().zip(&shares) {
                    into[place] += lower * value;
                    into[place + 1] += upper * value;
                }
                continue;
            }
            for (values, &(place, weights)) in slab.chunks_exact(row).zip(&shares) {
                for (to, weight) in into[place * row..].chunks_exact_mut(row).zip(weights) {
                    if weight > 0.0 {
                        to.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
                    }
                }
            }
        }
        SumBox { first, size, sums }
    }
}

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

    fn block(&self) -> SumBox {
        SumBox { first: self.first, size: self.size, sums: vec![0.0; self.size.iter().product()] }
    }

    /// The sums of all lines along an axis.
    fn all_lines(&self, axis: usize) -> Vec<f64> {
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

/// What a leaf adds to several lattices, whose factors rise; `None` where it has no solid. `base` divides all factors.
pub(super) fn blocks(
    key: NodeKey,
    brick: &Brick,
    finest: u8,
    (base, factors): (u32, &[u32]),
) -> Vec<Option<SumBox>> {
    // Larger leaves have many samples of a fine lattice and few crossings.
    if factors.len() == 1 || key.level() < finest || matches!(brick, Brick::Uniform(_)) {
        return factors.iter().map(|&factor| block(key, brick, finest, factor)).collect();
    }
    let of_base = block(key, brick, finest, base);
    let mut made: Vec<Option<SumBox>> = Vec::with_capacity(factors.len());
    for (n, &factor) in factors.iter().enumerate() {
        // The coarser the block, the less there is to add up.
        let divisor = (0..n).rev().find(|&n| factor.is_multiple_of(factors[n]));
        let (from, of) = divisor.map_or((&of_base, base), |n| (&made[n], factors[n]));
        made.push(from.as_ref().map(|block| block.coarsened(factor / of)));
    }
    made
}

/// What a leaf adds; `None` where it has no solid.
fn block(key: NodeKey, brick: &Brick, finest: u8, factor: u32) -> Option<SumBox> {
    let plan = Plan::new(key, finest, factor);
    match brick {
        Brick::Uniform(w) if *w < 1 => None,
        Brick::Uniform(_) => Some(solid(&plan)),
        Brick::Counts { samples, hermite } => {
            let signs = SignChanges::of(samples);
            let mut block = plan.block();
            for axis in Axis::ALL {
                add_chords(&plan, axis, &signs, &hermite.edges[axis.index()], &mut block.sums);
            }
            // The mean of chords along all axes.
            block.sums.iter_mut().for_each(|sum| *sum /= 3.0);
            Some(block)
        }
    }
}

/// A leaf that is solid throughout.
fn solid(plan: &Plan) -> SumBox {
    let mut block = plan.block();
    let chord: [Vec<f64>; 3] = std::array::from_fn(|a| {
        let mut line = vec![0.0; plan.size[a]];
        for (at, sign) in [(plan.base[a], 1.0), (plan.base[a] + plan.step * BRICK_CELLS as f64, -1.0)] {
            let (first, rises) = rises(at);
            (0..3).for_each(|n| line[(first - plan.first[a]) as usize + n] += sign * rises[n]);
        }
        (1..line.len()).for_each(|n| line[n] += line[n - 1]);
        line
    });
    let lines: [Vec<f64>; 3] = std::array::from_fn(|a| plan.all_lines(a));
    let [nx, ny, _] = plan.size;
    for (n, sum) in block.sums.iter_mut().enumerate() {
        let [x, y, z] = [n % nx, n / nx % ny, n / nx / ny];
        let along = [
            chord[0][x] * lines[1][y] * lines[2][z],
            lines[0][x] * chord[1][y] * lines[2][z],
            lines[0][x] * lines[1][y] * chord[2][z],
        ];
        *sum = along.iter().sum::<f64>() / 3.0;
    }
    block
}
