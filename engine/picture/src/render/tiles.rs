//! A frame drawn tile by tile: rays through its pixels.

use super::ROUNDS_MAX;
use super::camera::Ray;
use super::frame::{Frame, TILE};
use super::relief::{self, Band, BandNeighbours};
use super::trace::RayTracer;
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::picture::{Rgba, mean};
use crate::progress::Progress;
use rayon::prelude::*;
use std::collections::HashSet;

/// Pixels with the depth of the nearest opaque thing in each.
type Tile = Vec<(Rgba, f64)>;

impl Frame<'_> {
    /// How far along each of the rays the first opaque thing lies; `None` where there is none.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub fn distances(&self, rays: &[Ray]) -> Result<Vec<Option<f64>>> {
        let parts: Vec<Vec<Option<f64>>> = rays
            .par_chunks((TILE * TILE) as usize)
            .map(|rays| {
                let mut tracer = RayTracer::new(self);
                rays.iter().map(|ray| Ok(tracer.follow(ray)?.1)).collect::<Result<_>>()
            })
            .collect::<Result<_>>()?;
        Ok(parts.concat())
    }

    /// Hands over the rows of the picture from the top. The pixels depend neither on the number of threads nor on the
    /// memory for bricks.
    ///
    /// # Errors
    /// [`Error::Interrupted`](crate::error::Error::Interrupted); what reading the tree and `row` give.
    pub fn draw(&self, progress: &dyn Progress, row: impl FnMut(&[Rgba]) -> Result<()>) -> Result<()> {
        let band = |number| {
            self.fetch(number, progress)?;
            self.band(number, progress)
        };
        self.draw_bands(progress, band, row)
    }

    /// The rows of bands from the top.
    pub(super) fn draw_bands(
        &self,
        progress: &dyn Progress,
        mut band: impl FnMut(u32) -> Result<Band>,
        mut row: impl FnMut(&[Rgba]) -> Result<()>,
    ) -> Result<()> {
        let height = self.scene.size[1];
        let bands = height.div_ceil(TILE);
        progress.phase("drawing", Some(bands.into()), "bands");
        // The row of bands around the one that is handed over: above, itself, below.
        let mut around: [Option<Band>; 3] = [None, None, None];
        for number in 0..=bands {
            progress.check()?;
            around.rotate_left(1);
            around[2] = (number < bands).then(|| band(number)).transpose()?;
            let [above, this, below] = around.each_ref().map(Option::as_ref);
            let Some(this) = this else { continue };
            let between = BandNeighbours { above, band: this, below, unit: relief::unit_of(height) };
            for y in 0..this.rows() {
                row(&between.row(y, |distance| self.eye.camera.pixel_at(distance)))?;
            }
            progress.advance(1);
        }
        Ok(())
    }

    /// A row of tiles.
    pub(super) fn band(&self, number: u32, progress: &dyn Progress) -> Result<Band> {
        let [width, height] = self.scene.size;
        let rows = TILE.min(height - number * TILE);
        let place = |tile: u32| ([tile * TILE, number * TILE], [TILE, rows]);
        let tiles = self.tiles(width.div_ceil(TILE), place, progress)?;
        let pixel = |n: usize| {
            let (x, y) = (n % width as usize, n / width as usize);
            tiles[x / TILE as usize][y * TILE as usize + x % TILE as usize]
        };
        let (pixels, depths) = (0..width as usize * rows as usize).map(pixel).unzip();
        Ok(Band { width: width as usize, pixels, depths })
    }

    /// The pixels of so many tiles. Those that need a brick which has to be fetched are drawn again when it is here.
    fn tiles(
        &self,
        count: u32,
        place: impl Fn(u32) -> ([u32; 2], [u32; 2]) + Sync,
        progress: &dyn Progress,
    ) -> Result<Vec<Tile>> {
        let draw = |tracer: &mut RayTracer<'_>, tile: u32| {
            // Asked tile by tile: somebody who looks on may already want another picture.
            progress.check()?;
            let (from, size) = place(tile);
            self.tile(tracer, from, size)
        };
        let (mut drawn, mut fetched) = (vec![None; count as usize], HashSet::new());
        let mut rounds = if self.is_fetched() { ROUNDS_MAX } else { 0 };
        loop {
            let tracer = || if rounds > 0 { RayTracer::new(self).noting() } else { RayTracer::new(self) };
            let missing = drawn.par_iter_mut().enumerate().filter(|(_, drawn)| drawn.is_none());
            let missing = missing.map_init(tracer, |tracer, (tile, drawn)| {
                let pixels = draw(tracer, tile as u32)?;
                let missing = tracer.take_missing();
                *drawn = missing.is_empty().then_some(pixels);
                Ok(missing)
            });
            let missing: Vec<Vec<NodeKey>> = missing.collect::<Result<_>>()?;
            if drawn.iter().all(Option::is_some) {
                return Ok(drawn.into_iter().flatten().collect());
            }
            // Where memory is so little that bricks are gone before they are needed, rays wait for them.
            rounds = if self.fetch_all(missing.concat(), &mut fetched)? { rounds - 1 } else { 0 };
        }
    }

    /// The pixels of a tile, with the depth of the nearest opaque thing in each.
    fn tile(&self, tracer: &mut RayTracer<'_>, from: [u32; 2], [width, height]: [u32; 2]) -> Result<Tile> {
        let rays = self.supersample;
        let mut parts = Vec::with_capacity((rays * rays) as usize);
        let mut pixels = Vec::with_capacity((width * height) as usize);
        for pixel in 0..width * height {
            parts.clear();
            tracer.begin_pixel();
            let mut nearest = f64::INFINITY;
            for ray in 0..rays * rays {
                let offset = |n: u32| (f64::from(n) + 0.5) / f64::from(rays);
                let x = f64::from(from[0] + pixel % width) + offset(ray % rays);
                let y = f64::from(from[1] + pixel / width) + offset(ray / rays);
                let (gathered, hit) = tracer.follow(&self.eye.camera.ray([x, y]))?;
                nearest = nearest.min(hit.unwrap_or(f64::INFINITY));
                parts.push(gathered.over(self.scene.background));
            }
            pixels.push((mean(&parts), nearest));
        }
        Ok(pixels)
    }
}
