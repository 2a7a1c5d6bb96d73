//! Bricks that come from elsewhere, before rays wait for one after the other.
//!
//! Some rays are followed as far as bricks are here. Where one needs another brick it ends; all that are missing are asked
//! for at once, and the rays go on. After a few rounds nothing is missing but what lies between these rays.

use super::frame::TILE;
use super::trace::RayTracer;
use super::{Frame, ROUNDS_MAX};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey};
use crate::progress::Progress;
use crate::store::Walk;
use rayon::prelude::*;
use std::collections::HashSet;

/// Rays across a brick whose cells are as large as they may be.
const RAYS_A_BRICK: f64 = 8.0;
/// Such bricks along the height of a part of the picture that is fetched at once: many requests side by side, few bricks
/// in memory.
const BRICKS_A_PART: f64 = 8.0;

impl Frame<'_> {
    /// Whether bricks come from elsewhere and are to be fetched before rays wait for them. What colours the part by something
    /// else than w has read the store already.
    pub(super) fn is_fetched(&self) -> bool {
        self.scene.bricks.tree.is_elsewhere() && self.scene.tint.is_none()
    }

    /// Has fetched what the bands of tiles need that begin with this one, if it begins a part of the picture.
    pub(super) fn fetch(&self, band: u32, progress: &dyn Progress) -> Result<()> {
        if !self.is_fetched() {
            return Ok(());
        }
        let brick_pixels = self.cell_pixels * BRICK_CELLS as f64;
        let bands = ((brick_pixels * BRICKS_A_PART) as u32 / TILE).max(1);
        if !band.is_multiple_of(bands) {
            return Ok(());
        }
        let step = (brick_pixels / RAYS_A_BRICK).clamp(1.0, f64::from(TILE)) as usize;
        let rows = band * TILE..((band + bands) * TILE).min(self.scene.size[1]);
        let mut fetched = HashSet::new();
        for _ in 0..ROUNDS_MAX {
            progress.check()?;
            let rows = rows.clone().into_par_iter().step_by(step);
            let missing: Vec<Vec<NodeKey>> =
                rows.map(|y| self.missing_along(y, step)).collect::<Result<_>>()?;
            if !self.fetch_all(missing.concat(), &mut fetched)? {
                break;
            }
        }
        Ok(())
    }

    /// Has those bricks fetched that were not yet; false if there are none.
    pub(super) fn fetch_all(
        &self,
        mut missing: Vec<NodeKey>,
        fetched: &mut HashSet<NodeKey>,
    ) -> Result<bool> {
        let bricks = &self.scene.bricks;
        missing.retain(|key| fetched.insert(*key));
        missing.sort_unstable();
        let walk = Walk::new(bricks.tree, missing.len(), |number| Some(missing[number]));
        // Handed out in order.
        missing.iter().enumerate().par_bridge().try_for_each_init(Default::default, |lane, (n, key)| {
            walk.at(n);
            bricks.get(*key, lane)?;
            // Those that are kept since long shall not seem to be of more use.
            bricks.will_be_used(*key);
            Ok(())
        })?;
        Ok(!missing.is_empty())
    }

    /// The bricks that rays through a row of pixels need and that are not here.
    fn missing_along(&self, y: u32, step: usize) -> Result<Vec<NodeKey>> {
        let mut tracer = RayTracer::new(self).noting();
        for x in (0..self.scene.size[0]).step_by(step) {
            tracer.begin_pixel();
            tracer.follow(&self.ray([x, y].map(|c| f64::from(c) + 0.5)))?;
        }
        Ok(tracer.take_missing())
    }
}
