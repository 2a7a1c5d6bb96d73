//! Pieces inside out, in builds: turned before where that is asked for, found afterwards where the field is negative.

use crate::error::{Error, Result};
use crate::ingest::Facets;
use crate::lattice::RootCube;
use crate::pieces::{Consistency, FlippedFacets, InsideOut, PiecesReport, study};
use crate::progress::Progress;

/// What is turned over, if any is to be, and what is said of it.
pub(super) fn turn(
    soups: &[&dyn Facets],
    root: RootCube,
    orient: Option<Consistency>,
    memory: u64,
    progress: &dyn Progress,
) -> Result<Option<(PiecesReport, FlippedFacets)>> {
    orient.map(|consistency| study(soups, root, consistency, memory, progress)).transpose()
}

/// The pieces that are inside out; `None` also where there is too little memory to find them.
pub(super) fn find_inside_out(
    soups: &[&dyn Facets],
    root: RootCube,
    memory: u64,
    progress: &dyn Progress,
) -> Result<Option<InsideOut>> {
    match study(soups, root, Consistency::Given, memory, progress) {
        Ok((report, _)) => Ok(report.inside_out),
        Err(Error::Setting { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}
