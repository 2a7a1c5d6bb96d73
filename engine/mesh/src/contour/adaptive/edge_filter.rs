//! Which edges of a leaf polygons are made for while it is found out which triangles meet.

use super::super::field::LevelSet;
use super::super::frame::CellFrame;
use super::super::frame::united;
use super::super::surface::EdgeRanks;
use super::bounds::Bounds;
use super::edge_box::EdgeBox;
use crate::brick::{Ranks, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};
use crate::wide::{dispatch, level};

/// A sign-changing edge: its place in the order of [`super::super::cells::BrickCells::take_quads`], its axis and its lower
/// sample.
pub(in super::super) type NumberedEdge = (u32, Axis, [u8; 3]);

/// More boxes than this are as good as one around all.
const MOST_BOXES: usize = 16;

/// All edges by default.
#[derive(Clone, Copy, Default)]
pub(in super::super) struct EdgeFilter<'a> {
    /// Only those in one of these boxes, or that touch `touching`.
    pub within: Option<&'a [EdgeBox]>,
    /// Only those with an end in this box of samples, or that are `within`.
    pub touching: Option<EdgeBox>,
    /// None in one of these.
    pub except: &'a [EdgeBox],
    /// Only those whose polygons have a vertex of several leaves.
    pub only_wide: bool,
}

impl EdgeFilter<'_> {
    /// The sign-changing edges that are wanted, in order, before their polygons are looked at.
    pub(in super::super) fn edges(&self, signs: &SignChanges, ranks: &EdgeRanks) -> Vec<NumberedEdge> {
        let mut found = Vec::new();
        let mut rows = self.rows(Axis::X);
        for (axis, ranks) in Axis::ALL.into_iter().zip(ranks) {
            if self.touching.is_some() && axis != Axis::X {
                rows = self.rows(axis);
            }
            dispatch!(level(), _simd => edges_in(signs, axis, ranks, &rows, &mut found));
        }
        found
    }

    /// The lower samples of those along an axis.
    fn rows(&self, axis: Axis) -> Rows {
        let mut boxes: Vec<EdgeBox> = match (self.within, self.touching) {
            (None, None) => vec![[[0; 3], [BRICK_POINTS as i32 - 1; 3]]],
            (within, _) => within.unwrap_or_default().to_vec(),
        };
        boxes.extend(self.touching.map(|[mut low, high]| {
            // An edge ends a sample above its lower one.
            low[axis.index()] = (low[axis.index()] - 1).max(0);
            [low, high]
        }));
        let mut rows = Rows::around(&boxes);
        boxes.iter().for_each(|own| rows.for_each(own, |row, along| *row |= along));
        self.except.iter().for_each(|own| rows.for_each(own, |row, along| *row &= !along));
        rows
    }
}

/// Lower samples of edges.
struct Rows {
    /// The least j and k of a row, and those after the last.
    ends: [[usize; 2]; 2],
    /// By row, j from fast to slow, a bit for each.
    bits: Vec<u64>,
}

impl Rows {
    /// None, in the rows that some boxes meet.
    fn around(boxes: &[EdgeBox]) -> Rows {
        let mut ends = [[BRICK_POINTS; 2], [0; 2]];
        for [low, high] in boxes {
            for n in 0..2 {
                ends[0][n] = ends[0][n].min(low[n + 1] as usize);
                ends[1][n] = ends[1][n].max(high[n + 1] as usize + 1);
            }
        }
        let count = |n: usize| ends[1][n].saturating_sub(ends[0][n]);
        Rows { ends, bits: vec![0; count(0) * count(1)] }
    }

    /// Calls `each` with the rows that a box meets, and its bits along them.
    fn for_each(&mut self, own: &EdgeBox, mut each: impl FnMut(&mut u64, u64)) {
        let [low, high] = own.map(|end| end.map(|c| c as usize));
        let along = u64::MAX << low[0] & u64::MAX >> (63 - high[0]);
        let [first, end] = self.ends;
        let range = |n: usize| low[n + 1].max(first[n])..(high[n + 1] + 1).min(end[n]);
        for k in range(1) {
            for j in range(0) {
                each(&mut self.bits[(k - first[1]) * (end[0] - first[0]) + j - first[0]], along);
            }
        }
    }
}

/// Adds the sign-changing edges along an axis with these lower samples. Compiled for this processor: bits are counted for
/// every edge.
#[inline(always)]
fn edges_in(
    signs: &SignChanges,
    axis: Axis,
    ranks: &Ranks,
    Rows { ends: [first, end], bits }: &Rows,
    found: &mut Vec<NumberedEdge>,
) {
    let mut wanted = bits.iter();
    for k in first[1]..end[1] {
        let layer = &ranks[k * BRICK_POINTS + first[0]..=k * BRICK_POINTS + end[0]];
        let wanted = wanted.by_ref().take(end[0] - first[0]);
        for ((j, ranks), wanted) in (first[0]..).zip(layer.windows(2)).zip(wanted) {
            // Most rows have no edge, or none that is wanted.
            if ranks[0] == ranks[1] || *wanted == 0 {
                continue;
            }
            let all = signs.edges(axis, j, k);
            let mut bits = all & wanted;
            while bits != 0 {
                let i = bits.trailing_zeros();
                bits &= bits - 1;
                let n = ranks[0] + (all & ((1 << i) - 1)).count_ones();
                found.push((n, axis, [i as u8, j as u8, k as u8]));
            }
        }
    }
}

