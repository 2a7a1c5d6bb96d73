//! Deviation of the surface of each layer, and of each feature.

use super::deviation::Reference;
use super::motion::Motion;
use super::surface::{PatchInfo, Surface};
use super::triangles::PreviousPlace;
use crate::analysis::{CoveringPass, beads_at_points};
use crate::error::Result;
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::store::{BeadTables, Store};
use std::collections::BTreeMap;

/// Signed distances of some surface from a reference, weighted by area, in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceDeviation {
    /// Crossings whose polygons are the surface.
    pub crossings: u64,
    /// Their area.
    pub area: f64,
    /// The least.
    pub min: f64,
    /// The greatest.
    pub max: f64,
    sum: f64,
    squares: f64,
}

impl Default for SurfaceDeviation {
    fn default() -> SurfaceDeviation {
        let (min, max) = (f64::INFINITY, f64::NEG_INFINITY);
        SurfaceDeviation { crossings: 0, area: 0.0, min, max, sum: 0.0, squares: 0.0 }
    }
}

impl SurfaceDeviation {
    fn of(area: f64, value: f64) -> SurfaceDeviation {
        let (sum, squares) = (area * value, area * value * value);
        SurfaceDeviation { crossings: 1, area, min: value, max: value, sum, squares }
    }

    fn add(&mut self, other: &SurfaceDeviation) {
        self.crossings += other.crossings;
        self.area += other.area;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.sum += other.sum;
        self.squares += other.squares;
    }

    /// Their mean.
    pub fn mean(&self) -> f64 {
        self.sum / self.area.max(f64::MIN_POSITIVE)
    }

    /// The root of the mean of their squares.
    pub fn rms(&self) -> f64 {
        (self.squares / self.area.max(f64::MIN_POSITIVE)).sqrt()
    }
}

/// Deviations by what deposited the surface: by layer, counted from 0, and by the number of the feature. `None` is surface below
/// which no bead was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeviationByBead {
    /// By layer.
    pub layers: BTreeMap<Option<u32>, SurfaceDeviation>,
    /// By feature.
    pub features: BTreeMap<Option<u16>, SurfaceDeviation>,
}

impl DeviationByBead {
    fn add(&mut self, other: &DeviationByBead) {
        other.layers.iter().for_each(|(layer, some)| self.layers.entry(*layer).or_default().add(some));
        other.features.iter().for_each(|(name, some)| self.features.entry(*name).or_default().add(some));
    }
}

/// Deviations at all crossings of a part by the bead below each: of several the one that was deposited last. `motion` takes the part
/// to the reference. What has no number does not count.
///
/// # Errors
/// If the store does not tell beads apart; what reading it and the reference gives; [`crate::error::Error::Interrupted`].
pub fn deviation_by_bead(
    (store, tables): (&Store, &BeadTables),
    part: &Surface,
    (reference, motion): (Reference<'_>, Motion),
    progress: &dyn Progress,
) -> Result<DeviationByBead> {
    let (leaves, cell) = (part.leaves().len(), part.cell());
    progress.phase("layers and features", Some(leaves as u64), "bricks");
    let make = |_: &mut (), leaf: usize| {
        progress.check()?;
        let patches = part.patches_of(leaf);
        let inner: Vec<[f64; 3]> = patches.iter().map(|patch| part.to_world(patch.inner())).collect();
        let beads = beads_at_points(store, tables, &inner)?;
        let (mut found, mut last) = (DeviationByBead::default(), PreviousPlace::default());
        for (PatchInfo { at, area, .. }, beads) in patches.iter().zip(&beads) {
            let value = reference.opposite_next(motion.apply(part.to_world(*at)), &mut last)?.signed;
            if !value.is_finite() {
                continue;
            }
            let latest = beads.iter().map(|CoveringPass { number, .. }| *number).max();
            let row = latest.map(|number| &tables.beads[tables.bead_of(number).0 as usize]);
            let some = SurfaceDeviation::of(area * cell * cell, value);
            found.layers.entry(row.map(|row| row.layer)).or_default().add(&some);
            found.features.entry(row.map(|row| row.feature)).or_default().add(&some);
        }
        Ok(found)
    };
    let mut all = DeviationByBead::default();
    run_ordered(
        leaves,
        8 * rayon::current_num_threads(),
        || (),
        make,
        |found: DeviationByBead| {
            all.add(&found);
            progress.advance(1);
            Ok(())
        },
    )?;
    Ok(all)
}
