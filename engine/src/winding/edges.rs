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
    over_u: Vec<u64>,
    /// Rows of equal u: \[u\]\[lower sample along the axis\], a bit for every v.
    over_v: Vec<u64>,
}

impl Default for EdgeMasks {
    fn default() -> EdgeMasks {
        EdgeMasks { over_u: vec![0; P * C], over_v: vec![0; P * C] }
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
        over_other.fill(0);
        let mut count = 0;
        for other in 0..P {
            for lower in 0..C {
                let mut bits = match axis {
                    Axis::Y => signs.edges(axis, lower, other),
                    _ => signs.edges(axis, other, lower),
                };
                over_x[other * C + lower] = bits;
                while bits != 0 {
                    let x = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    count += 1;
                    over_other[x * C + lower] |= 1 << other;
                }
            }
        }
        count
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
        let rows = if swap { &self.over_v } else { &self.over_u };
        &rows.as_chunks::<C>().0[row]
    }
}
