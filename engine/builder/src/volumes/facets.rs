//! Volumes of closed triangle soups.

use super::estimate::StratumMoments;
use super::strata::{LINES, LineQuery, Strata};
use super::tally::{LineCrossing, LineLengths, walk};
use crate::error::Result;
use crate::lattice::{RootCube, Triangle, Units, bounds, normal};
use crate::progress::Progress;
use crate::soup::{Facet, Facets, runs};
use crate::store::SourceVolumes;
use rayon::prelude::*;
use std::ops::Range;

/// Most lines.
const LINES_MAX: f64 = (1 << 16) as f64;
/// Crossings that are sought for each facet: few, so that finding them takes about as long as reading the facets.
const CROSSINGS_A_FACET: f64 = 8.0;
/// Bounds on the crossings that are sought.
const CROSSINGS: (f64, f64) = ((1 << 18) as f64, (1 << 22) as f64);
/// Strata whose moments are summed before they are added to the others, in order.
const STRATA_AT_ONCE: usize = 256;
/// Places of a crossing behind the point, in units.
const FRACTION_BITS: u32 = 12;
/// Where the number of a crossing's line begins.
const LINE_SHIFT: u32 = 40;

/// Runs of facets that are asked how far they spread along z, at most.
const RUNS_ASKED: usize = 64;

/// Volumes of a closed soup within the box `bounds`. It is read once. Crossings take 8 bytes each, 4 million or so at
/// most; where `memory` has no room for them, the soup is read once more for each further part of the lines.
///
/// # Errors
/// If the user interrupts.
pub fn facet_volumes(
    sources: &[&dyn Facets],
    bounds: ([f64; 3], [f64; 3]),
    memory: u64,
    progress: &dyn Progress,
) -> Result<Option<SourceVolumes>> {
    // A cube of its own: that of the tree may follow from its cells.
    let Some(root) = RootCube::around(bounds.0, bounds.1) else { return Ok(None) };
    // Vertices are snapped to even units.
    let low = root.to_units(bounds.0).map(|c| c.floor() as i32 - 1);
    let high = root.to_units(bounds.1).map(|c| c.ceil() as i32 + 1);
    let extent = [0, 1].map(|a| f64::from(high[a] - low[a]));
    let facets: u64 = sources.iter().map(|source| source.facets()).sum();
    let wanted = (facets as f64 * CROSSINGS_A_FACET).clamp(CROSSINGS.0, CROSSINGS.1);
    let on_a_line = (shadow(sources, root, progress)? / (extent[0] * extent[1])).max(1.0);
    let lines = (wanted / on_a_line).clamp(2.0 * LINES as f64, LINES_MAX) as usize;
    let strata = Strata::columns(low, high, lines);
    let expected = strata.len() as f64 * on_a_line * 16.0;
    let mut moments = StratumMoments::default();
    let mut sums = Sums::default();
    for numbers in strata.parts(expected, memory, STRATA_AT_ONCE) {
        let found;
        (found, sums) = crossings(sources, root, &strata, numbers, progress)?;
        add(&found, &mut moments);
    }
    let area = strata.area_of_line();
    let known = sums.winding();
    let [mut union, mut overlap, mut negative] = [0, 1, 2].map(|i| moments.controlled(i, (3, known), area));
    // Lines cross facets whose corners are snapped. Where nothing overlaps, the union is ∫ w, of which more is known.
    let is_plain =
        [overlap, negative].iter().all(|volume| volume.value == 0.0 && volume.standard_error == 0.0);
    union = union.widened(if is_plain { sums.winding_error() } else { sums.snapping_error() });
    if !is_plain {
        [overlap, negative] = [overlap, negative].map(|volume| volume.widened(sums.snapping_error()));
    }
    let [union, overlap, negative] =
        [union, overlap, negative].map(|volume| volume.scaled(root.unit().powi(3)));
    let lines = strata.len() as u64;
    Ok(Some(SourceVolumes { union, overlap, negative, lines, swept: None, layers: Vec::new() }))
}

