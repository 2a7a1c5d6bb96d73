//! The same colours in plane sections: voids filled, a band along the surface of the part.

use super::voids::VoidTint;
use crate::distance::Surface;
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::render::{Met, Tint};
use crate::section::SectionTint;

/// The part where nothing else is to be seen.
const SOLID: [u8; 3] = [222; 3];

impl SectionTint for VoidTint<'_> {
    fn colour(&self, world: [f64; 3], w: f64) -> Result<Option<[u8; 3]>> {
        if w >= 1.0 { Ok(Some(SOLID)) } else { self.at(world) }
    }
}

/// A band along the surface within the part, in the colours of a tint at the nearest point of the surface.
pub struct BandTint<'a> {
    surface: &'a Surface,
    tint: &'a dyn Tint,
    /// Width of the band in cells.
    width: f64,
}

impl<'a> BandTint<'a> {
    /// Of a surface, in a band of that width in world units.
    pub fn new(surface: &'a Surface, tint: &'a dyn Tint, width: f64) -> BandTint<'a> {
        BandTint { surface, tint, width: width / surface.cell() }
    }
}

impl SectionTint for BandTint<'_> {
    fn colour(&self, world: [f64; 3], w: f64) -> Result<Option<[u8; 3]>> {
        if w < 1.0 {
            return Ok(None);
        }
        let Some(foot) = self.surface.closest(self.surface.to_cells(world), self.width) else {
            return Ok(Some(SOLID));
        };
        let at = self.surface.to_world(foot.at);
        let colour = self.tint.colour(Met { key: NodeKey::ROOT, at, normal: foot.normal })?;
        Ok(Some(colour.unwrap_or(SOLID)))
    }
}
