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
