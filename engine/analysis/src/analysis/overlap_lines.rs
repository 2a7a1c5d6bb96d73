//! What passes have in common along lines through a leaf.
//!
//! Along a line each pass is a union of few intervals. In the order in which these begin, all pairs that overlap are found by one
//! sweep. Lines are taken together by a counting sort, in passes over arrays.

use super::overlap_pairs::LeafPairs;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, GOLDEN, NodeKey, mix};
use crate::solid::{Segment, Solids, for_lines};
use std::ops::Range;

/// log₂ of the parts of a unit in which chords count.
pub(super) const PART_BITS: u32 = 13;
/// Lines along an axis that a cell has, and parts of each of its sides that they stand in.
pub(super) const LINES: usize = SIDE * SIDE;
const SIDE: usize = 2;
/// Lines of one kind that a brick owns.
const OWN_LINES: usize = BRICK_CELLS * BRICK_CELLS;

/// A segment of a pass, or the round end where it follows the pass before.
pub(super) struct PassPiece {
    pub segment: Segment,
    /// Place of its pass in the leaf's list.
    pub pass: u32,
    pub is_joint: bool,
    pub source_line: u64,
}

/// Where a piece lies on a line, in parts.
#[derive(Clone, Copy, Default)]
struct Stretch {
    from: i64,
    to: i64,
    piece: u32,
    line: u32,
}

/// An interval of the union of a pass on a line.
#[derive(Clone)]
struct Interval {
    from: i64,
    to: i64,
    pass: u32,
    /// The stretches of the pass on the line.
    stretches: Range<u32>,
}

/// Adds the chords that passes have in common in a leaf; pieces are in the order of their passes.
pub(super) fn add_chords(key: NodeKey, solids: &Solids, pieces: &[PassPiece], pairs: &mut LeafPairs) {
    let mut scratch = LineScratch::default();
    for axis in Axis::ALL {
        let draws = draws(key, axis);
        for beside in &draws {
            let lines = Lines { key, axis, beside, pieces };
            lines.find(solids, &mut scratch);
            lines.add(&mut scratch, pairs);
        }
    }
}

/// How far beyond each own sample (j, k) the lines of a cell along an axis stand, in 256ths of a cell. They stand anywhere in
/// their part of the cell, by a fixed draw, since lines through samples would all meet a bead that is in step with the cells in the same way.
/// Each brick draws anew, since a bead along an axis would be met alike in all bricks along it.
fn draws(key: NodeKey, axis: Axis) -> [Vec<[u8; 2]>; LINES] {
    let [first, second] = axis.others_in_order().map(|a| u64::from(key.first_sample()[a.index()]));
    let along = mix(u64::from(key.first_sample()[axis.index()]));
    let cells = (0..OWN_LINES).map(|line| {
        let (j, k) = ((line % BRICK_CELLS) as u64, (line / BRICK_CELLS) as u64);
        mix(along ^ ((first + j) << 32 | (second + k)))
    });
    let cells: Vec<u64> = cells.collect();
    std::array::from_fn(|number| {
        let place = (axis.index() * LINES + number) as u64;
        let part = [number % SIDE, number / SIDE];
        let beside = |cell: &u64| {
            let drawn = mix(cell ^ place.wrapping_mul(GOLDEN));
            [0, 1].map(|n| (256 / SIDE * part[n]) as u8 + ((drawn >> (8 * n)) % (256 / SIDE as u64)) as u8)
        };
        cells.iter().map(beside).collect()
    })
}

/// Working memory, used again for every set of lines.
#[derive(Default)]
struct LineScratch {
    found: Vec<Stretch>,
    /// The same, line by line, and where each line's begin.
    sorted: Vec<Stretch>,
    starts: Vec<u32>,
    intervals: Vec<Interval>,
}

/// One line of each cell along an axis.
struct Lines<'a> {
    key: NodeKey,
    axis: Axis,
    beside: &'a [[u8; 2]],
    pieces: &'a [PassPiece],
}

