//! Sets of lattice edges as bits over the lines of a row, so that a scan can leave out what nobody asks for.

use super::scan::LINES_MAX;
use crate::brick::SignChanges;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};
use std::ops::Range;

/// Samples along a row.
const P: usize = BRICK_POINTS;
/// Edges along a row.
const C: usize = BRICK_CELLS;

// The lines of a row are bits of a word.
const _: () = assert!(P <= LINES_MAX as usize);

/// The sign-changing edges of a brick along one axis, by the line (u, v) that they lie on, in both orders of
/// lines. Axes are named as in [`super::scan`]: (axis, u, v) is right-handed.
pub(crate) struct EdgeMasks {
    /// Rows of equal v: \[v\]\[lower sample along the axis\], a bit for every u.
    over_u: Box<[[u64; C]; P]>,
    /// Rows of equal u: \[u\]\[lower sample along the axis\], a bit for every v.
    over_v: Box<[[u64; C]; P]>,
}

impl Default for EdgeMasks {
    fn default() -> EdgeMasks {
        EdgeMasks { over_u: Box::new([[0; C]; P]), over_v: Box::new([[0; C]; P]) }
    }
}

impl EdgeMasks {
    /// Takes the sign-changing edges along `axis`, y or z, and counts them.
    pub fn set(&mut self, axis: Axis, signs: &SignChanges) -> usize {
        debug_assert!(axis != Axis::X, "rows of bits run along x");
        // Sign changes are bits over x: along y, x is v; along z it is u.
        let (over_x, over_other) = match axis {
            Axis::Y => (&mut self.over_v, &mut self.over_u),
            _ => (&mut self.over_u, &mut self.over_v),
        };
        over_other.fill([0; C]);
        let mut count = 0;
        for other in 0..P {
            for lower in 0..C {
                let mut bits = match axis {
                    Axis::Y => signs.edges(axis, lower, other),
                    _ => signs.edges(axis, other, lower),
                };
                over_x[other][lower] = bits;
                while bits != 0 {
                    let x = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    count += 1;
                    over_other[x][lower] |= 1 << other;
                }
            }
        }
        count
    }

    /// The edges whose lower samples are those of the row at (j, k), as bits over x.
    #[inline]
    pub fn row(&self, axis: Axis, j: usize, k: usize) -> u64 {
        let (of_line, lower) = if axis == Axis::Y { (&self.over_v[k], j) } else { (&self.over_u[j], k) };
        of_line.get(lower).copied().unwrap_or(0)
    }

    /// The lines of a row, of equal u if `swap` and of equal v if not, on which an edge lies that begins at
    /// one of the samples `lowers`.
    #[inline(always)]
    pub fn lines(&self, swap: bool, row: usize, lowers: Range<usize>) -> u64 {
        self.of_row(swap, row)[lowers].iter().fold(0, |lines, bits| lines | bits)
    }

    /// Whether the edge is one of them that begins at sample `lower` of a line of a row.
    #[inline(always)]
    pub fn holds(&self, swap: bool, row: usize, line: u32, lower: usize) -> bool {
        self.of_row(swap, row)[lower] >> line & 1 != 0
    }

    #[inline(always)]
    fn of_row(&self, swap: bool, row: usize) -> &[u64; C] {
        if swap { &self.over_v[row] } else { &self.over_u[row] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::{SignChanges, point_index};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20))]
        #[test]
        fn masks_hold_the_sign_changes_in_both_orders(seed in any::<u64>(), sparse in 1u32..6) {
            // Bits of a hash, fewer inside the larger `sparse` is.
            let inside = |i: usize| {
                let h = (i as u64 ^ seed).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                (h >> 32).trailing_zeros() >= sparse
            };
            let signs = SignChanges::from_fn(inside);
            let mut masks = EdgeMasks::default();
            for axis in [Axis::Y, Axis::Z] {
                let count = masks.set(axis, &signs);
                prop_assert_eq!(count, signs.counts()[axis.index()]);
                for (k, j, i) in (0..P).flat_map(|k| (0..P).flat_map(move |j| (0..P).map(move |i| (k, j, i)))) {
                    let (u, v, lower) = if axis == Axis::Y { (k, i, j) } else { (i, j, k) };
                    if lower == C {
                        prop_assert_eq!(masks.row(axis, j, k), 0);
                        continue;
                    }
                    let next = if axis == Axis::Y { [i, j + 1, k] } else { [i, j, k + 1] };
                    let changes = inside(point_index([i, j, k])) != inside(point_index(next));
                    prop_assert_eq!(masks.holds(false, v, u as u32, lower), changes);
                    prop_assert_eq!(masks.holds(true, u, v as u32, lower), changes);
                    prop_assert_eq!(masks.row(axis, j, k) >> i & 1 != 0, changes);
                }
                for row in 0..P {
                    let all = (0..C).fold(0, |bits, lower| bits | masks.lines(true, row, lower..lower + 1));
                    prop_assert_eq!(masks.lines(true, row, 0..C), all);
                }
            }
        }
    }
}
