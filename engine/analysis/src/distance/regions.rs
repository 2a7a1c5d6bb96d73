//! Connected regions of patches whose value was asked about.

use super::answers::Place;
use super::surface::{PatchInfo, Surface};
use crate::error::Result;
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::sets::DisjointSets;
use std::collections::HashMap;

/// A patch that counts, in world units.
pub(super) struct WeightedPatch {
    pub place: Place,
    pub at: [f64; 3],
    /// A place in the solid beside it.
    pub inner: [f64; 3],
    pub area: f64,
    pub value: f64,
    /// A patch that belongs to the same region if it counts, too.
    pub opposite: Option<Place>,
    /// Names of its polygon's corners; patches that share one touch.
    pub corners: Vec<[i64; 3]>,
}

/// Patches that hang together.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Area of the surface.
    pub area: f64,
    /// The integral of the value's size over it.
    pub volume: f64,
    /// The value of the least and the greatest size.
    pub least: f64,
    /// See `least`.
    pub greatest: f64,
    /// The mean value, weighted by area.
    pub mean: f64,
    /// The middle of the area.
    pub centre: [f64; 3],
    /// Least and greatest coordinates of the crossings.
    pub bounds: [[f64; 3]; 2],
    /// Places in the solid beside the lowest and the highest crossing.
    pub ends: [[f64; 3]; 2],
    /// How many patches.
    pub patches: u64,
}

/// The patches of a surface that have a value that counts, with what lies opposite, in Morton order. `value` may keep something
/// from one patch to the next of a leaf.
///
/// # Errors
/// What reading the surface and `value` give; [`crate::error::Error::Interrupted`].
pub(super) fn marked<L: Default>(
    surface: &Surface,
    progress: &dyn Progress,
    value: impl Fn(&mut L, &PatchInfo) -> Result<Option<(f64, Option<Place>)>> + Sync,
) -> Result<Vec<WeightedPatch>> {
    let (leaves, cell) = (surface.leaves().len(), surface.cell());
    progress.phase("regions", Some(leaves as u64), "bricks");
    let make = |_: &mut (), leaf: usize| {
        progress.check()?;
        let (mut found, mut last) = (Vec::new(), L::default());
        for (n, patch) in surface.patches_of(leaf).into_iter().enumerate() {
            if let Some((value, opposite)) = value(&mut last, &patch)? {
                found.push(WeightedPatch {
                    place: Place { leaf: leaf as u32, patch: n as u32 },
                    at: surface.to_world(patch.at),
                    inner: surface.to_world(patch.inner()),
                    area: patch.area * cell * cell,
                    value,
                    opposite,
                    corners: patch.corners,
                });
            }
        }
        Ok(found)
    };
    let mut marked = Vec::new();
    run_ordered(
        leaves,
        8 * rayon::current_num_threads(),
        || (),
        make,
        |found| {
            marked.extend(found);
            progress.advance(1);
            Ok(())
        },
    )?;
    Ok(marked)
}

/// Regions of patches in Morton order, the largest area first.
pub(super) fn joined(marked: Vec<WeightedPatch>) -> Vec<Region> {
    let mut sets = DisjointSets::default();
    sets.extend(marked.len());
    let mut by_corner: HashMap<[i64; 3], u32> = HashMap::new();
    for (n, patch) in marked.iter().enumerate() {
        for corner in &patch.corners {
            let first = *by_corner.entry(*corner).or_insert(n as u32);
            sets.unite(first, n as u32);
        }
        // Patches stand in the order of their places.
        let opposite = patch.opposite.and_then(|at| marked.binary_search_by_key(&at, |m| m.place).ok());
        if let Some(m) = opposite {
            sets.unite(n as u32, m as u32);
        }
    }
    let mut regions: HashMap<u32, usize> = HashMap::new();
    let mut found: Vec<Region> = Vec::new();
    for (n, patch) in marked.iter().enumerate() {
        let set = sets.find(n as u32);
        let at = *regions.entry(set).or_insert_with(|| {
            found.push(Region {
                area: 0.0,
                volume: 0.0,
                least: f64::INFINITY,
                greatest: 0.0,
                mean: 0.0,
                centre: [0.0; 3],
                bounds: [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]],
                ends: [patch.inner; 2],
                patches: 0,
            });
            found.len() - 1
        });
        let region = &mut found[at];
        region.area += patch.area;
        region.volume += patch.area * patch.value.abs();
        region.mean += patch.area * patch.value;
        if patch.value.abs() < region.least.abs() {
            region.least = patch.value;
        }
        if patch.value.abs() > region.greatest.abs() {
            region.greatest = patch.value;
        }
        if patch.at[2] < region.bounds[0][2] {
            region.ends[0] = patch.inner;
        }
        if patch.at[2] > region.bounds[1][2] {
            region.ends[1] = patch.inner;
        }
        for a in 0..3 {
            region.centre[a] += patch.area * patch.at[a];
            region.bounds[0][a] = region.bounds[0][a].min(patch.at[a]);
            region.bounds[1][a] = region.bounds[1][a].max(patch.at[a]);
        }
        region.patches += 1;
    }
    for region in &mut found {
        let over = 1.0 / region.area.max(f64::MIN_POSITIVE);
        region.mean *= over;
        region.centre = region.centre.map(|c| c * over);
    }
    // Equal areas stay in Morton order.
    found.sort_by(|a, b| b.area.total_cmp(&a.area));
    found
}