impl Lines<'_> {
    /// Finds where the pieces lie on the lines.
    fn find(&self, solids: &Solids, scratch: &mut LineScratch) {
        let Lines { key, axis, beside, pieces } = *self;
        let first = f64::from(key.base()[axis.index()]) * f64::from(1u32 << PART_BITS);
        let last = first
            + (BRICK_CELLS as f64) * f64::from(1u32 << key.spacing_bits()) * f64::from(1u32 << PART_BITS);
        // Lines with an index of 32 belong to the next brick.
        let place = |j: usize, k: usize| (k % BRICK_CELLS) * BRICK_CELLS + j % BRICK_CELLS;
        let beside = |j: usize, k: usize| beside[place(j, k)].map(|part| f64::from(part) / 256.0);
        // The root's first sample stands at (1, 1, 1).
        let part = |c: f64| rounded(((c - 1.0) * f64::from(1u32 << PART_BITS)).clamp(first, last));
        scratch.found.clear();
        scratch.starts.clear();
        scratch.starts.resize(OWN_LINES + 1, 0);
        for (number, piece) in pieces.iter().enumerate() {
            for_lines(solids, key, &piece.segment, axis, beside, |line, ends| {
                let (j, k) = (line % BRICK_POINTS, line / BRICK_POINTS);
                let (from, to) = (part(ends.0), part(ends.1));
                if from < to && j < BRICK_CELLS && k < BRICK_CELLS {
                    let line = place(j, k);
                    scratch.starts[line + 1] += 1;
                    scratch.found.push(Stretch { from, to, piece: number as u32, line: line as u32 });
                }
            });
        }
    }

    /// Adds what passes have in common on the lines.
    fn add(&self, scratch: &mut LineScratch, pairs: &mut LeafPairs) {
        let LineScratch { found, sorted, starts, intervals } = scratch;
        for line in 0..OWN_LINES {
            starts[line + 1] += starts[line];
        }
        sorted.clear();
        sorted.resize(found.len(), Stretch::default());
        for stretch in found.iter() {
            let next = &mut starts[stretch.line as usize];
            sorted[*next as usize] = *stretch;
            *next += 1;
        }
        // Each line's beginning has become its end.
        let mut from = 0;
        for (line, &end) in starts[..OWN_LINES].iter().enumerate() {
            let to = end as usize;
            let stretches = &mut sorted[from..to];
            from = to;
            if stretches.len() > 1 {
                self.intervals(stretches, intervals);
                self.sweep(line, stretches, intervals, pairs);
            }
        }
    }

    /// The intervals of all passes on a line, in the order in which they begin.
    fn intervals(&self, stretches: &mut [Stretch], intervals: &mut Vec<Interval>) {
        intervals.clear();
        let pass = |s: &Stretch| self.pieces[s.piece as usize].pass;
        let mut first = 0;
        let mut before = None;
        while first < stretches.len() {
            let number = pass(&stretches[first]);
            let count = stretches[first..].iter().take_while(|s| pass(s) == number).count();
            let range = first as u32..(first + count) as u32;
            let interval = |(from, to)| Interval { from, to, pass: number, stretches: range.clone() };
            let own = &mut stretches[first..first + count];
            if let [s] = own
                && !self.pieces[s.piece as usize].is_joint
            {
                intervals.push(interval((s.from, s.to)));
            } else {
                own.sort_unstable_by_key(|s| (s.from, s.to));
                let before = before
                    .filter(|(pass, _)| pass + 1 == number)
                    .map(|(_, range): (u32, Range<usize>)| range);
                intervals
                    .extend(self.whole(stretches, first..first + count, before).into_iter().map(interval));
            }
            before = Some((number, first..first + count));
            first += count;
        }
        intervals.sort_unstable_by_key(|interval| interval.from);
    }

    /// The union of a pass, of which stretches are sorted. What its joint has in common with the pass before counts once.
    fn whole(
        &self,
        stretches: &[Stretch],
        own: Range<usize>,
        before: Option<Range<usize>>,
    ) -> Vec<(i64, i64)> {
        let is_joint = |s: &&Stretch| self.pieces[s.piece as usize].is_joint;
        let union = |range: Range<usize>| merge(stretches[range].iter().filter(|s| !is_joint(s)));
        let joint: Vec<(i64, i64)> =
            stretches[own.clone()].iter().filter(is_joint).map(|s| (s.from, s.to)).collect();
        match before.filter(|_| !joint.is_empty()) {
            Some(before) => without(&union(own), &common(&joint, &union(before))),
            None => union(own),
        }
    }

    /// Adds what intervals of different passes have in common.
    fn sweep(&self, line: usize, stretches: &[Stretch], intervals: &[Interval], pairs: &mut LeafPairs) {
        let mut doubled = self.doubled(line);
        for (n, one) in intervals.iter().enumerate() {
            for other in intervals[n + 1..].iter().take_while(|other| other.from < one.to) {
                if one.pass == other.pass {
                    continue;
                }
                let (from, to) = (other.from, one.to.min(other.to));
                doubled[self.axis.index()] = from + to;
                let (one, other) = if one.pass < other.pass { (one, other) } else { (other, one) };
                let pair = pairs.of(one.pass, other.pass);
                pair.add_chord(self.axis, to - from, doubled);
                for (side, interval) in [one, other].into_iter().enumerate() {
                    let Range { start, end } = interval.stretches;
                    for s in
                        stretches[start as usize..end as usize].iter().filter(|s| s.from < to && from < s.to)
                    {
                        let piece = &self.pieces[s.piece as usize];
                        if !piece.is_joint {
                            pair.add_line(side, piece.source_line);
                        }
                    }
                }
            }
        }
    }

    /// Twice the place of a line, in parts, along the axes other than its own.
    fn doubled(&self, line: usize) -> [i64; 3] {
        let bits = self.key.spacing_bits();
        let index = [line % BRICK_CELLS, line / BRICK_CELLS];
        let mut at = [0i64; 3];
        for (n, a) in self.axis.others_in_order().into_iter().map(Axis::index).enumerate() {
            let sample = i64::from(self.key.base()[a]) + ((index[n] as i64) << bits);
            at[a] = (sample << PART_BITS) + (i64::from(self.beside[line][n]) << (bits + PART_BITS - 8));
        }
        at.map(|at| 2 * at)
    }
}

