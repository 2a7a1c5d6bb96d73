//! Sets of lattice edges as bits over the lines of a row, so that a scan can leave out what nobody asks for.

use super::lines::{LINES_MAX, ROWS};
use crate::brick::SignChanges;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};
use crate::wide::{Simd, SimdBase, dispatch, level, u64x4};
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
#[derive(Default)]
pub struct EdgeMasks {
    /// Rows of equal v, a bit for every u.
    over_u: Rows,
    /// Rows of equal u, a bit for every v.
    over_v: Rows,
}

/// Rows, and some more without edges for those who look at [`ROWS`] at once.
const PADDED: usize = P + ROWS - 1;

/// By the lower samples of edges along their axis: the edges on each row's lines, a bit for every line.
struct Rows {
    at: Box<[[u64; PADDED]; C]>,
    /// Those of [`WINDOW`] lower samples from each on, or of as many as there are.
    from: Box<[[u64; PADDED]; C]>,
}

impl Default for Rows {
    fn default() -> Rows {
        let none = || Box::new([[0; PADDED]; C]);
        Rows { at: none(), from: none() }
    }
}

impl EdgeMasks {
    /// Takes the sign-changing edges along an axis, and calls `each` with their lower samples (i, j, k), in the order
    /// of the linear index.
    #[inline(always)]
    pub fn set<const A: usize>(&mut self, signs: &SignChanges, mut each: impl FnMut([usize; 3])) {
        let EdgeMasks { over_u, over_v } = self;
        over_u.at.fill([0; PADDED]);
        over_v.at.fill([0; PADDED]);
        signs.for_edges(Axis::ALL[A], |ijk| {
            let [lower, u, v] = [ijk[A], ijk[(A + 1) % 3], ijk[(A + 2) % 3]];
            over_u.at[lower][v] |= 1 << u;
            over_v.at[lower][u] |= 1 << v;
            each(ijk);
        });
        dispatch!(level(), simd => {
            over_u.unite(simd);
            over_v.unite(simd);
        });
    }

    /// The lines of a row and of the [`ROWS`] − 1 after it, of equal u if `swap` and of equal v if not, on which an
    /// edge lies. The edge begins at one of the samples `lowers`, and perhaps some on which one begins close behind
    /// them.
    #[inline(always)]
    pub fn lines<S: Simd>(&self, simd: S, swap: bool, row: usize, lowers: LowerRange) -> u64x4<S> {
        let over = if swap { &self.over_v } else { &self.over_u };
        let LowerRange { first, last, few } = lowers;
        let table = if few { &over.at } else { &over.from };
        let mut all = u64x4::from_slice(simd, &table[first][row..row + ROWS])
            | u64x4::from_slice(simd, &table[last][row..row + ROWS]);
        let mut lower = first + WINDOW;
        while lower < last {
            all |= u64x4::from_slice(simd, &table[lower][row..row + ROWS]);
            lower += WINDOW;
        }
        all
    }
}

/// A range of lower samples, as [`EdgeMasks::lines`] takes it.
#[derive(Clone, Copy)]
pub struct LowerRange {
    first: usize,
    /// The last sample or, of many, where the last window begins.
    last: usize,
    /// Two at most, for which no window is needed.
    few: bool,
}

impl LowerRange {
    /// The samples of the range, of which there are [`C`]; those of an empty one do not matter.
    #[inline(always)]
    pub fn new(range: Range<usize>) -> LowerRange {
        let first = range.start.min(C - 1);
        let few = range.end <= first + 2;
        let back = if few { 1 } else { WINDOW };
        LowerRange { first, last: range.end.saturating_sub(back).max(first), few }
    }
}

impl Rows {
    #[inline(always)]
    fn unite<S: Simd>(&mut self, _: S) {
        const { assert!(WINDOW == 4) };
        let mut two = [[0; PADDED]; C];
        for (lower, two) in two.iter_mut().enumerate() {
            let next = self.at.get(lower + 1).unwrap_or(&[0; PADDED]);
            *two = std::array::from_fn(|row| self.at[lower][row] | next[row]);
        }
        for (lower, from) in self.from.iter_mut().enumerate() {
            let next = two.get(lower + 2).unwrap_or(&[0; PADDED]);
            *from = std::array::from_fn(|row| two[lower][row] | next[row]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::point_index;
    use proptest::prelude::*;

    /// The lines of one row.
    fn lines_of(masks: &EdgeMasks, swap: bool, row: usize, lowers: Range<usize>) -> u64 {
        dispatch!(level(), simd => masks.lines(simd, swap, row, LowerRange::new(lowers))[0])
    }

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
            for axis in Axis::ALL {
                let mut found = Vec::new();
                let each = |ijk| found.push(point_index(ijk));
                match axis {
                    Axis::X => masks.set::<0>(&signs, each),
                    Axis::Y => masks.set::<1>(&signs, each),
                    Axis::Z => masks.set::<2>(&signs, each),
                }
                let mut expected = Vec::new();
                for (k, j, i) in (0..P).flat_map(|k| (0..P).flat_map(move |j| (0..P).map(move |i| (k, j, i)))) {
                    let at = [i, j, k];
                    let [lower, u, v] = [0, 1, 2].map(|turn| at[(axis.index() + turn) % 3]);
                    if lower == C {
                        continue;
                    }
                    let mut next = at;
                    next[axis.index()] += 1;
                    let changes = inside(point_index([i, j, k])) != inside(point_index(next));
                    expected.extend(changes.then_some(point_index([i, j, k])));
                    let holds = |swap, row, line| {
                        lines_of(&masks, swap, row, lower..lower + 1) >> line & 1 != 0
                    };
                    prop_assert_eq!((holds(false, v, u), holds(true, u, v)), (changes, changes));
                }
                prop_assert_eq!(found, expected);
                for (row, swap) in (0..P).flat_map(|row| [(row, false), (row, true)]) {
                    let at: Vec<u64> = (0..C)
                        .map(|lower| lines_of(&masks, swap, row, lower..lower + 1))
                        .collect();
                    let union = |lowers: Range<usize>| at[lowers].iter().fold(0, |lines, bits| lines | bits);
                    for (start, end) in (0..C).flat_map(|start| (start..=C).map(move |end| (start, end))) {
                        let lines = lines_of(&masks, swap, row, start..end);
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
