//! Where the lines stand.

use crate::lattice::{GOLDEN, Units, mix};
use std::ops::Range;

/// Lines in each stratum.
pub(super) const LINES: usize = 2;

/// A grid over a box of the lattice, with two stretches of lines along z in each cell.
pub(super) struct Strata {
    /// Lower corner, in units.
    low: [f64; 3],
    /// Cells along each axis.
    counts: [u32; 3],
    /// Extent of a cell, in units.
    cell: [f64; 3],
    /// Where each line stands, if there are not too many: asked for more often than there are lines.
    positions: Vec<[i32; 2]>,
}

/// Lines whose positions are kept, at most: a megabyte.
const KEPT_LINES: usize = 1 << 17;

/// Cells that a shape's box touches at most if each of them is looked at. Beyond, the cells outside the shape are left out.
const CELLS_OF_BOX: u32 = 4;

impl Strata {
    /// About `lines` lines in sheets of this thickness along the first axis, of which one begins at `edge`; their cells are
    /// about square along the others.
    pub fn sheets(low: Units, high: Units, (thickness, edge): (f64, f64), lines: usize) -> Strata {
        let strata = (lines / LINES).max(1) as f64;
        let thickness = if thickness > 0.0 { thickness } else { f64::from(high[0] - low[0]) };
        let below = ((edge - f64::from(low[0])) / thickness).ceil().max(0.0);
        let extent = extent(low, high);
        let begin = edge - below * thickness;
        let sheets = ((f64::from(low[0]) + extent[0] - begin) / thickness).ceil().clamp(1.0, strata);
        let of_sheet = strata / sheets;
        let across = (of_sheet * extent[1] / extent[2]).sqrt().clamp(1.0, of_sheet.max(1.0)).round();
        let counts = [sheets, across, (of_sheet / across).round().max(1.0)];
        let mut strata = Strata::new(low, extent, counts);
        strata.low[0] = begin;
        strata.cell[0] = thickness.max((f64::from(high[0]) - begin) / sheets);
        strata.with_positions()
    }

    /// About `lines` lines from one end of the box to the other.
    pub fn columns(low: Units, high: Units, lines: usize) -> Strata {
        let extent = extent(low, high);
        let strata = (lines / LINES).max(1) as f64;
        let along = (strata * extent[0] / extent[1]).sqrt().clamp(1.0, strata).round();
        Strata::new(low, extent, [along, (strata / along).round().max(1.0), 1.0]).with_positions()
    }

    fn new(low: Units, extent: [f64; 3], counts: [f64; 3]) -> Strata {
        let cell = [0, 1, 2].map(|a| extent[a] / counts[a]);
        let counts = counts.map(|count| count as u32);
        Strata { low: low.map(f64::from), counts, cell, positions: Vec::new() }
    }

    /// The same with the positions found, once the grid is as it will be.
    fn with_positions(mut self) -> Strata {
        let kept = if self.len() <= KEPT_LINES { self.len() } else { 0 };
        self.positions = (0..kept as u32).map(|line| self.placed(line)).collect();
        self
    }

    /// How many lines there are.
    pub fn len(&self) -> usize {
        self.counts.iter().map(|&count| count as usize).product::<usize>() * LINES
    }

    /// Position of a line.
    #[inline]
    pub fn position(&self, line: u32) -> [i32; 2] {
        self.positions.get(line as usize).copied().unwrap_or_else(|| self.placed(line))
    }

    fn placed(&self, line: u32) -> [i32; 2] {
        let stratum = line / LINES as u32;
        let at = [stratum % self.counts[0], stratum / self.counts[0] % self.counts[1]];
        // Odd, as samples are: no line passes through a vertex.
        [0, 1].map(|a| {
            let within = unit_random(u64::from(line) * 2 + a as u64);
            (self.low[a] + (f64::from(at[a]) + within) * self.cell[a]) as i32 | 1
        })
    }

    /// Extent of a stratum, in units.
    pub fn cell(&self) -> [f64; 3] {
        self.cell
    }

    /// The rectangle that each line stands for, in square units.
    pub fn area_of_line(&self) -> f64 {
        self.cell[0] * self.cell[1] / LINES as f64
    }

    /// The lower and upper end of a line.
    pub fn ends(&self, line: u32) -> (f64, f64) {
        let slab = line / LINES as u32 / (self.counts[0] * self.counts[1]);
        let end = |slab: u32| self.low[2] + f64::from(slab) * self.cell[2];
        (end(slab), end(slab + 1))
    }

