//! The overlaps of passes within one leaf.

use super::overlap_lines::{PassPiece, add_chords};
use super::overlap_pairs::{LeafPairs, PairSums};
use crate::brick::Brick;
use crate::lattice::{BRICK_CELLS, NodeKey};
use crate::solid::{Segment, Solids, for_samples};
use crate::store::{BeadSegment, Leaf};

/// Rows of samples that a brick owns.
const ROWS: usize = BRICK_CELLS * BRICK_CELLS;
/// The samples of a row that a brick owns.
const OWN: u64 = (1 << BRICK_CELLS) - 1;

/// What a leaf has.
#[derive(Debug, Default)]
pub(super) struct LeafOverlaps {
    /// By numbers of passes.
    pub pairs: Vec<([u32; 2], PairSums)>,
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
    let mut pairs = LeafPairs::new(passes.iter().map(|pass| pass.number).collect());
    add_samples(&passes, &mut pairs);
    add_chords(leaf.key, solids, &pieces(&passes), &mut pairs);
    found.pairs = pairs.sums(leaf.key.spacing_bits());
    found
}

/// The segments and joints of all passes, pass by pass.
fn pieces(passes: &[Pass<'_>]) -> Vec<PassPiece> {
    let mut pieces = Vec::new();
    for (pass, Pass { segments, joint, .. }) in passes.iter().enumerate() {
        let piece = |segment: Segment, is_joint: bool, source_line: u64| PassPiece {
            segment,
            pass: pass as u32,
            is_joint,
            source_line,
        };
        pieces.extend(segments.iter().map(|s| piece(segment(s), false, s.line)));
        pieces.extend(joint.iter().map(|s| piece(*s, true, 0)));
    }
    pieces
}

/// Adds the samples that passes have in common. Few passes cover a row, so rows are asked for passes and not pairs of passes for rows.
fn add_samples(passes: &[Pass<'_>], pairs: &mut LeafPairs) {
    let mut there: Vec<(u32, u64)> = Vec::new();
    for row in 0..ROWS {
        there.clear();
        let covering = passes.iter().enumerate().filter(|(_, pass)| pass.rows[row] != 0);
        there.extend(covering.map(|(n, pass)| (n as u32, pass.rows[row])));
        for (n, &(one, own)) in there.iter().enumerate() {
            for &(other, bits) in there[n + 1..].iter().filter(|(_, bits)| bits & own != 0) {
                pairs.of(one, other).samples += u64::from((bits & own).count_ones());
            }
        }
    }
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
        let mut counts = [0i64; BRICK_CELLS];
        for pass in passes.iter() {
            let mut left = pass.rows[row];
            while left != 0 {
                counts[left.trailing_zeros() as usize] += 1;
                left &= left - 1;
            }
        }
        for (i, mut count) in counts.into_iter().enumerate() {
            let w = i64::from(brick.sample([i, j, k])).max(0);
            found.field_samples += (w * (w - 1) / 2) as u128;
            if count > w {
                count -= take_hidden_joints(passes, row, i, count - w, follows);
            }
            found.unexplained += u128::from(count != w);
        }
    }
}

/// Takes up to so many passes off a sample that they share with the pass before; returns how many those are.
fn take_hidden_joints(
    passes: &mut [Pass<'_>],
    row: usize,
    i: usize,
    most: i64,
    follows: &dyn Fn(u32) -> bool,
) -> i64 {
    let covers = |pass: &Pass<'_>| pass.rows[row] >> i & 1 == 1;
    let mut taken = 0;
    for n in (1..passes.len()).rev() {
        let is_joint = taken < most
            && passes[n - 1].number + 1 == passes[n].number
            && follows(passes[n].number)
            && covers(&passes[n - 1])
            && covers(&passes[n]);
        if is_joint {
            passes[n].rows[row] &= !(1 << i);
            taken += 1;
        }
    }
    taken
}

#[cfg(test)]
mod tests {
    use super::super::overlap_lines::{LINES, PART_BITS};
    use super::*;
    use crate::brick::{Hermite, POINTS, Samples};
    use crate::lattice::BRICK_POINTS;
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
            let (numbers, pair) = &found.pairs[0];
            assert_eq!(*numbers, [0, 1]);
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
}
