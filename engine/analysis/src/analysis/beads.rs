//! Which passes and beads cover a point, from a store that tells them apart.

use crate::brick::Count;
use crate::error::{Error, Result};
use crate::lattice::{NodeKey, ROOT_BITS, Units};
use crate::solid::{Outline, Segment, SolidProfile, Solids};
use crate::store::{BeadSegment, BeadTables, BrickTree, SectionRow, Store};
use rayon::prelude::*;

/// Points that a thread takes at once.
const POINTS_AT_ONCE: usize = 1024;

/// A pass that covers a point, or a bead where the store counts those.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CoveringPass {
    /// Number of the pass or bead in the store's tables: see [`BeadTables::bead_of`].
    pub number: u32,
    /// First and last line of the file that deposit what covers the point, from 1: of the pass's segments there, or of the
    /// whole bead where the store counts beads.
    pub lines: (u64, u64),
}

/// The passes or beads that cover each point of `points` (world coordinates), in order. The rule is that of the samples,
/// so at a sample there are as many as its value; but both of two passes that follow each other are named where they have
/// a round end in common, which counts once.
///
/// # Errors
/// [`Error::Store`] if the store does not tell beads apart or is damaged.
pub fn beads_at_points(
    store: &Store,
    tables: &BeadTables,
    points: &[[f64; 3]],
) -> Result<Vec<Vec<CoveringPass>>> {
    let solids = solids_of(store, tables)?;
    let parts: Vec<Vec<Vec<CoveringPass>>> = points
        .par_chunks(POINTS_AT_ONCE)
        .map(|chunk| of_chunk(store, tables, &solids, chunk))
        .collect::<Result<_>>()?;
    Ok(parts.concat())
}

/// The solids of a store's beads.
///
/// # Errors
/// [`Error::Store`] if the store names a section that this program does not know.
pub fn solids_of(store: &Store, tables: &BeadTables) -> Result<Solids> {
    let outline = store.meta().beads.as_ref().and_then(|beads| Outline::from_name(&beads.section));
    let Some(outline) = outline else {
        let what = "its beads have a section that this program does not know";
        return Err(Error::store(store.path(), "metadata", what, "use the program that wrote it"));
    };
    let profile = |s: &SectionRow| SolidProfile::new(outline, s.half_width, s.half_height, s.axis);
    Ok(Solids::of_profiles(tables.sections.iter().map(profile).collect()))
}

/// One thread's share: neighbours in the list are often neighbours in space, so the last leaf is kept.
fn of_chunk(
    store: &Store,
    tables: &BeadTables,
    solids: &Solids,
    points: &[[f64; 3]],
) -> Result<Vec<Vec<CoveringPass>>> {
    let edge = f64::from(1u32 << ROOT_BITS);
    let mut last: Option<(NodeKey, Vec<(Segment, u64)>)> = None;
    let mut of_point = |point: &[f64; 3]| {
        let units = store.root().to_units(*point);
        if !units.iter().all(|u| (0.0..edge).contains(u)) {
            return Ok(Vec::new());
        }
        let p: Units = units.map(|u| u as i32 | 1);
        let Some(leaf) = super::sample::leaf_at(store, p.map(|u| f64::from(u - 1))) else {
            return Ok(Vec::new());
        };
        if last.as_ref().is_none_or(|(key, _)| *key != leaf) {
            let stored = store.segments(leaf, tables)?;
            let segment =
                |s: &BeadSegment| (Segment { a: s.a, b: s.b, profile: s.section, pass: s.pass }, s.line);
            last = Some((leaf, stored.iter().map(segment).collect()));
        }
        let mut found: Vec<CoveringPass> = Vec::new();
        let segments = last.iter().flat_map(|(_, segments)| segments);
        for (segment, line) in segments.filter(|(segment, _)| solids.covers(segment, p)) {
            match found.last_mut().filter(|last| last.number == segment.pass) {
                Some(last) => last.lines = (last.lines.0.min(*line), last.lines.1.max(*line)),
                None => found.push(CoveringPass { number: segment.pass, lines: (*line, *line) }),
            }
        }
        if tables.count() == Count::Beads {
            found.iter_mut().for_each(|found| found.lines = tables.beads[found.number as usize].lines);
        }
        Ok(found)
    };
    points.iter().map(&mut of_point).collect()
}
