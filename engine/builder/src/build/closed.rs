//! Is the input closed?

use crate::error::Result;
use crate::ingest::{Facet, Facets, runs};
use crate::lattice::RootCube;
use crate::progress::Progress;
use crate::winding::EdgeBalance;
use rayon::prelude::*;

/// Whether the soup of all sources is closed. One pass over them, on all threads.
///
/// # Errors
/// If the user interrupts.
pub fn is_closed(sources: &[&dyn Facets], root: RootCube, progress: &dyn Progress) -> Result<bool> {
    progress.phase("checking edges", Some(sources.iter().map(|source| source.facets()).sum()), "facets");
    let snapper = root.snapper();
    let sum_of_run = |world: &mut Vec<Facet>, (source, range): (usize, std::ops::Range<u64>)| {
        progress.check()?;
        sources[source].read(range, world);
        let mut balance = EdgeBalance::default();
        world.iter().for_each(|t| balance.add(&t.map(snapper)));
        progress.advance(world.len() as u64);
        Ok(balance)
    };
    let add = |mut a: EdgeBalance, b: EdgeBalance| {
        a.merge(b);
        Ok(a)
    };
    let sums = runs(sources).into_par_iter().map_init(Vec::new, sum_of_run);
    let sum = sums.try_reduce(EdgeBalance::default, add)?;
    Ok(sum.is_closed())
}
