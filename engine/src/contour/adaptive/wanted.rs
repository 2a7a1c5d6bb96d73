//! Which edges of a leaf polygons are made for while it is found out which triangles meet.

use super::super::field::Field;
use super::super::surface::EdgeRanks;
use super::bounds::Bounds;
use crate::brick::SignChanges;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};
use crate::wide::{dispatch, level};

/// The least and the greatest lower samples of edges, by axis.
pub(in super::super) type EdgeBox = [[i32; 3]; 2];

/// A sign-changing edge: its place in the order of [`super::super::cells::BrickCells::take_quads`], its axis and its lower
/// sample.
pub(in super::super) type NumberedEdge = (u32, Axis, [u8; 3]);

/// More boxes than this are as good as one around all.
const MOST_BOXES: usize = 16;

/// All edges by default.
#[derive(Clone, Copy, Default)]
pub(in super::super) struct Wanted<'a> {
    /// Only those in one of these boxes.
    pub within: Option<&'a [EdgeBox]>,
    /// None in one of these.
    pub except: &'a [EdgeBox],
    /// Only those whose polygons have a vertex of several leaves.
    pub only_wide: bool,
}

impl Wanted<'_> {
    /// The sign-changing edges that are wanted, in order, before their polygons are looked at.
    pub(in super::super) fn edges(&self, signs: &SignChanges, ranks: &EdgeRanks) -> Vec<NumberedEdge> {
        let mut rows = match self.within {
            None => vec![u64::MAX; ROWS],
            Some(boxes) => rows_of(boxes),
        };
        if !self.except.is_empty() {
            rows.iter_mut().zip(rows_of(self.except)).for_each(|(row, except)| *row &= !except);
        }
        dispatch!(level(), _simd => edges_in(signs, ranks, &rows))
    }
}

/// Rows of samples of a leaf.
const ROWS: usize = BRICK_POINTS * BRICK_POINTS;

/// By row, k·33 + j, a bit for each lower sample in one of some boxes.
fn rows_of(boxes: &[EdgeBox]) -> Vec<u64> {
    let mut rows = vec![0; ROWS];
    for [low, high] in boxes.iter().map(|ends| ends.map(|end| end.map(|c| c as usize))) {
        let along = u64::MAX << low[0] & u64::MAX >> (63 - high[0]);
        for k in low[2]..=high[2] {
            rows[k * BRICK_POINTS..][low[1]..=high[1]].iter_mut().for_each(|row| *row |= along);
        }
    }
    rows
}

/// The sign-changing edges with these lower samples. Compiled for this processor: bits are counted for every edge.
#[inline(always)]
fn edges_in(signs: &SignChanges, ranks: &EdgeRanks, rows: &[u64]) -> Vec<NumberedEdge> {
    let mut found = Vec::new();
    for (axis, ranks) in Axis::ALL.into_iter().zip(ranks) {
        for (row, wanted) in rows.iter().enumerate().filter(|(_, wanted)| **wanted != 0) {
            let (j, k) = (row % BRICK_POINTS, row / BRICK_POINTS);
            let all = signs.edges(axis, j, k);
            let mut bits = all & wanted;
            while bits != 0 {
                let i = bits.trailing_zeros();
                bits &= bits - 1;
                let n = ranks[row] + (all & ((1 << i) - 1)).count_ones();
                found.push((n, axis, [i as u8, j as u8, k as u8]));
            }
        }
    }
    found
}

/// A box of the lower samples of the edges of a leaf that are in or next to a box of the world, or `cells` away from
/// it in cells of the coarsest leaf around. `None` if the leaf has none.
pub(super) fn edges_near(field: &Field, leaf: u32, bounds: &Bounds, cells: i32) -> Option<EdgeBox> {
    let key = field.leaves.get(leaf).key;
    let reach = f64::from(cells) * f64::from(1u32 << field.levels_up(leaf));
    let frame = field.frame(key);
    let [low, high] = bounds.map(|corner| frame.local(corner));
    let last = BRICK_CELLS as f64;
    // An edge ends a sample above its lower one.
    let low = low.map(|c| (c.floor() - 1.0 - reach).clamp(0.0, last + 1.0) as i32);
    let high = high.map(|c| (c.ceil() + reach).clamp(-1.0, last) as i32);
    (0..3).all(|a| low[a] <= high[a]).then_some([low, high])
}

/// What two boxes have in common.
pub(super) fn common([low, high]: &EdgeBox, other: &EdgeBox) -> Option<EdgeBox> {
    let low: [i32; 3] = std::array::from_fn(|a| low[a].max(other[0][a]));
    let high = std::array::from_fn(|a| high[a].min(other[1][a]));
    (0..3).all(|a| low[a] <= high[a]).then_some([low, high])
}

/// Boxes that hold all of these, less many: those that meet become one.
pub(super) fn gathered(all: impl Iterator<Item = Bounds>) -> Vec<Bounds> {
    let mut found: Vec<Bounds> = Vec::new();
    for mut own in all {
        while let Some(n) = found.iter().position(|other| super::bounds::meets(&own, other)) {
            own = super::super::united(own, found.swap_remove(n));
        }
        found.push(own);
        if found.len() > MOST_BOXES {
            found = found.into_iter().reduce(super::super::united).into_iter().collect();
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
            except in prop::collection::vec(edge_box(), 0..3),
        ) {
            let signs = SignChanges::from_fn(|n| (n as u64 ^ seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 61 == 0);
            let wanted = Wanted { within: within.as_deref(), except: &except, only_wide: false };
            let is_in = |boxes: &[EdgeBox], at: [usize; 3]| {
                let holds = |[low, high]: &EdgeBox| (0..3).all(|a| (low[a]..=high[a]).contains(&(at[a] as i32)));
                boxes.iter().any(holds)
            };
            let (mut expected, mut n) = (Vec::new(), 0);
            for axis in Axis::ALL {
                signs.for_edges(axis, |low| {
                    if within.as_ref().is_none_or(|boxes| is_in(boxes, low)) && !is_in(&except, low) {
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
