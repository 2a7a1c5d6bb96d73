//! What one leaf adds to the samples of a coarse lattice: chords of solid between exact crossings, along all three axes.

use super::chords::add_chords;
use super::kernel::rises;
use super::plan::Plan;
use crate::brick::{Brick, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS, NodeKey};
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

/// A box of a leaf without anything.
fn empty(plan: &Plan) -> SumBox {
    SumBox { first: plan.first, size: plan.size, sums: vec![0.0; plan.size.iter().product()] }
}

/// What a leaf adds; `None` where it has no solid.
fn block(key: NodeKey, brick: &Brick, finest: u8, factor: u32) -> Option<SumBox> {
    let plan = Plan::new(key, finest, factor);
    match brick {
        Brick::Uniform(w) if *w < 1 => None,
        Brick::Uniform(_) => Some(solid(&plan)),
        Brick::Counts { samples, hermite } => {
            let signs = SignChanges::of(samples);
            let mut block = empty(&plan);
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
    let mut block = empty(plan);
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
