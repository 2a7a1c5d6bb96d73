//! Which beads cover a point, from a store that tells them apart.

use crate::error::{Error, Result};
use crate::lattice::{NodeKey, ROOT_BITS, Units};
use crate::solid::{Outline, Profile, Segment, Solids};
use crate::store::{BeadTables, BrickTree, SectionRow, Store};
use rayon::prelude::*;

/// Points that a thread takes at once.
const POINTS_AT_ONCE: usize = 1024;

/// The beads that cover each point of `points` (world coordinates), as numbers in the store's tables, in
/// order. The rule is that of the samples, so at a sample there are as many as its value.
///
/// # Errors
/// [`Error::Store`] if the store does not tell beads apart or is damaged.
pub fn beads_at_points(store: &Store, tables: &BeadTables, points: &[[f64; 3]]) -> Result<Vec<Vec<u32>>> {
    let outline = store.meta().beads.as_ref().and_then(|beads| Outline::from_name(&beads.section));
    let Some(outline) = outline else {
        let what = "its beads have a section that this program does not know";
        return Err(Error::store(store.path(), "metadata", what, "use the program that wrote it"));
    };
    let profile = |s: &SectionRow| Profile::new(outline, s.half_width, s.half_height, s.axis);
    let solids = Solids::of_profiles(tables.sections.iter().map(profile).collect());
    let parts: Vec<Vec<Vec<u32>>> = points
        .par_chunks(POINTS_AT_ONCE)
        .map(|chunk| of_chunk(store, tables, &solids, chunk))
        .collect::<Result<_>>()?;
    Ok(parts.concat())
}

/// One thread's share: neighbours in the list are often neighbours in space, so the last leaf is kept.
fn of_chunk(
    store: &Store,
    tables: &BeadTables,
    solids: &Solids,
    points: &[[f64; 3]],
) -> Result<Vec<Vec<u32>>> {
    let edge = f64::from(1u32 << ROOT_BITS);
    let mut last: Option<(NodeKey, Vec<Segment>)> = None;
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
            let segments =
                stored.iter().map(|s| Segment { a: s.a, b: s.b, profile: s.section, bead: s.bead }).collect();
            last = Some((leaf, segments));
        }
        let mut beads: Vec<u32> = last
            .iter()
            .flat_map(|(_, segments)| segments)
            .filter(|segment| solids.covers(segment, p))
            .map(|segment| segment.bead)
            .collect();
        beads.dedup();
        Ok(beads)
    };
    points.iter().map(&mut of_point).collect()
}
