//! Surfaces in colours that something else than w decides.

use super::camera::{Vector, dot, scaled, sum};
use crate::error::Result;
use crate::lattice::NodeKey;
use std::cell::Cell;

/// Points are on one face whose normals have this cosine or more.
const ALIKE: f64 = 0.98;
/// Points of a pixel are not farther apart, in pixels, unless one lies behind the other.
const BESIDE: f64 = 3.0;

/// Where a ray meets the boundary w = 0.5.
#[derive(Clone, Copy, Debug)]
pub struct Met {
    /// The node whose brick the ray is in.
    pub key: NodeKey,
    /// The point, in world coordinates.
    pub at: Vector,
    /// The outward unit normal there.
    pub normal: Vector,
}

/// Decides the colour of the boundary w = 0.5, point by point. It is asked from many threads, and what it says depends
/// on nothing but the point.
pub trait Tint: Sync {
    /// The colour at a point, sRGB, opaque and lit; `None` leaves the point to the style.
    ///
    /// # Errors
    /// What reading gives.
    fn colour(&self, met: Met) -> Result<Option<[u8; 3]>>;

    /// Whether the colour at one point of a pixel may stand for others of the pixel on the same face, as what it takes long to
    /// find may.
    fn is_slow(&self) -> bool;

    /// Whether a coarse node may stand for what is below it: nothing there has a colour that the node's own cells would
    /// not find.
    fn is_plain(&self, key: NodeKey) -> bool;
}

/// The tint of a scene as the rays of one pixel ask it.
pub(super) struct Asked<'a> {
    tint: Option<&'a dyn Tint>,
    /// What was said last in this pixel: point, normal and colour.
    last: Cell<Option<(Vector, Vector, [u8; 3])>>,
}

impl<'a> Asked<'a> {
    pub fn new(tint: Option<&'a dyn Tint>) -> Asked<'a> {
        Asked { tint, last: Cell::new(None) }
    }

    /// Forgets what was said.
    pub fn clear(&self) {
        self.last.set(None);
    }

    /// The colour at a point where a pixel is so large.
    ///
    /// # Errors
    /// What reading gives.
    pub fn colour(&self, met: Met, pixel: f64) -> Result<Option<[u8; 3]>> {
        let Some(tint) = self.tint else { return Ok(None) };
        if !tint.is_slow() {
            return tint.colour(met);
        }
        if let Some((at, normal, colour)) = self.last.get() {
            let away = sum(met.at, scaled(at, -1.0));
            let is_beside = dot(away, away) <= (BESIDE * pixel) * (BESIDE * pixel);
            if is_beside && dot(normal, met.normal) >= ALIKE {
                return Ok(Some(colour));
            }
        }
        let colour = tint.colour(met)?;
        self.last.set(colour.map(|colour| (met.at, met.normal, colour)));
        Ok(colour)
    }
}
