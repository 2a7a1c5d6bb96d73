//! How many passes, or beads, cover arbitrary points, straight from the solids.

use super::segment::Segment;
use super::segments::Solids;
use crate::error::Result;
use crate::lattice::{ROOT_BITS, RootCube, Units};
use crate::progress::Progress;
use rayon::prelude::*;

/// Segments that a thread takes at once: about a megabyte.
const SEGMENTS_AT_ONCE: usize = 1 << 15;
/// Points tested against all segments at once; their hits are 4 bytes each.
const POINTS_AT_ONCE: usize = 1 << 16;
/// Columns along a side of the grid that sorts points by (y, z).
const GRID_BITS: u32 = 9;

/// How many passes cover each point, or beads where the segments count those. Points are snapped as `winding_at` snaps them, to odd lattice positions,
/// and the rule is that of the samples: the interval of the point's line along x.
///
/// # Errors
/// If the user interrupts.
#[inline]
pub fn beads_at(
    solids: &Solids,
    segments: &[Segment],
    root: RootCube,
    points: &[[f64; 3]],
    progress: &dyn Progress,
) -> Result<Vec<i64>> {
    let edge = f64::from(1u32 << ROOT_BITS);
    let on_lattice = |p: &[f64; 3]| {
        let units = root.to_units(*p);
        units.iter().all(|&c| c >= 0.0 && c < edge).then(|| units.map(|c| c as i32 | 1))
    };
    let covers = |segment: &Segment, p: Units| solids.covers(segment, p);
    count(solids, segments, points, progress, on_lattice, covers)
}

/// The same without the lattice's rule: the sign of each solid's formula at the point itself, in f64.
///
/// # Errors
/// If the user interrupts.
#[inline]
pub fn brute_beads_at(
    solids: &Solids,
    segments: &[Segment],
    root: RootCube,
    points: &[[f64; 3]],
    progress: &dyn Progress,
) -> Result<Vec<i64>> {
    let edge = f64::from(1u32 << ROOT_BITS);
    let in_units = |p: &[f64; 3]| Some(root.to_units(*p)).filter(|u| u.iter().all(|&c| c >= 0.0 && c < edge));
    let covers = |segment: &Segment, p: [f64; 3]| {
        solids.body(segment).value([0, 1, 2].map(|a| p[a] - f64::from(segment.a[a]))) <= 0.0
    };
    count(solids, segments, points, progress, in_units, covers)
}

/// Counts the passes that cover each point. Points that `place` drops lie outside all.
fn count<T: Copy + Sync + Into<f64>>(
    solids: &Solids,
    segments: &[Segment],
    points: &[[f64; 3]],
    progress: &dyn Progress,
    place: impl Fn(&[f64; 3]) -> Option<[T; 3]>,
    covers: impl Fn(&Segment, [T; 3]) -> bool + Sync,
) -> Result<Vec<i64>> {
    let mut counts = vec![0; points.len()];
    for (batch, counts) in points.chunks(POINTS_AT_ONCE).zip(counts.chunks_mut(POINTS_AT_ONCE)) {
        let placed: Vec<([T; 3], u32)> =
            batch.iter().enumerate().filter_map(|(n, p)| Some((place(p)?, n as u32))).collect();
        let columns = Columns::new(placed);
        let parts: Vec<Vec<(u32, u32)>> = segments
            .par_chunks(SEGMENTS_AT_ONCE)
            .map(|run| {
                let mut hits = Vec::new();
                for segment in run.iter().filter(|s| solids.profile(s).is_solid()) {
                    columns.near(solids.bounds(segment), |p, number| {
                        if covers(segment, p) {
                            hits.push((number, segment.pass));
                        }
                    });
                }
                progress.advance(run.len() as u64);
                progress.check()?;
                // A pass that covers a point by several segments counts once.
                hits.sort_unstable();
                hits.dedup();
                Ok(hits)
            })
            .collect::<Result<_>>()?;
        let mut hits = parts.concat();
        hits.sort_unstable();
        hits.dedup();
        hits.iter().for_each(|(number, _)| counts[*number as usize] += 1);
        // At the joint of two passes both count once.
        for joint in solids.joints() {
            columns.near(solids.bounds(joint), |p, number| {
                let is_hit = |pass| hits.binary_search(&(number, pass)).is_ok();
                if is_hit(joint.pass) && is_hit(joint.pass - 1) && covers(joint, p) {
                    counts[number as usize] -= 1;
                }
            });
        }
    }
    Ok(counts)
}

/// Points sorted by the column of a grid over y and z that they lie in.
struct Columns<T> {
    starts: Vec<u32>,
    points: Vec<([T; 3], u32)>,
}

impl<T: Copy + Into<f64>> Columns<T> {
    fn new(mut points: Vec<([T; 3], u32)>) -> Columns<T> {
        let column = |p: &[T; 3]| {
            let [y, z] = [p[1], p[2]].map(|c| c.into() as usize >> (ROOT_BITS - GRID_BITS));
            z << GRID_BITS | y
        };
        points.sort_by_key(|(p, _)| column(p));
        let mut starts = vec![0u32; (1 << (2 * GRID_BITS)) + 1];
        points.iter().for_each(|(p, _)| starts[column(p) + 1] += 1);
        (1..starts.len()).for_each(|c| starts[c] += starts[c - 1]);
        Columns { starts, points }
    }

    /// Calls `each` with the points in the columns that a box meets, unless they lie outside it.
    fn near(&self, (min, max): (Units, Units), mut each: impl FnMut([T; 3], u32)) {
        let last = (1 << GRID_BITS) - 1;
        let [ys, zs] = [1, 2].map(|a| {
            let of = |c: i32| (c >> (ROOT_BITS - GRID_BITS)).clamp(0, last) as usize;
            of(min[a])..=of(max[a])
        });
        for z in zs {
            for y in ys.clone() {
                let column = z << GRID_BITS | y;
                for (p, number) in
                    &self.points[self.starts[column] as usize..self.starts[column + 1] as usize]
                {
                    let inside = |a: usize| {
                        let c: f64 = p[a].into();
                        f64::from(min[a]) <= c && c <= f64::from(max[a])
                    };
                    if inside(0) && inside(1) && inside(2) {
                        each(*p, *number);
                    }
                }
            }
        }
    }
}
