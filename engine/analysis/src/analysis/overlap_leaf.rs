//! The overlaps of passes within one leaf.

use crate::brick::Brick;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, GOLDEN, NodeKey, mix};
use crate::solid::{Segment, Solids, for_lines, for_samples};
use crate::store::{BeadSegment, Leaf};
use std::collections::BTreeMap;

/// log₂ of the parts of a unit in which chords count.
pub(super) const PART_BITS: u32 = 13;
/// Rows of samples that a brick owns.
const ROWS: usize = BRICK_CELLS * BRICK_CELLS;
/// Lines along an axis that a cell has, and parts of each of its sides that they stand in.
pub(super) const LINES: usize = SIDE * SIDE;
const SIDE: usize = 2;
/// The samples of a row that a brick owns.
const OWN: u64 = (1 << BRICK_CELLS) - 1;

/// Sums over what two passes have in common.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct PairSums {
    /// In cubic units.
    pub samples: u128,
    /// By axis, in square units times parts, of all [`LINES`] lines.
    pub chords: [i128; 3],
    /// Twice the first moments of all of these, with another side in parts.
    pub moments: [i128; 3],
    /// First and last line of each one's segments.
    pub lines: [(u64, u64); 2],
}

impl Default for PairSums {
    fn default() -> PairSums {
        PairSums { samples: 0, chords: [0; 3], moments: [0; 3], lines: [(u64::MAX, 0); 2] }
    }
}

impl PairSums {
    pub fn add(&mut self, other: &PairSums) {
        self.samples += other.samples;
        for a in 0..3 {
            self.chords[a] += other.chords[a];
            self.moments[a] += other.moments[a];
        }
        for (own, other) in self.lines.iter_mut().zip(other.lines) {
            *own = (own.0.min(other.0), own.1.max(other.1));
        }
    }
}

/// What a leaf has.
#[derive(Debug, Default)]
pub(super) struct LeafOverlaps {
    pub pairs: BTreeMap<[u32; 2], PairSums>,
    /// Σ w(w − 1)/2 over its samples.
    pub field_samples: u128,
    /// Samples of which passes are not as many as w.
    pub unexplained: u128,
}

/// A pass in a leaf.
struct Pass<'a> {
    number: u32,
    segments: &'a [BeadSegment],
    /// The round end where it follows the pass before, which counts once.
    joint: Option<Segment>,
    /// Own samples, by row.
    rows: Vec<u64>,
}

fn segment(s: &BeadSegment) -> Segment {
    Segment { a: s.a, b: s.b, profile: s.section, pass: s.pass }
}

/// The overlaps in a leaf. `follows` tells whether a pass follows another of its bead.
pub(super) fn of_leaf(
    leaf: &Leaf<'_>,
    solids: &Solids,
    segments: &[BeadSegment],
    follows: &dyn Fn(u32) -> bool,
) -> LeafOverlaps {
    let mut passes: Vec<Pass<'_>> = Vec::new();
    for segments in segments.chunk_by(|a, b| a.pass == b.pass) {
        let number = segments[0].pass;
        let before = passes.last().filter(|before| follows(number) && before.number + 1 == number);
        let meets = |before: &Pass<'_>| before.segments.iter().any(|s| s.b == segments[0].a);
        let joint = before
            .filter(|before| meets(before))
            .map(|_| Segment { b: segments[0].a, ..segment(&segments[0]) });
        passes.push(Pass { number, segments, joint, rows: rows(leaf.key, solids, segments) });
    }
    let mut found = LeafOverlaps::default();
    take_joints(leaf.key, solids, &mut passes);
    explain(leaf.brick, &mut passes, follows, &mut found);
    let bits = leaf.key.spacing_bits();
    for (n, one) in passes.iter().enumerate() {
        for other in &passes[n + 1..] {
            let common = one.rows.iter().zip(&other.rows).map(|(a, b)| (a & b).count_ones()).sum::<u32>();
            if common > 0 {
                let pair = found.pairs.entry([one.number, other.number]).or_default();
                pair.samples += u128::from(common) << (3 * bits);
            }
        }
    }
    for (axis, line) in Axis::ALL.into_iter().flat_map(|axis| (0..LINES).map(move |line| (axis, line))) {
        let lines = Lines { key: leaf.key, axis, number: line };
        lines.add_chords(solids, &passes, &mut found.pairs);
    }
    found
}

