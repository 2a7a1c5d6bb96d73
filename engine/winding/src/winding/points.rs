//! Winding numbers at arbitrary points, straight from the input.

use super::brute::solid_angle;
use super::scan::{SampleCube, ScanFacet};
use crate::error::Result;
use crate::lattice::{ROOT_BITS, RootCube, Triangle, Units, bounds};
use crate::progress::Progress;
use crate::soup::{Facet as WorldFacet, Facets, runs};
use crate::wide::{dispatch, level};
use rayon::prelude::*;

/// The exact winding number of a closed soup at each point: the crossings of the line that reaches the point along x.
/// Input and points are snapped to the lattice of `root` (vertices to the nearest even positions, points to the odd
/// one of their pair of units), where the count is exact.
///
/// The input is streamed once; memory goes with the number of points.
///
/// # Errors
/// If the user interrupts.
pub fn winding_at(
    sources: &[&dyn Facets],
    root: RootCube,
    points: &[[f64; 3]],
    progress: &dyn Progress,
) -> Result<Vec<i64>> {
    crossings_at(sources, &[], root, points, progress)
}

/// The exact winding number, at each point, of the sources and the caps together, which are closed.
pub(super) fn crossings_at(
    sources: &[&dyn Facets],
    caps: &[Triangle],
    root: RootCube,
    points: &[[f64; 3]],
    progress: &dyn Progress,
) -> Result<Vec<i64>> {
    let columns = Columns::new(root, points);
    let snapper = root.snapper();
    let mut counts = runs(sources)
        .into_par_iter()
        .fold(
            || (vec![0i64; points.len()], Vec::new()),
            |(mut counts, mut world): (_, Vec<WorldFacet>), (source, range)| {
                if !progress.cancelled() {
                    sources[source].read(range, &mut world);
                    world.iter().for_each(|t| columns.add(&t.map(snapper), &mut counts));
                    progress.advance(world.len() as u64);
                }
                (counts, world)
            },
        )
        .map(|(counts, _)| counts)
        .reduce(
            || vec![0; points.len()],
            |mut all, part| {
                all.iter_mut().zip(part).for_each(|(a, p)| *a += p);
                all
            },
        );
    progress.check()?;
    caps.iter().for_each(|t| columns.add(t, &mut counts));
    Ok(counts)
}

/// Columns along a side of the grid that sorts points by (y, z), at most.
const GRID_BITS: u32 = 9;

/// The points, snapped and sorted by the column of a grid over y and z that they lie in.
struct Columns {
    /// log₂ of a column's side in units.
    shift: u32,
    /// Where each column's points begin in `points`.
    starts: Vec<u32>,
    /// Position and number of each point inside the root; no other can be inside the soup.
    points: Vec<(Units, u32)>,
}

impl Columns {
    fn new(root: RootCube, world: &[[f64; 3]]) -> Columns {
        let edge = f64::from(1u32 << ROOT_BITS);
        let shift = ROOT_BITS - GRID_BITS;
        let mut points: Vec<(Units, u32)> = Vec::new();
        for (number, p) in world.iter().enumerate() {
            let units = root.to_units(*p);
            if units.iter().all(|&c| c >= 0.0 && c < edge) {
                points.push((units.map(|c| c as i32 | 1), number as u32));
            }
        }
        let column = |p: &Units| Columns::column(p[1] >> shift, p[2] >> shift);
        points.sort_by_key(|(p, _)| column(p));
        let mut starts = vec![0u32; (1 << (2 * GRID_BITS)) + 1];
        points.iter().for_each(|(p, _)| starts[column(p) + 1] += 1);
        (1..starts.len()).for_each(|c| starts[c] += starts[c - 1]);
        Columns { shift, starts, points }
    }

    fn column(y: i32, z: i32) -> usize {
        (z as usize) << GRID_BITS | y as usize
    }

    /// Adds one triangle's crossings to the counts of the points behind them.
    fn add(&self, t: &Triangle, counts: &mut [i64]) {
        let (min, max) = bounds(t);
        let [y0, z0] = [1, 2].map(|a| (min[a] >> self.shift).max(0));
        let [y1, z1] = [1, 2].map(|a| (max[a] >> self.shift).min((1 << GRID_BITS) - 1));
        for z in z0..=z1 {
            for y in y0..=y1 {
                let column = Columns::column(y, z);
                let range = self.starts[column] as usize..self.starts[column + 1] as usize;
                for (p, number) in &self.points[range] {
                    counts[*number as usize] += jump_before(t, *p);
                }
            }
        }
    }
}

/// The jump of the winding number where the line along x towards `p` crosses the triangle before `p`.
fn jump_before(t: &Triangle, p: Units) -> i64 {
    // Two samples: one far before the root, and p.
    const BLOCK: SampleCube = SampleCube { shift: ROOT_BITS + 1, last: 1 };
    let origin = [p[0] - (1 << BLOCK.shift), p[1], p[2]];
    let mut jump = 0;
    if let Some(facet) = dispatch!(level(), simd => ScanFacet::new(simd, t, origin, BLOCK)) {
        let crossed = |_| jump = i64::from(facet.jump(0));
        dispatch!(level(), simd => facet.scan::<_, 0>(simd, BLOCK, [0, 0], crossed));
    }
    jump
}

/// The oracle at each point: the sum of the solid angles of every triangle, snapped as [`winding_at`] does,
/// in f64 (Jacobson et al. 2013). Works on any soup; time is triangles times points.
///
/// # Errors
/// If the user interrupts.
pub fn brute_at(
    sources: &[&dyn Facets],
    root: RootCube,
    points: &[[f64; 3]],
    progress: &dyn Progress,
) -> Result<Vec<f64>> {
    /// Runs summed in parallel before their sums are added in order, which bounds memory.
    const RUNS_AT_ONCE: usize = 64;
    let points: Vec<[f64; 3]> = points.iter().map(|p| root.to_units(*p)).collect();
    let snapper = root.snapper();
    let mut sums = vec![0.0; points.len()];
    for group in runs(sources).chunks(RUNS_AT_ONCE) {
        let of_run = |(source, range): &(usize, std::ops::Range<u64>)| {
            let mut world = Vec::new();
            sources[*source].read(range.clone(), &mut world);
            let snapped: Vec<[[f64; 3]; 3]> =
                world.iter().map(|t| t.map(|v| snapper(v).map(f64::from))).collect();
            let sums: Vec<f64> = points
                .iter()
                .map(|p| if progress.cancelled() { 0.0 } else { angle_sum(&snapped, *p) })
                .collect();
            progress.advance(world.len() as u64);
            sums
        };
        let parts: Vec<Vec<f64>> = group.par_iter().map(of_run).collect();
        progress.check()?;
        for part in parts {
            sums.iter_mut().zip(part).for_each(|(s, p)| *s += p);
        }
    }
    Ok(sums.iter().map(|s| s / (4.0 * std::f64::consts::PI)).collect())
}

fn angle_sum(soup: &[[[f64; 3]; 3]], p: [f64; 3]) -> f64 {
    // From a million root cubes away the soup covers less than 1e-12 of the view; farther out f64 overflows.
    if p.iter().any(|c| c.abs() > 1e6 * f64::from(1u32 << ROOT_BITS)) {
        return 0.0;
    }
    let from_p = |v: [f64; 3]| std::array::from_fn(|a| v[a] - p[a]);
    soup.iter().map(|t| solid_angle(from_p(t[0]), from_p(t[1]), from_p(t[2]))).sum()
}
