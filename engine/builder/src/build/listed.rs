//! The beads of toolpaths as a store that tells them apart lists them, without building one.

use super::field::PieceField;
use super::identity::ListSources;
use super::toolpaths::{BeadSource, first_passes, tables};
use crate::brick::Count;
use crate::error::Result;
use crate::lattice::RootCube;
use crate::solid::{Outline, Solids, passes_of};
use crate::store::{BeadSegment, BeadTables};
use crate::toolpath::{Passes, Toolpath};

/// Tables and segments of all beads of toolpaths on the lattice of `root`, pass by pass: what a store of them with identity holds.
///
/// # Errors
/// [`crate::error::Error::Setting`] if there are more passes, or kinds of features, than a store counts.
pub fn listed_beads(
    sources: &[BeadSource<'_>],
    (outline, count): (Outline, Count),
    root: RootCube,
) -> Result<(BeadTables, Vec<BeadSegment>)> {
    let paths: Vec<&Toolpath> = sources.iter().map(|source| source.toolpath).collect();
    let passes = passes_of(&paths, count);
    let counted: Vec<(&Toolpath, &Passes)> = paths.iter().copied().zip(&passes).collect();
    let (solids, segments) = Solids::of_passes(&counted, root, outline)?;
    let mut tables = tables(sources, &solids)?;
    if count == Count::Passes {
        tables.passes = first_passes(&counted);
    }
    let named = ListSources { solids: &solids, paths: &paths, count };
    let lines: Vec<u64> = match count {
        Count::Passes => named.lines().collect(),
        Count::Beads => vec![0; segments.len()],
    };
    let all = segments.iter().zip(lines).filter(|(segment, _)| !solids.is_void(segment));
    let listed = all.map(|(segment, line)| BeadSegment {
        a: segment.a,
        b: segment.b,
        section: segment.profile,
        pass: segment.pass,
        line,
    });
    Ok((tables, listed.collect()))
}
