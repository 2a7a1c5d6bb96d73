//! The pass over the input: snap every vertex, sum the edge balance, sort the triangles by job.

use super::bins::Binner;
use super::field::{Field, Soup};
use super::sorted::SortedPieces;
use crate::error::Result;
use crate::ingest::{Facet, Facets, runs};
use crate::lattice::{NodeKey, RootCube, Triangle};
use crate::progress::Progress;
use crate::winding::EdgeBalance;
use rayon::prelude::*;

/// The snapped soup.
#[derive(Default)]
pub(super) struct SnappedSoup {
    pub sorted: SortedPieces<Soup>,
    pub balance: EdgeBalance,
    /// Triangles that have no area on the lattice.
    pub degenerate: u64,
}

impl SnappedSoup {
    fn merge(mut self, other: SnappedSoup) -> SnappedSoup {
        self.sorted.merge(&Soup, other.sorted);
        self.balance.merge(other.balance);
        self.degenerate += other.degenerate;
        self
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
                for t in &snapped {
                    soup.balance.add(t);
                    soup.degenerate += u64::from(Soup.is_void(t));
                }
                soup.sorted.push(&Soup, &binner, &snapped);
                progress.advance(world.len() as u64);
                (soup, world, snapped)
            },
        )
        .map(|(soup, ..)| soup)
        .reduce(SnappedSoup::default, SnappedSoup::merge);
    progress.check()?;
    Ok(soup)
}
