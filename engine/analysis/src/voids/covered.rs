//! Which cells of a node one segment of a bead covers, or two from both sides of a plane.

use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey};
use crate::solid::{Segment, Solids, for_lines, for_samples};

/// Rows of samples of a brick.
pub(super) const ROWS: usize = BRICK_POINTS * BRICK_POINTS;

/// The cells that are solid for certain, as bits by row k·33 + j; those with an index of 32 are none and count as solid.
pub(super) fn solid_cells(solids: &Solids, key: NodeKey, segments: &[Segment]) -> Vec<u64> {
    let mut solid = vec![0u64; ROWS];
    let mut samples = vec![0u64; ROWS];
    let mut rows = vec![0u64; ROWS];
    for segment in segments {
        let mut touched = Vec::new();
        for_samples(solids, key, segment, |[j, k], bits| {
            rows[k * BRICK_POINTS + j] = bits;
            touched.push((j, k));
        });
        for &(j, k) in &touched {
            samples[k * BRICK_POINTS + j] |= rows[k * BRICK_POINTS + j];
            if j < BRICK_CELLS && k < BRICK_CELLS {
                let row = k * BRICK_POINTS + j;
                let all = rows[row] & rows[row + 1] & rows[row + BRICK_POINTS] & rows[row + BRICK_POINTS + 1];
                solid[row] |= all & all >> 1;
            }
        }
        touched.iter().for_each(|(j, k)| rows[k * BRICK_POINTS + j] = 0);
    }
    for axis in [Axis::Z, Axis::X, Axis::Y] {
        by_two(solids, key, segments, axis, &samples, &mut solid);
    }
    solid
}

/// Adds cells that two segments cover on both sides of a plane across an axis.
fn by_two(
    solids: &Solids,
    key: NodeKey,
    segments: &[Segment],
    axis: Axis,
    samples: &[u64],
    solid: &mut [u64],
) {
    // By line, the segments there and where these begin and end, in units from the root's corner.
    let mut lines: Vec<(u32, u32, f64, f64)> = Vec::new();
    for (number, segment) in segments.iter().enumerate() {
        for_lines(
            solids,
            key,
            segment,
            axis,
            |_, _| [0.0; 2],
            |line, (from, to)| {
                lines.push((line as u32, number as u32, from, to));
            },
        );
    }
    lines.sort_unstable_by_key(|&(line, number, ..)| (line, number));
    let mut starts = vec![0usize; ROWS + 1];
    lines.iter().for_each(|(line, ..)| starts[*line as usize + 1] += 1);
    (1..starts.len()).for_each(|n| starts[n] += starts[n - 1]);
    let on = |line: usize| &lines[starts[line]..starts[line + 1]];
    let step = f64::from(1u32 << key.spacing_bits());
    let (a, base) = (axis.index(), f64::from(key.base()[axis.index()]) + 1.0);
    let [u, v] = axis.others_in_order().map(Axis::index);
    for k in 0..BRICK_CELLS {
        for j in 0..BRICK_CELLS {
            let row = k * BRICK_POINTS + j;
            let all = samples[row]
                & samples[row + 1]
                & samples[row + BRICK_POINTS]
                & samples[row + BRICK_POINTS + 1];
            let mut open = all & all >> 1 & !solid[row] & ((1 << BRICK_CELLS) - 1);
            while open != 0 {
                let i = open.trailing_zeros() as usize;
                open &= open - 1;
                let at = [i, j, k];
                let line = |p: usize, q: usize| (at[v] + q) * BRICK_POINTS + at[u] + p;
                let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(p, q)| on(line(p, q)));
                let low = base + at[a] as f64 * step;
                if is_covered(four, low, low + step) {
                    solid[row] |= 1 << i;
                }
            }
        }
    }
}

/// Whether one segment holds the lower ends of four lines and another one the upper ones, and they meet at some plane.
fn is_covered(four: [&[(u32, u32, f64, f64)]; 4], low: f64, high: f64) -> bool {
    let of = |line: &[(u32, u32, f64, f64)], number: u32| {
        let at = line.binary_search_by_key(&number, |entry| entry.1).ok()?;
        Some((line[at].2, line[at].3))
    };
    let mut below = f64::NEG_INFINITY;
    for &(_, number, ..) in four[0] {
        let ends = four.map(|line| of(line, number).filter(|(from, to)| *from <= low && *to > low));
        if ends.iter().all(Option::is_some) {
            below = below.max(ends.iter().flatten().map(|(_, to)| *to).fold(f64::INFINITY, f64::min));
        }
    }
    if below == f64::NEG_INFINITY {
        return false;
    }
    four[0].iter().any(|&(_, number, ..)| {
        let ends = four.map(|line| of(line, number).filter(|(from, to)| *from <= high && *to > high));
        ends.iter().all(Option::is_some)
            && ends.iter().flatten().map(|(from, _)| *from).fold(f64::NEG_INFINITY, f64::max) <= below
    })
}
