//! Which lines of a block a scan looks at.

use crate::wide::{Simd, SimdBase, u64x4};

/// Rows that are looked at together: as many words as are a vector of most processors.
pub(super) const ROWS: usize = 4;

/// Lines in a row, at most: a row's lines are the bits of a word, of which a scan keeps one free.
pub(super) const LINES_MAX: i32 = 63;

/// Which edges a scan asks for. A row's lines have equal v, or equal u if `swap`.
pub(super) trait EdgeSelection {
    /// The lines of a row and of those after it that matter, as bits.
    fn lines<S: Simd>(&self, simd: S, swap: bool, row: usize) -> u64x4<S>;
}

/// Every edge.
pub(super) struct AllEdges;

impl EdgeSelection for AllEdges {
    #[inline(always)]
    fn lines<S: Simd>(&self, simd: S, _: bool, _: usize) -> u64x4<S> {
        u64x4::splat(simd, u64::MAX)
    }
}

/// Rows of equal v, a bit for every u of [`ThinLines::Sixteenth`](crate::brick::ThinLines::Sixteenth).
const SOME_OF_V: [u64; PADDED] = some_lines(false);
/// Rows of equal u, a bit for every v.
const SOME_OF_U: [u64; PADDED] = some_lines(true);
/// All rows of a block, and more for those who look at [`ROWS`] at once.
const PADDED: usize = LINES_MAX as usize + ROWS;

/// The lines of [`ThinLines::holds`](crate::brick::ThinLines::holds); rows have equal u if `swap`.
const fn some_lines(swap: bool) -> [u64; PADDED] {
    let mut rows = [0; PADDED];
    let mut row = 0;
    while row < PADDED {
        let mut line = 0;
        while line < 64 {
            let (u, v) = if swap { (row, line) } else { (line, row) };
            if (u + 4 * v) % 16 == 0 {
                rows[row] |= 1 << line;
            }
            line += 1;
        }
        row += 1;
    }
    rows
}

/// The edges on the lines of [`ThinLines::Sixteenth`](crate::brick::ThinLines::Sixteenth).
pub(super) struct Sixteenth;

impl EdgeSelection for Sixteenth {
    #[inline(always)]
    fn lines<S: Simd>(&self, simd: S, swap: bool, row: usize) -> u64x4<S> {
        let rows = if swap { &SOME_OF_U } else { &SOME_OF_V };
        u64x4::from_slice(simd, &rows[row..row + ROWS])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::ThinLines;

    #[test]
    fn one_line_in_each_block_of_sixteen() {
        for (u, v) in (0..LINES_MAX as usize).flat_map(|u| (0..LINES_MAX as usize).map(move |v| (u, v))) {
            let holds = ThinLines::Sixteenth.holds(u, v);
            assert_eq!((SOME_OF_V[v] >> u & 1 == 1, SOME_OF_U[u] >> v & 1 == 1), (holds, holds), "{u} {v}");
            if u % 4 == 0 && v % 4 == 0 && u.max(v) + 3 < LINES_MAX as usize {
                let block = (0..16).filter(|n| ThinLines::Sixteenth.holds(u + n % 4, v + n / 4)).count();
                assert_eq!(block, 1, "{u} {v}");
            }
        }
    }
}