/// Tells what edges of a leaf are near boxes of the world.
pub(super) struct EdgesNear {
    frame: CellFrame,
    /// How wide the cells of the coarsest leaf around are, in cells of the leaf.
    coarsest: f64,
}

impl EdgesNear {
    pub(super) fn of(field: &LevelSet, leaf: u32) -> EdgesNear {
        let frame = field.frame(field.leaves.get(leaf).key);
        EdgesNear { frame, coarsest: f64::from(1u32 << field.levels_up(leaf)) }
    }

    /// A box of the lower samples of the edges that are in or next to a box of the world, or `cells` away from it in cells of
    /// the coarsest leaf around. `None` if the leaf has none.
    pub(super) fn within(&self, bounds: &Bounds, cells: i32) -> Option<EdgeBox> {
        let reach = f64::from(cells) * self.coarsest;
        let [low, high] = bounds.map(|corner| self.frame.local(corner));
        let last = BRICK_CELLS as f64;
        // An edge ends a sample above its lower one.
        let low = low.map(|c| (c.floor() - 1.0 - reach).clamp(0.0, last + 1.0) as i32);
        let high = high.map(|c| (c.ceil() + reach).clamp(-1.0, last) as i32);
        (0..3).all(|a| low[a] <= high[a]).then_some([low, high])
    }
}

/// Boxes that hold all of these, less many: those that meet become one.
pub(super) fn gathered(all: impl Iterator<Item = Bounds>) -> Vec<Bounds> {
    let mut found: Vec<Bounds> = Vec::new();
    for mut own in all {
        while let Some(n) = found.iter().position(|other| super::bounds::meets(&own, other)) {
            own = united(own, found.swap_remove(n));
        }
        found.push(own);
        if found.len() > MOST_BOXES {
            found = found.into_iter().reduce(united).into_iter().collect();
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::super::surface::edge_ranks;
    use super::*;
    use proptest::prelude::*;

    fn edge_box() -> impl Strategy<Value = EdgeBox> {
        let ends = (prop::array::uniform3(0i32..33), prop::array::uniform3(0i32..12));
        ends.prop_map(|(low, size)| [low, std::array::from_fn(|a| (low[a] + size[a]).min(32))])
    }

    proptest! {
        #[test]
        fn edges_in_boxes_keep_their_numbers(
            seed in any::<u64>(),
            within in prop::option::of(prop::collection::vec(edge_box(), 0..4)),
            touching in prop::option::of(edge_box()),
            except in prop::collection::vec(edge_box(), 0..3),
        ) {
            let signs = SignChanges::from_fn(|n| (n as u64 ^ seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 61 == 0);
            let wanted = EdgeFilter { within: within.as_deref(), touching, except: &except, only_wide: false };
            let is_in = |boxes: &[EdgeBox], at: [usize; 3]| {
                let holds = |[low, high]: &EdgeBox| (0..3).all(|a| (low[a]..=high[a]).contains(&(at[a] as i32)));
                boxes.iter().any(holds)
            };
            let is_wanted = |axis: Axis, low: [usize; 3]| {
                let mut end = low;
                end[axis.index()] += 1;
                let touches = touching.map(|own| is_in(&[own], low) || is_in(&[own], end));
                let is_within = within.as_ref().map(|boxes| is_in(boxes, low));
                (touches, is_within) == (None, None) || touches == Some(true) || is_within == Some(true)
            };
            let (mut expected, mut n) = (Vec::new(), 0);
            for axis in Axis::ALL {
                signs.for_edges(axis, |low| {
                    if is_wanted(axis, low) && !is_in(&except, low) {
                        expected.push((n, axis, low.map(|c| c as u8)));
                    }
                    n += 1;
                });
            }
            prop_assert_eq!(wanted.edges(&signs, &edge_ranks(&signs)), expected);
        }

        #[test]
        fn gathered_boxes_hold_all(all in prop::collection::vec((prop::array::uniform3(0u8..40), 1u8..6), 0..40)) {
            let all: Vec<Bounds> =
                all.iter().map(|(low, size)| [low.map(f32::from), low.map(|c| f32::from(c + size))]).collect();
            let found = gathered(all.iter().copied());
            prop_assert!(found.len() <= MOST_BOXES);
            let is_in = |own: &Bounds, other: &Bounds| (0..3).all(|a| other[0][a] <= own[0][a] && own[1][a] <= other[1][a]);
            prop_assert!(all.iter().all(|own| found.iter().any(|other| is_in(own, other))));
        }
    }
}