/// The samples of a pass.
fn rows(key: NodeKey, solids: &Solids, segments: &[BeadSegment]) -> Vec<u64> {
    let mut rows = vec![0; ROWS];
    for s in segments {
        for_samples(solids, key, &segment(s), |[j, k], bits| {
            if j < BRICK_CELLS && k < BRICK_CELLS {
                rows[k * BRICK_CELLS + j] |= bits & OWN;
            }
        });
    }
    rows
}

/// Takes off each pass what it has in common with the one before at their joint, as builds do: of the pass before, that is all
/// that it covers, its own joint not yet taken off.
fn take_joints(key: NodeKey, solids: &Solids, passes: &mut [Pass<'_>]) {
    for n in (1..passes.len()).rev() {
        let Some(joint) = passes[n].joint else { continue };
        let (before, own) = passes.split_at_mut(n);
        for_samples(solids, key, &joint, |[j, k], bits| {
            if j < BRICK_CELLS && k < BRICK_CELLS {
                let row = k * BRICK_CELLS + j;
                own[0].rows[row] &= !(bits & before[n - 1].rows[row]);
            }
        });
    }
}

/// Compares the passes at each sample with w. Where they are more, passes that follow another there meet it at a joint that the
/// leaf's list does not show, because the pass before ends beside the leaf.
fn explain(brick: &Brick, passes: &mut [Pass<'_>], follows: &dyn Fn(u32) -> bool, found: &mut LeafOverlaps) {
    for row in 0..ROWS {
        let (j, k) = (row % BRICK_CELLS, row / BRICK_CELLS);
        for i in 0..BRICK_CELLS {
            let w = i64::from(brick.sample([i, j, k])).max(0);
            found.field_samples += (w * (w - 1) / 2) as u128;
            let covers = |pass: &Pass<'_>| pass.rows[row] >> i & 1 == 1;
            let mut count = passes.iter().filter(|pass| covers(pass)).count() as i64;
            for n in (1..passes.len()).rev() {
                let is_joint = count > w
                    && passes[n - 1].number + 1 == passes[n].number
                    && follows(passes[n].number)
                    && covers(&passes[n - 1])
                    && covers(&passes[n]);
                if is_joint {
                    passes[n].rows[row] &= !(1 << i);
                    count -= 1;
                }
            }
            found.unexplained += u128::from(count != w);
        }
    }
}

/// Where a segment lies on a line.
#[derive(Clone, Copy)]
struct Stretch {
    line: u32,
    /// Place of its pass in the list.
    pass: u32,
    is_joint: bool,
    from: i64,
    to: i64,
    source_line: u64,
}

/// One of the [`LINES`] lines of each cell along an axis. They stand anywhere in their part of the cell, by a fixed draw, since lines through
/// samples would all meet a bead that is in step with the cells in the same way.
#[derive(Clone, Copy)]
struct Lines {
    key: NodeKey,
    axis: Axis,
    number: usize,
}

impl Lines {
    /// How far beyond the sample (j, k) a line stands, in 256ths of a cell.
    fn beside(self, j: usize, k: usize) -> [u64; 2] {
        let [first, second] = self.others().map(|a| u64::from(self.key.first_sample()[a]));
        let cell = (first + j as u64) << 32 | (second + k as u64);
        let place = (self.axis.index() * LINES + self.number) as u64;
        let drawn = mix(mix(cell) ^ place.wrapping_mul(GOLDEN));
        let part = [self.number % SIDE, self.number / SIDE];
        [0, 1].map(|n| (256 / SIDE) as u64 * part[n] as u64 + (drawn >> (8 * n)) % (256 / SIDE as u64))
    }

    /// The other two axes.
    fn others(self) -> [usize; 2] {
        self.axis.others_in_order().map(Axis::index)
    }

    /// Adds the chords that passes have in common.
    fn add_chords(self, solids: &Solids, passes: &[Pass<'_>], pairs: &mut BTreeMap<[u32; 2], PairSums>) {
        let Lines { key, axis, .. } = self;
        let first = i64::from(key.base()[axis.index()]) << PART_BITS;
        let last = first + ((BRICK_CELLS as i64) << (key.spacing_bits() + PART_BITS));
        let beside = |j: usize, k: usize| self.beside(j, k).map(|part| part as f64 / 256.0);
        let mut stretches = Vec::new();
        for (pass, Pass { segments, joint, .. }) in passes.iter().enumerate() {
            let mut put = |s: &Segment, is_joint: bool, source_line: u64| {
                for_lines(solids, key, s, axis, beside, |line, ends| {
                    // The root's first sample stands at (1, 1, 1).
                    let part = |c: f64| {
                        (((c - 1.0) * f64::from(1u32 << PART_BITS)).round() as i64).clamp(first, last)
                    };
                    let (from, to) = (part(ends.0), part(ends.1));
                    let is_own = line % BRICK_POINTS < BRICK_CELLS && line / BRICK_POINTS < BRICK_CELLS;
                    if from < to && is_own {
                        let (line, pass) = (line as u32, pass as u32);
                        stretches.push(Stretch { line, pass, is_joint, from, to, source_line });
                    }
                });
            };
            segments.iter().for_each(|s| put(&segment(s), false, s.line));
            joint.iter().for_each(|s| put(s, true, 0));
        }
        stretches.sort_unstable_by_key(|s| (s.line, s.pass, s.is_joint, s.from, s.to, s.source_line));
        for line in stretches.chunk_by(|a, b| a.line == b.line) {
            let of_passes: Vec<&[Stretch]> = line.chunk_by(|a, b| a.pass == b.pass).collect();
            if of_passes.len() > 1 {
                self.on_line(passes, &of_passes, pairs);
            }
        }
    }

    /// Adds what passes have in common on one line.
    fn on_line(
        self,
        passes: &[Pass<'_>],
        of_passes: &[&[Stretch]],
        pairs: &mut BTreeMap<[u32; 2], PairSums>,
    ) {
        let bits = self.key.spacing_bits();
        let place = of_passes[0][0].line as usize;
        let index = [place % BRICK_POINTS, place / BRICK_POINTS];
        let beside = self.beside(index[0], index[1]);
        let mut at = [0i64; 3];
        for (n, a) in self.others().into_iter().enumerate() {
            let sample = i64::from(self.key.base()[a]) + ((index[n] as i64) << bits);
            at[a] = (sample << PART_BITS) + ((beside[n] as i64) << (bits + PART_BITS - 8));
        }
        let whole = without_joints(of_passes);
        for (n, one) in whole.iter().enumerate() {
            for (m, other) in whole.iter().enumerate().skip(n + 1) {
                for (from, to) in common(one, other) {
                    let numbers = [n, m].map(|n| passes[of_passes[n][0].pass as usize].number);
                    let pair = pairs.entry(numbers).or_default();
                    add_chord(pair, self.axis, (from, to), at, 1i128 << (2 * bits));
                    for (side, n) in [n, m].into_iter().enumerate() {
                        let meets = of_passes[n].iter().filter(|s| !s.is_joint && s.from < to && from < s.to);
                        for s in meets {
                            let lines = &mut pair.lines[side];
                            *lines = (lines.0.min(s.source_line), lines.1.max(s.source_line));
                        }
                    }
                }
            }
        }
    }
}

/// The unions of the stretches of passes on a line. What a joint has in common with the pass before counts once.
fn without_joints(of_passes: &[&[Stretch]]) -> Vec<Vec<(i64, i64)>> {
    let merged: Vec<Vec<(i64, i64)>> = of_passes.iter().map(|s| merge(s)).collect();
    let whole = |n: usize| {
        let joint = of_passes[n].iter().filter(|s| s.is_joint);
        let joint: Vec<(i64, i64)> = joint.map(|s| (s.from, s.to)).collect();
        let follows = |before: &usize| of_passes[*before][0].pass + 1 == of_passes[n][0].pass;
        match n.checked_sub(1).filter(|before| follows(before) && !joint.is_empty()) {
            Some(before) => without(&merged[n], &common(&joint, &merged[before])),
            None => merged[n].clone(),
        }
    };
    (0..merged.len()).map(whole).collect()
}

fn add_chord(pair: &mut PairSums, axis: Axis, (from, to): (i64, i64), at: [i64; 3], area: i128) {
    let length = i128::from(to - from);
    pair.chords[axis.index()] += length * area;
    for (b, (moment, at)) in pair.moments.iter_mut().zip(at).enumerate() {
        let doubled = if b == axis.index() { i128::from(from) + i128::from(to) } else { 2 * i128::from(at) };
        *moment += length * doubled * area;
    }
}

/// The union of the stretches of a pass, without its joint's; these are sorted.
fn merge(stretches: &[Stretch]) -> Vec<(i64, i64)> {
    let mut merged: Vec<(i64, i64)> = Vec::new();
    for s in stretches.iter().filter(|s| !s.is_joint) {
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
    use crate::brick::{Hermite, POINTS, Samples};
    use crate::solid::{Outline, SolidProfile};

    const STEP: i32 = 1 << 19;

    /// Two segments along x and y at one height, stadia of this half width and half height in cells, and their samples.
    fn crossing(half: f64) -> (Solids, Vec<BeadSegment>, Brick) {
        let cells = f64::from(STEP);
        let profile = SolidProfile::new(Outline::Stadium, half * cells, half * cells, [0.0, 0.0, 1.0]);
        let solids = Solids::of_profiles(vec![profile]);
        let at = |x: f64, y: f64| [x, y, 16.13].map(|c| (c * cells) as i32 & !1);
        let line = |a, b, pass| BeadSegment { a, b, section: 0, pass, line: 10 + u64::from(pass) };
        let segments = vec![line(at(1.0, 16.3), at(31.0, 16.3), 0), line(at(15.6, 1.0), at(15.6, 31.0), 1)];
        let mut samples = Samples::filled(0);
        for s in &segments {
            for_samples(&solids, NodeKey::ROOT, &segment(s), |[j, k], bits| {
                for i in 0..BRICK_POINTS {
                    samples.0[(k * BRICK_POINTS + j) * BRICK_POINTS + i] += (bits >> i & 1) as i16;
                }
            });
        }
        assert_eq!(samples.0.len(), POINTS);
        (solids, segments, Brick::Counts { samples, hermite: Hermite::default() })
    }

    #[test]
    fn crossing_cylinders_overlap_by_sixteen_thirds_of_the_cube_of_the_radius() {
        for (half, error) in [(6.0, 0.004), (9.0, 0.002), (12.0, 0.0025)] {
            let (solids, segments, brick) = crossing(half);
            let leaf = Leaf { number: 0, key: NodeKey::ROOT, brick: &brick };
            let found = of_leaf(&leaf, &solids, &segments, &|_| false);
            assert_eq!((found.pairs.len(), found.unexplained), (1, 0));
            let pair = &found.pairs[&[0, 1]];
            let unit = f64::from(STEP).powi(3);
            assert_eq!(pair.samples, found.field_samples << 57);
            let volume = pair.chords.iter().sum::<i128>() as f64
                / (3 * LINES) as f64
                / f64::from(1u32 << PART_BITS)
                / unit;
            let exact = 16.0 / 3.0 * half.powi(3);
            assert!((volume / exact - 1.0).abs() < error, "{half}: {volume} {exact}");
            assert_eq!(pair.lines, [(10, 10), (11, 11)]);
        }
    }

    #[test]
    fn unions_have_common_parts_and_rests() {
        let (one, other) = (vec![(0, 10), (20, 30)], vec![(5, 7), (8, 22), (29, 40)]);
        assert_eq!(common(&one, &other), [(5, 7), (8, 10), (20, 22), (29, 30)]);
        assert_eq!(without(&one, &common(&one, &other)), [(0, 5), (7, 8), (22, 29)]);
    }
}