/// About the area of the shadows that facets cast along z, in square units: that of some runs stands for all.
fn shadow(sources: &[&dyn Facets], root: RootCube, progress: &dyn Progress) -> Result<f64> {
    let snapper = root.snapper();
    let all = runs(sources);
    let asked = all.iter().cloned().step_by(all.len().div_ceil(RUNS_ASKED).max(1));
    let of_run = |world: &mut Vec<Facet>, (source, range): (usize, Range<u64>)| {
        progress.check()?;
        sources[source].read(range, world);
        let twice = |facet: &Facet| u128::from(normal(&facet.map(snapper))[2].unsigned_abs());
        Ok((world.iter().map(twice).sum::<u128>(), world.len() as u64))
    };
    let asked: Vec<(u128, u64)> =
        asked.collect::<Vec<_>>().into_par_iter().map_init(Vec::new, of_run).collect::<Result<_>>()?;
    let (twice, seen) = asked.into_iter().fold((0, 0), |(a, b), (twice, seen)| (a + twice, b + seen));
    let facets: u64 = sources.iter().map(|source| source.facets()).sum();
    Ok(0.5 * twice as f64 * facets as f64 / seen.max(1) as f64)
}

/// Exact sums over facets, in units; the same in any order.
#[derive(Clone, Copy, Default)]
struct Sums {
    /// Six times the volume of the tetrahedra between the snapped facets and the lattice's first corner.
    sixfold: i128,
    /// What that lacks of the facets as they are, to the first order, 2^16-fold.
    shift: i128,
    /// Twice the areas of the facets' shadows along the three axes.
    shadows: i128,
    /// The extents of the facets' edges along the three axes.
    edges: i128,
}

impl Sums {
    const SHIFT_SCALE: f64 = 65536.0;

    /// Adds a facet, snapped, and how far its corners were from there.
    fn add(&mut self, t: &Triangle, away: &[[f64; 3]; 3]) {
        let n = normal(t);
        let mean = |axis: usize| away.iter().map(|corner| corner[axis]).sum::<f64>();
        // A third of three corners, of half the normal, six times.
        let shift = (0..3).map(|axis| n[axis] as f64 * mean(axis)).sum::<f64>();
        self.sixfold += (0..3).map(|axis| i128::from(n[axis]) * i128::from(t[0][axis])).sum::<i128>();
        self.shift += (shift * Sums::SHIFT_SCALE).round() as i128;
        self.shadows += n.iter().map(|n| i128::from(n.unsigned_abs())).sum::<i128>();
        let edge = |from: usize| {
            (0..3).map(|axis| t[(from + 1) % 3][axis].abs_diff(t[from][axis])).map(i128::from).sum::<i128>()
        };
        self.edges += (0..3).map(edge).sum::<i128>();
    }

    fn plus(self, other: Sums) -> Sums {
        Sums {
            sixfold: self.sixfold + other.sixfold,
            shift: self.shift + other.shift,
            shadows: self.shadows + other.shadows,
            edges: self.edges + other.edges,
        }
    }

    /// ∫ w.
    fn winding(&self) -> f64 {
        (self.sixfold as f64 + self.shift as f64 / Sums::SHIFT_SCALE) / 6.0
    }

    /// A bound on its error: corners move by a unit along an axis, so what is of the second order is less than three square
    /// units times the length of all edges.
    fn winding_error(&self) -> f64 {
        3.0 * self.edges as f64 + self.sixfold.unsigned_abs() as f64 * f64::EPSILON
    }

    /// A bound on what snapping changes of any volume between facets: their area times a unit along each axis.
    fn snapping_error(&self) -> f64 {
        0.5 * self.shadows as f64 + self.winding_error()
    }
}

/// All crossings of some lines, sorted by line and height, and sums over the soup. Each is packed: 24 bits of the line's
/// number within `numbers`, the height, and a bit that tells leaving from entering.
fn crossings(
    sources: &[&dyn Facets],
    root: RootCube,
    strata: &Strata,
    numbers: Range<u32>,
    progress: &dyn Progress,
) -> Result<(Vec<u64>, Sums)> {
    let snapper = root.snapper();
    let parts: Vec<(Vec<u64>, Sums)> = runs(sources)
        .into_par_iter()
        .fold(
            || (Vec::new(), Vec::new(), Sums::default()),
            |(mut world, mut found, mut sums), (source, range)| {
                if !progress.cancelled() {
                    sources[source].read(range, &mut world);
                    for facet in &world {
                        let t = facet.map(snapper);
                        let away = |corner: usize| {
                            let exact = root.to_units(facet[corner]);
                            std::array::from_fn(|axis| exact[axis] - f64::from(t[corner][axis]))
                        };
                        sums.add(&t, &[0, 1, 2].map(away));
                        let corners = t.map(|v| [f64::from(v[0]), f64::from(v[1])]);
                        let shape = LineQuery { bounds: bounds(&t), axis: 0, corners: &corners, reach: 0.0 };
                        strata.near(&shape, &numbers, |number, at| {
                            if let Some(crossing) = crossing(&t, at) {
                                found.push(packed(number - numbers.start, crossing));
                            }
                        });
                    }
                }
                (world, found, sums)
            },
        )
        .map(|(_, found, sums)| (found, sums))
        .collect();
    progress.check()?;
    let sums = parts.iter().fold(Sums::default(), |all, (_, sums)| all.plus(*sums));
    let mut all = Vec::with_capacity(parts.iter().map(|(found, _)| found.len()).sum());
    parts.iter().for_each(|(found, _)| all.extend_from_slice(found));
    drop(parts);
    all.par_sort_unstable();
    Ok((all, sums))
}

