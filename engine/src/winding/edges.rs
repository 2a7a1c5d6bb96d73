//! Sets of lattice edges as bits over the lines of a row, so that a scan can leave out what nobody asks for.

use super::scan::LINES_MAX;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};
use std::ops::Range;

/// Edges that follow each other along a line and are united in advance. Most facets span no more of them.
const WINDOW: usize = 4;

/// Samples along a row.
const P: usize = BRICK_POINTS;
/// Edges along a row.
const C: usize = BRICK_CELLS;

// The lines of a row are bits of a word.
const _: () = assert!(P <= LINES_MAX as usize);

/// Edges of a brick along one axis, by the line (u, v) that they lie on, in both orders of
/// lines. Axes are named as in [`super::scan`]: (axis, u, v) is right-handed.
pub(crate) struct EdgeMasks {
    /// Rows of equal v, a bit for every u.
    over_u: Box<[Row; P]>,
    /// Rows of equal u, a bit for every v.
    over_v: Box<[Row; P]>,
}

/// The edges on a row's lines, a bit for every line.
#[derive(Clone)]
struct Row {
    /// By the lower sample along the axis.
    at: [u64; C],
    /// Those of [`WINDOW`] lower samples from each on, or of as many as there are.
    from: [u64; C],
}

impl Default for EdgeMasks {
    fn default() -> EdgeMasks {
        let none = || Box::new([const { Row { at: [0; C], from: [0; C] } }; P]);
        EdgeMasks { over_u: none(), over_v: none() }
    }
}

impl EdgeMasks {
    /// Takes edges along `axis`, y or z, and calls `each` with their lower samples (i, j, k), in the order of the
    /// linear index. `edges` gives those of the row (j, k) as bits over i.
    pub fn set(&mut self, axis: Axis, edges: impl Fn(usize, usize) -> u64, mut each: impl FnMut([usize; 3])) {
        debug_assert!(axis != Axis::X, "rows of bits run along x");
        // Bits over x: along y, x is v; along z it is u.
        let along_y = axis == Axis::Y;
        let (over_x, over_other) =
            if along_y { (&mut self.over_v, &mut self.over_u) } else { (&mut self.over_u, &mut self.over_v) };
        over_other.iter_mut().for_each(|row| row.at.fill(0));
        let (slow, fast) = if along_y { (P, C) } else { (C, P) };
        for k in 0..slow {
            for j in 0..fast {
                let (other, lower) = if along_y { (k, j) } else { (j, k) };
                let mut bits = edges(j, k);
                over_x[other].at[lower] = bits;
                while bits != 0 {
                    let x = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    over_other[x].at[lower] |= 1 << other;
                    each([x, j, k]);
                }
            }
        }
        over_x.iter_mut().chain(over_other.iter_mut()).for_each(Row::unite);
    }

    /// The lines of a row, of equal u if `swap` and of equal v if not, on which an edge lies that begins at
    /// one of the samples `lowers`, and perhaps some on which one begins close behind them.
    #[inline(always)]
    pub fn lines(&self, swap: bool, row: usize, lowers: Lowers) -> u64 {
        let row = self.of_row(swap, row);
        let Lowers { first, last, few } = lowers;
        let lines = if few { &row.at } else { &row.from };
        let ends = lines[first] | lines[last];
        (first + WINDOW..last).step_by(WINDOW).fold(ends, |all, lower| all | lines[lower])
    }

    #[inline(always)]
    fn of_row(&self, swap: bool, row: usize) -> &Row {
        if swap { &self.over_v[row] } else { &self.over_u[row] }
    }
}

/// A range of lower samples, as [`EdgeMasks::lines`] takes it.
#[derive(Clone, Copy)]
pub(crate) struct Lowers {
    first: usize,
    /// The last sample or, of many, where the last window begins.
    last: usize,
    /// Two at most, for which no window is needed.
    few: bool,
}

impl Lowers {
    /// The samples of the range, of which there are [`C`]; those of an empty one do not matter.
    #[inline(always)]
    pub fn new(range: Range<usize>) -> Lowers {
        let first = range.start.min(C - 1);
        let few = range.end <= first + 2;
        let back = if few { 1 } else { WINDOW };
        Lowers { first, last: range.end.saturating_sub(back).max(first), few }
    }
}

impl Row {
    fn unite(&mut self) {
        let mut padded = [0; C + WINDOW];
        padded[..C].copy_from_slice(&self.at);
        self.from = std::array::from_fn(|lower| (0..WINDOW).fold(0, |lines, i| lines | padded[lower + i]));
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
                let mut found = Vec::new();
                masks.set(axis, |j, k| signs.edges(axis, j, k), |ijk| found.push(point_index(ijk)));
                let mut expected = Vec::new();
                for (k, j, i) in (0..P).flat_map(|k| (0..P).flat_map(move |j| (0..P).map(move |i| (k, j, i)))) {
                    let (u, v, lower) = if axis == Axis::Y { (k, i, j) } else { (i, j, k) };
                    if lower == C {
                        continue;
                    }
                    let next = if axis == Axis::Y { [i, j + 1, k] } else { [i, j, k + 1] };
                    let changes = inside(point_index([i, j, k])) != inside(point_index(next));
                    expected.extend(changes.then_some(point_index([i, j, k])));
                    let holds = |swap, row, line| {
                        masks.lines(swap, row, Lowers::new(lower..lower + 1)) >> line & 1 != 0
                    };
                    prop_assert_eq!((holds(false, v, u), holds(true, u, v)), (changes, changes));
                }
                prop_assert_eq!(found, expected);
                for (row, swap) in (0..P).flat_map(|row| [(row, false), (row, true)]) {
                    let at: Vec<u64> = (0..C)
                        .map(|lower| masks.lines(swap, row, Lowers::new(lower..lower + 1)))
                        .collect();
                    let union = |lowers: Range<usize>| at[lowers].iter().fold(0, |lines, bits| lines | bits);
                    for (start, end) in (0..C).flat_map(|start| (start..=C).map(move |end| (start, end))) {
                        let lines = masks.lines(swap, row, Lowers::new(start..end));
                        let asked = union(start..end);
                        let close = union(start..end.max(start + WINDOW).min(C));
                        prop_assert_eq!(lines & asked, asked);
                        prop_assert_eq!(lines | close, close);
                    }
                }
            }
        }
    }
}