    /// The lines in as few parts as `memory` has room for if all take `bytes`, but 64 at most; each has whole blocks of so
    /// many strata, so that sums by blocks do not depend on it.
    pub fn parts(&self, bytes: f64, memory: u64, block: usize) -> impl Iterator<Item = Range<u32>> + use<> {
        let strata = self.len() / LINES;
        let parts = (bytes / memory.max(1) as f64).ceil().clamp(1.0, 64.0) as usize;
        let a_part = strata.div_ceil(parts).next_multiple_of(block);
        let lines = |stratum: usize| (stratum * LINES) as u32;
        (0..strata).step_by(a_part).map(move |first| lines(first)..lines((first + a_part).min(strata)))
    }

    /// Calls `each` with the number and the position of every line of `numbers` that `shape` may meet.
    #[inline]
    pub fn near(&self, shape: &LineQuery<'_>, numbers: &Range<u32>, mut each: impl FnMut(u32, [i32; 2])) {
        let (min, max) = shape.bounds;
        let of_box = [0, 1, 2].map(|a| self.cells(a, f64::from(min[a]), f64::from(max[a])));
        let is_small = of_box.iter().map(|cells| cells.end - cells.start).product::<u32>() <= CELLS_OF_BOX;
        for row in of_box[1].clone() {
            let [mut columns, _, mut slabs] = of_box.clone();
            if !is_small {
                let low = self.low[1] + f64::from(row) * self.cell[1];
                let Some((from, to)) = shape.extent(low, low + self.cell[1]) else { continue };
                let (low, high) = (f64::from(min[shape.axis]), f64::from(max[shape.axis]));
                let within = self.cells(shape.axis, from.max(low), to.min(high));
                *(if shape.axis == 0 { &mut columns } else { &mut slabs }) = within;
            }
            for slab in slabs {
                let first = (slab * self.counts[1] + row) * self.counts[0];
                let [start, end] = [columns.start, columns.end].map(|c| (first + c) * LINES as u32);
                for number in start.max(numbers.start)..end.min(numbers.end) {
                    let at = self.position(number);
                    if (0..2).all(|a| min[a] <= at[a] && at[a] <= max[a]) {
                        each(number, at);
                    }
                }
            }
        }
    }

    /// The cells along an axis that a stretch of it touches.
    #[inline]
    fn cells(&self, axis: usize, from: f64, to: f64) -> Range<u32> {
        if self.counts[axis] == 1 {
            return 0..1;
        }
        // A position may be rounded up by one unit.
        let of = |at: f64| ((at - self.low[axis]) / self.cell[axis]) as i64;
        let last = i64::from(self.counts[axis]) - 1;
        of(from - 1.0).clamp(0, last) as u32..of(to + 1.0).clamp(0, last) as u32 + 1
    }
}

/// What lines are sought for: within a box, and, along its `axis` and the second one, no farther than `reach` from the hull
/// of some corners.
pub(super) struct LineQuery<'a> {
    pub bounds: (Units, Units),
    pub axis: usize,
    pub corners: &'a [[f64; 2]],
    pub reach: f64,
}

impl LineQuery<'_> {
    /// The stretch along its axis of what lies between two places along the second axis.
    #[inline]
    fn extent(&self, low: f64, high: f64) -> Option<(f64, f64)> {
        let (low, high) = (low - self.reach - 1.0, high + self.reach + 1.0);
        let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
        for (n, p) in self.corners.iter().enumerate() {
            let q = self.corners[(n + 1) % self.corners.len()];
            let (lower, upper) = if p[1] <= q[1] { (*p, q) } else { (q, *p) };
            if upper[1] < low || lower[1] > high {
                continue;
            }
            let rise = upper[1] - lower[1];
            let at = |y: f64| lower[0] + (upper[0] - lower[0]) * ((y - lower[1]) / rise);
            let first = if lower[1] < low { at(low) } else { lower[0] };
            let last = if upper[1] > high { at(high) } else { upper[0] };
            from = from.min(first.min(last));
            to = to.max(first.max(last));
        }
        (from <= to).then_some((from - self.reach - 1.0, to + self.reach + 1.0))
    }
}

/// Extents of a box, none of which is 0.
fn extent(low: Units, high: Units) -> [f64; 3] {
    [0, 1, 2].map(|a| f64::from((high[a] - low[a]).max(2)))
}

/// A number in 0..1 that follows from `seed`.
fn unit_random(seed: u64) -> f64 {
    (mix(seed.wrapping_add(1).wrapping_mul(GOLDEN)) >> 11) as f64 / (1u64 << 53) as f64
}
