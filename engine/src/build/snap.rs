//! The pass over the input: snap every vertex, sum the edge balance, sort the triangles by job.

use super::bins::{Binner, SortedRun};
use crate::error::Result;
use crate::ingest::{Facet, Facets, runs};
use crate::lattice::{NodeKey, RootCube, Triangle, normal};
use crate::progress::Progress;
use crate::winding::{CornerGrid, EdgeBalance};
use rayon::prelude::*;

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
                snapped.extend(world.iter().map(|t: &Facet| t.map(snapper)));
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
