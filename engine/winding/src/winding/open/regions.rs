//! Where a sum is easy: cells in which it is next to nothing, and cells in which one polynomial gives it.
//!
//! The sum over a tree has in every cell a bound on its absolute value: that of the cell's polynomial, the error of this,
//! and what each cluster that the polynomial leaves out adds at most. These bounds use net moments, so clusters whose
//! elements face all ways count for little. A cell is *quiet* if its bound is within a limit.
//!
//! It is *smooth* if a polynomial takes all clusters within the error. It is as its parent where that is quiet or smooth,
//! and cells below the least are as the one that holds them.
//!
//! All of this depends on the tree, the limits, the least cells and the cell alone: so a sample has one value whatever brick it is a part of.

use super::SurfaceElement;
use super::cell::CellId;
use super::cells::{BoundedTree, TOP_BITS, TOP_LOW};
use super::region::CellSum;
use crate::lattice::{BRICK_CELLS, NodeKey, ROOT_BITS};
use std::sync::Arc;

/// Samples of a brick in a cell: the first and the last along each axis.
pub(super) type Range3 = [[usize; 3]; 2];

/// The regions of a tree.
pub(super) struct CellSums<'a, E> {
    cells: BoundedTree<'a, E>,
    limit: f64,
    least: u32,
}

impl<'a, E: SurfaceElement> CellSums<'a, E> {
    /// For sums that are off by at most the error of `cells`; where they are at most `limit`, they are 0. The least cells
    /// have an edge of 2^least.
    pub fn new(cells: BoundedTree<'a, E>, limit: f64, least: u32) -> CellSums<'a, E> {
        CellSums { cells, limit, least }
    }

    /// Whether all samples of a brick are quiet.
    pub fn are_quiet(&self, key: NodeKey) -> bool {
        self.visit(key, &mut |_, region| matches!(region, CellSum::Quiet))
    }

    /// Calls `part` with the parts of a brick's samples that lie in one region each, until it is false.
    pub fn visit(&self, key: NodeKey, part: &mut impl FnMut(Range3, &CellSum) -> bool) -> bool {
        let spacing = key.spacing_bits();
        let base = key.base().map(|b| i64::from(b) - TOP_LOW);
        let bits = ROOT_BITS - u32::from(key.level());
        let place = base.map(|b| (b >> bits) as u32);
        (0..8u32).all(|octant| {
            let id = (bits, [0, 1, 2].map(|a| place[a] + (octant >> a & 1)));
            self.visit_cell(id, (base, spacing), part)
        })
    }

    fn visit_cell(
        &self,
        (bits, place): CellId,
        (base, spacing): ([i64; 3], u32),
        part: &mut impl FnMut(Range3, &CellSum) -> bool,
    ) -> bool {
        // Samples lie one unit above multiples of their spacing, so within a cell and never on its border.
        let number = |position: i64| (position + (1 << spacing) - 1) >> spacing;
        let low = |a: usize| i64::from(place[a]) << bits;
        let from = [0, 1, 2].map(|a| number(low(a) - base[a]).max(0));
        let to = [0, 1, 2].map(|a| (number(low(a) + (1 << bits) - base[a]) - 1).min(BRICK_CELLS as i64));
        if (0..3).any(|a| from[a] > to[a]) {
            return true;
        }
        let region = self.region((bits, place));
        if bits <= self.least || !matches!(*region, CellSum::Rough) {
            return part([from, to].map(|at| at.map(|c| c as usize)), &region);
        }
        (0..8u32).all(|octant| {
            let id = (bits - 1, [0, 1, 2].map(|a| 2 * place[a] + (octant >> a & 1)));
            self.visit_cell(id, (base, spacing), part)
        })
    }

    fn region(&self, (bits, place): CellId) -> Arc<CellSum> {
        if bits < self.least {
            let up = self.least - bits;
            return self.region((self.least, place.map(|c| c >> up)));
        }
        if bits > TOP_BITS {
            return Arc::new(CellSum::Rough);
        }
        let key = (self.limit.to_bits(), self.least, (bits, place));
        let made = &self.cells.tree().made().regions;
        Arc::clone(&made.get_or_make(key, || {
            let above = self.region((bits + 1, place.map(|c| c >> 1)));
            if matches!(*above, CellSum::Rough) { Arc::new(self.find((bits, place))) } else { above }
        }))
    }

    fn find(&self, id: CellId) -> CellSum {
        if self.cells.magnitude(id, self.limit) <= self.limit {
            return CellSum::Quiet;
        }
        match self.cells.as_polynomial(id) {
            Some((center, local)) => CellSum::Smooth(center, Box::new(local)),
            None => CellSum::Rough,
        }
    }
}