fn packed(line: u32, LineCrossing { at, jump }: LineCrossing) -> u64 {
    let at = (at * f64::from(1u32 << FRACTION_BITS)) as u64;
    u64::from(line) << LINE_SHIFT | at << 1 | u64::from(jump < 0)
}

fn unpacked(packed: u64) -> LineCrossing {
    let at = (packed & ((1 << LINE_SHIFT) - 1)) >> 1;
    LineCrossing { at: at as f64 / f64::from(1u32 << FRACTION_BITS), jump: 1 - 2 * (packed as i32 & 1) }
}

/// Where the line through `at` along z crosses a triangle. A line that meets an edge in the projection crosses one of the
/// two triangles there: it counts as `at` + (ε, ε²).
fn crossing(t: &Triangle, at: [i32; 2]) -> Option<LineCrossing> {
    let side = |a: &Units, b: &Units| {
        let [ax, ay, bx, by] = [a[0], a[1], b[0], b[1]].map(i64::from);
        let value = (bx - ax) * (i64::from(at[1]) - ay) - (by - ay) * (i64::from(at[0]) - ax);
        match value {
            0 if by != ay => (ay - by).signum(),
            0 => (bx - ax).signum(),
            _ => value.signum(),
        }
    };
    let first = side(&t[0], &t[1]);
    if first == 0 || side(&t[1], &t[2]) != first || side(&t[2], &t[0]) != first {
        return None;
    }
    let edge = |to: usize| [0, 1, 2].map(|i| f64::from(t[to][i] - t[0][i]));
    let (u, v) = (edge(1), edge(2));
    let normal = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| u[i] * v[j] - u[j] * v[i]);
    let from = [0, 1].map(|i| f64::from(at[i] - t[0][i]));
    let height = f64::from(t[0][2]) - (normal[0] * from[0] + normal[1] * from[1]) / normal[2];
    let [low, high] = [bounds(t).0[2], bounds(t).1[2]].map(f64::from);
    // Facets that face up are left, upwards.
    Some(LineCrossing { at: height.clamp(low, high), jump: -first as i32 })
}

/// Adds strata that have these crossings; the others have nothing to add.
fn add(crossings: &[u64], moments: &mut StratumMoments<4>) {
    let line = |crossing: u64| (crossing >> LINE_SHIFT) as usize;
    let of_line = |crossings: &[u64], buffer: &mut Vec<LineCrossing>| {
        buffer.clear();
        buffer.extend(crossings.iter().map(|&crossing| unpacked(crossing)));
        let mut lengths = LineLengths::default();
        walk(buffer, |w, from, to| lengths.add(w, from, to));
        lengths.control = lengths.union + lengths.overlap - lengths.negative;
        lengths.values()
    };
    let of_block = |buffer: &mut Vec<LineCrossing>, block: &[u64]| {
        let mut moments = StratumMoments::default();
        for crossings in block.chunk_by(|&a, &b| line(a) / LINES == line(b) / LINES) {
            let (a, b) = crossings
                .split_at(crossings.partition_point(|&crossing| line(crossing).is_multiple_of(LINES)));
            moments.add([of_line(a, buffer), of_line(b, buffer)]);
        }
        moments
    };
    // Blocks are cut where the numbers of strata say, so that sums are rounded alike whatever the threads are.
    let block = |crossing: u64| line(crossing) / LINES / STRATA_AT_ONCE;
    let blocks: Vec<&[u64]> = crossings.chunk_by(|&a, &b| block(a) == block(b)).collect();
    let parts: Vec<StratumMoments<4>> = blocks.into_par_iter().map_init(Vec::new, of_block).collect();
    parts.iter().for_each(|part| moments.merge(part));
}
