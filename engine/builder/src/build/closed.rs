//! Is the input closed?

use super::measure::of_runs;
use crate::error::Result;
use crate::ingest::{Facet, Facets};
use crate::lattice::RootCube;
use crate::progress::Progress;
use crate::winding::EdgeBalance;

/// Whether the soup of all sources is closed. One pass over them, on all threads.
///
/// # Errors
/// If the user interrupts.
pub fn is_closed(sources: &[&dyn Facets], root: RootCube, progress: &dyn Progress) -> Result<bool> {
    progress.phase("checking edges", Some(sources.iter().map(|source| source.facets()).sum()), "facets");
    let snapper = root.snapper();
    let of_run = |facets: &[Facet]| {
        let mut balance = EdgeBalance::default();
        facets.iter().for_each(|t| balance.add(&t.map(snapper)));
        balance
    };
    let mut sum = EdgeBalance::default();
    for source in sources {
        let runs = of_runs(*source, 0..source.facets(), progress, of_run)?;
        runs.into_iter().for_each(|run| sum.merge(run));
    }
    Ok(sum.is_closed())
}