/// The whole number nearest to one that is not negative.
#[inline]
fn rounded(c: f64) -> i64 {
    let below = c as i64;
    below + i64::from(c - below as f64 >= 0.5)
}

/// The union of stretches in the order in which they begin.
fn merge<'a>(stretches: impl Iterator<Item = &'a Stretch>) -> Vec<(i64, i64)> {
    let mut merged: Vec<(i64, i64)> = Vec::new();
    for s in stretches {
        match merged.last_mut() {
            Some(last) if s.from <= last.1 => last.1 = last.1.max(s.to),
            _ => merged.push((s.from, s.to)),
        }
    }
    merged
}

/// What two unions have in common.
fn common(one: &[(i64, i64)], other: &[(i64, i64)]) -> Vec<(i64, i64)> {
    let (mut a, mut b, mut found) = (0, 0, Vec::new());
    while let (Some(x), Some(y)) = (one.get(a), other.get(b)) {
        let (from, to) = (x.0.max(y.0), x.1.min(y.1));
        if from < to {
            found.push((from, to));
        }
        if x.1 < y.1 { a += 1 } else { b += 1 }
    }
    found
}

/// What is left of a union without another.
fn without(one: &[(i64, i64)], other: &[(i64, i64)]) -> Vec<(i64, i64)> {
    let mut left = Vec::new();
    for &(mut from, to) in one {
        for &(first, last) in other {
            if last <= from || first >= to {
                continue;
            }
            if from < first {
                left.push((from, first));
            }
            from = from.max(last);
        }
        if from < to {
            left.push((from, to));
        }
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unions_have_common_parts_and_rests() {
        let (one, other) = (vec![(0, 10), (20, 30)], vec![(5, 7), (8, 22), (29, 40)]);
        assert_eq!(common(&one, &other), [(5, 7), (8, 10), (20, 22), (29, 30)]);
        assert_eq!(without(&one, &common(&one, &other)), [(0, 5), (7, 8), (22, 29)]);
    }
}
