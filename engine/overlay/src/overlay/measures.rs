//! Thickness and deviation at the point that is seen.

use super::scale::{DeviationScale, ThicknessScale};
use super::{Met, Tint};
use crate::distance::Surface;
use crate::distance::deviation::{Motion, Reference};
use crate::distance::thickness::{Options, PreviousContact, at, at_world};
use crate::error::Result;
use crate::lattice::NodeKey;

/// Points that are measured to find where a scale ends, at most about so many.
const POINTS: usize = 4000;
/// The share of points whose numbers are within a scale.
const USUAL: f64 = 0.98;
/// How far from the point that is seen the surface is looked for, in cells.
const REACH: f64 = 4.0;

/// Colours the boundary by how thick the part is there, or how wide a gap.
pub struct ThicknessTint<'a> {
    /// The part's surface.
    pub surface: &'a Surface,
    /// What is measured.
    pub options: Options,
    /// Its colours.
    pub scale: ThicknessScale,
}

/// Colours the boundary by its signed distance from a reference.
pub struct DeviationTint<'a> {
    /// The part's surface.
    pub surface: &'a Surface,
    /// What it is compared with.
    pub reference: Reference<'a>,
    /// What takes the part there.
    pub motion: Motion,
    /// Its colours.
    pub scale: DeviationScale,
}

impl Tint for ThicknessTint<'_> {
    fn colour(&self, met: Met) -> Result<Option<[u8; 3]>> {
        let value = at_world(self.surface, met.at, self.options, &mut PreviousContact::default())
            .map_or(f64::NAN, |measured| measured.value);
        Ok(Some(self.scale.colour(value)))
    }

    fn is_slow(&self) -> bool {
        true
    }

    fn is_plain(&self, _: NodeKey) -> bool {
        // Points are moved onto the surface before they are measured.
        true
    }
}

impl Tint for DeviationTint<'_> {
    fn colour(&self, met: Met) -> Result<Option<[u8; 3]>> {
        let foot = self.surface.closest(self.surface.to_cells(met.at), REACH);
        let at = foot.map_or(met.at, |foot| self.surface.to_world(foot.at));
        Ok(Some(self.scale.colour(self.reference.opposite(self.motion.apply(at))?.signed)))
    }

    fn is_slow(&self) -> bool {
        true
    }

    fn is_plain(&self, _: NodeKey) -> bool {
        true
    }
}

/// A thickness that few points of the surface exceed, in world units: the end of a scale.
///
/// # Errors
/// What reading the surface gives.
pub fn usual_thickness(surface: &Surface, options: Options) -> Result<f64> {
    let (mut values, mut last) = (Vec::new(), PreviousContact::default());
    each_point(surface, |place, normal| {
        values.push(at(surface, (place, normal), options, &mut last).value * surface.cell());
        Ok(())
    })?;
    Ok(most_of(values))
}

/// A distance from a reference that few points of the surface exceed, in world units: the end of a scale.
///
/// # Errors
/// What reading the surfaces gives.
pub fn usual_deviation(surface: &Surface, reference: Reference<'_>, motion: Motion) -> Result<f64> {
    let mut values = Vec::new();
    each_point(surface, |place, _| {
        values.push(reference.opposite(motion.apply(surface.to_world(place)))?.signed.abs());
        Ok(())
    })?;
    Ok(most_of(values))
}

/// What all but few of some numbers are at most; 0 of none.
fn most_of(mut values: Vec<f64>) -> f64 {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    let place = (values.len() as f64 * USUAL).ceil() as usize;
    values.get(place.max(1) - 1).copied().unwrap_or(0.0)
}

/// Some crossings of a surface with their normals, in cells, in Morton order.
fn each_point(surface: &Surface, mut each: impl FnMut([f64; 3], [f64; 3]) -> Result<()>) -> Result<()> {
    let step = (surface.patches() as usize).div_ceil(POINTS).max(1);
    let mut next = 0;
    for leaf in 0..surface.leaves().len() {
        let patches = surface.patches_of(leaf);
        while next < patches.len() {
            each(patches[next].at, patches[next].normal)?;
            next += step;
        }
        next -= patches.len();
    }
    Ok(())
}
