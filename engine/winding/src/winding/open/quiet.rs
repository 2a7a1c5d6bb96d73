//! Where a sum is next to nothing: cells whose samples are those of a field without it.
//!
//! The sum over a tree has in every cell a bound on its absolute value: that of the cell's polynomial, the error of this,
//! and what each cluster that the polynomial leaves out adds at most. These bounds use net moments, so clusters whose
//! elements face all ways count for little.
//!
//! A position is *quiet* if a cell that holds it, of at least [`LEAST_BITS`], has a bound within a limit. That depends on
//! the tree, the limit and the position alone: so a sample is quiet or not whatever brick it is a part of.

use super::cells::{CellId, Cells, TOP_BITS, TOP_LOW};
use super::{ClusterTree, Element};
use crate::brick::{POINTS, point_index};
use crate::lattice::{BRICK_CELLS, NodeKey, ROOT_BITS};

/// log₂ of the edge of the least cells: 128 of them along the root's edge.
const LEAST_BITS: u32 = ROOT_BITS - 7;

/// Which of a brick's samples are quiet.
pub(super) enum Marks {
    All,
    /// By sample.
    Some(Box<[bool; POINTS]>),
}

/// The quiet positions of a tree.
pub(super) struct Quiet<'a, E> {
    cells: Cells<'a, E>,
    limit: f64,
}

impl<'a, E: Element> Quiet<'a, E> {
    /// Where the sum is at most `limit`.
    pub fn new(tree: &'a ClusterTree<E>, limit: f64) -> Quiet<'a, E> {
        Quiet { cells: Cells::new(tree, limit), limit }
    }

    /// Whether all samples of a brick are.
    pub fn holds(&self, key: NodeKey) -> bool {
        self.visit_brick(key, &mut |_, quiet| quiet)
    }

    /// Which samples of a brick are.
    pub fn marks(&self, key: NodeKey) -> Marks {
        let mut marks = vec![false; POINTS].into_boxed_slice();
        let mut all = true;
        self.visit_brick(key, &mut |[from, to], quiet| {
            all &= quiet;
            if quiet {
                for k in from[2]..=to[2] {
                    for j in from[1]..=to[1] {
                        let row = point_index([0, j as usize, k as usize]);
                        marks[row + from[0] as usize..=row + to[0] as usize].fill(true);
                    }
                }
            }
            true
        });
        if all { Marks::All } else { Marks::Some(marks.try_into().expect("the length is POINTS")) }
    }

    /// Calls `part` with boxes of a brick's samples, first and last along each axis, and whether all of the box is quiet or
    /// none. Ends where `part` is false.
    fn visit_brick(&self, key: NodeKey, part: &mut impl FnMut([[i64; 3]; 2], bool) -> bool) -> bool {
        let spacing = key.spacing_bits();
        let base = key.base().map(|b| i64::from(b) - TOP_LOW);
        let bits = ROOT_BITS - u32::from(key.level());
        let place = base.map(|b| (b >> bits) as u32);
        (0..8u32).all(|octant| {
            let id = (bits, [0, 1, 2].map(|a| place[a] + (octant >> a & 1)));
            self.visit(id, (base, spacing), part)
        })
    }

    fn visit(
        &self,
        (bits, place): CellId,
        (base, spacing): ([i64; 3], u32),
        part: &mut impl FnMut([[i64; 3]; 2], bool) -> bool,
    ) -> bool {
        // Samples lie one unit above multiples of their spacing, so within a cell and never on its border.
        let number = |position: i64| (position + (1 << spacing) - 1) >> spacing;
        let low = |a: usize| i64::from(place[a]) << bits;
        let from = [0, 1, 2].map(|a| number(low(a) - base[a]).max(0));
        let to = [0, 1, 2].map(|a| (number(low(a) + (1 << bits) - base[a]) - 1).min(BRICK_CELLS as i64));
        if (0..3).any(|a| from[a] > to[a]) {
            return true;
        }
        if self.is_quiet((bits, place)) {
            return part([from, to], true);
        }
        if bits <= LEAST_BITS {
            return part([from, to], false);
        }
        (0..8u32).all(|octant| {
            let id = (bits - 1, [0, 1, 2].map(|a| 2 * place[a] + (octant >> a & 1)));
            self.visit(id, (base, spacing), part)
        })
    }

    /// Whether a cell's bound, or that of one around it, is within the limit. Cells below the least ones are as these.
    fn is_quiet(&self, (bits, place): CellId) -> bool {
        if bits < LEAST_BITS {
            let up = LEAST_BITS - bits;
            return self.is_quiet((LEAST_BITS, place.map(|c| c >> up)));
        }
        if bits > TOP_BITS {
            return false;
        }
        let known = self.cells.tree().made().quiet.get_or_make((self.limit.to_bits(), (bits, place)), || {
            self.is_quiet((bits + 1, place.map(|c| c >> 1)))
                || self.cells.magnitude((bits, place), self.limit) <= self.limit
        });
        *known
    }
}
