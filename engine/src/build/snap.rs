//! The pass over the input: snap every vertex, sum the edge balance, sort the triangles by job.

use super::bins::{Binner, SortedRun};
use crate::error::Result;
use crate::lattice::{NodeKey, RootCube, Triangle, normal};
use crate::progress::Progress;
use crate::winding::{CornerGrid, EdgeBalance};
use rayon::prelude::*;
use std::ops::Range;

/// Triangles decoded, snapped and sorted at a time: 590 KB of snapped triangles stay in a 1 MiB L2 cache.
const RUN_FACETS: u64 = 1 << 14;

/// Anything that yields the triangles of a soup by number.
pub trait Facets: Sync {
    /// Number of triangles.
    fn facets(&self) -> u64;
    /// Replaces `out` by the triangles of `range`, in world coordinates.
    fn read(&self, range: Range<u64>, out: &mut Vec<[[f64; 3]; 3]>);
}

impl Facets for [[[f64; 3]; 3]] {
    fn facets(&self) -> u64 {
        self.len() as u64
    }

    fn read(&self, range: Range<u64>, out: &mut Vec<[[f64; 3]; 3]>) {
        out.clear();
        out.extend_from_slice(&self[range.start as usize..range.end as usize]);
    }
}

/// The snapped soup, sorted by the level-`stride` cube that a triangle touches.
#[derive(Default)]
pub(super) struct SnappedSoup {
    pub runs: Vec<SortedRun>,
    /// Corners of those cubes.
    pub corners: Option<CornerGrid>,
    pub balance: EdgeBalance,
    /// Triangles that have no area on the lattice.
    pub degenerate: u64,
}

impl SnappedSoup {
    fn merge(mut self, mut other: SnappedSoup) -> SnappedSoup {
        self.runs.append(&mut other.runs);
        self.balance.merge(other.balance);
        self.degenerate += other.degenerate;
        self.corners = match (self.corners, other.corners) {
            (Some(mut mine), Some(theirs)) => {
                mine.merge(&theirs);
                Some(mine)
            }
            (mine, theirs) => mine.or(theirs),
        };
        self
    }

    /// All triangles of one cube.
    pub fn gather(&self, cell: usize, out: &mut Vec<Triangle>) {
        out.clear();
        out.reserve_exact(self.count(cell));
        self.runs.iter().for_each(|run| out.extend_from_slice(run.of(cell)));
    }

    /// How many triangles touch one cube.
    pub fn count(&self, cell: usize) -> usize {
        self.runs.iter().map(|run| run.of(cell).len()).sum()
    }
}

/// The runs of a list of sources: (source, range of its facets).
pub(super) fn runs(sources: &[&dyn Facets]) -> Vec<(usize, Range<u64>)> {
    let of_source = |(number, source): (usize, &&dyn Facets)| {
        let facets = source.facets();
        let starts = (0..facets).step_by(RUN_FACETS as usize);
        starts.map(move |s| (number, s..facets.min(s + RUN_FACETS))).collect::<Vec<_>>()
    };
    sources.iter().enumerate().flat_map(of_source).collect()
}

/// Snaps and sorts all sources as one soup, for jobs `stride` levels below the root.
pub(super) fn snap(
    sources: &[&dyn Facets],
    root: RootCube,
    stride: u8,
    progress: &dyn Progress,
) -> Result<SnappedSoup> {
    let binner = Binner::new(NodeKey::ROOT, stride);
    let snapper = root.snapper();
    let soup = runs(sources)
        .into_par_iter()
        .fold(
            || (SnappedSoup::default(), Vec::new(), Vec::new()),
            |(mut soup, mut world, mut snapped): (SnappedSoup, _, Vec<Triangle>), (source, range)| {
                if progress.cancelled() {
                    return (soup, world, snapped);
                }
                sources[source].read(range, &mut world);
                snapped.clear();
                snapped.extend(world.iter().map(|t: &[[f64; 3]; 3]| t.map(snapper)));
                let corners = soup.corners.get_or_insert_with(|| CornerGrid::new(NodeKey::ROOT, stride));
                for t in &snapped {
                    soup.balance.add(t);
                    soup.degenerate += u64::from(normal(t) == [0; 3]);
                    corners.add(t);
                }
                soup.runs.push(SortedRun::new(&binner, &snapped));
                progress.advance(world.len() as u64);
                (soup, world, snapped)
            },
        )
        .map(|(soup, ..)| soup)
        .reduce(SnappedSoup::default, SnappedSoup::merge);
    progress.check()?;
    Ok(soup)
}
