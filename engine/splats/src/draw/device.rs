//! Pictures of splats by a device: placed and sorted by tile here, drawn there, lit here.
//!
//! Tiles go there in batches, each with copies of the splats that may touch it, so a device needs no room for all. Pixels
//! meet splats in their order, so the picture does not depend on the room.

use super::frame::{DrawFrame, TileBits};
use super::light::SplatLight;
use super::place::{PlacedSplat, PlacedSplats};
use super::{DrawOptions, SplatPicture, SplatScene, draw, finish, frame_of, place};
use crate::error::Result;
use crate::gpu::{DeviceFailure, Gpu, SplatBatch, SplatCapacity, SplatDrawer};
use crate::picture::Rgba;
use crate::progress::Progress;
use brickfield_shaders::{SplatTile, SplatView, TILE, TileSplat};
use rayon::prelude::*;
use std::ops::Range;

/// Columns and rows of a tile on the device.
const BITS: TileBits = [TILE.ilog2(); 2];
const SIDE: usize = TILE as usize;
const TILE_PIXELS: usize = SIDE * SIDE;
/// Distances beyond this are those of nothing.
const NOTHING: f32 = 1e29;

/// Draws splats on a device as [`draw`] does, up to rounding; the device decides otherwise where a ray grazes an edge. If it
/// fails the processor draws in its place, and why is told.
///
/// # Errors
/// As [`draw`]; failures of the device are none.
pub fn draw_on(
    gpu: &Gpu,
    scene: &SplatScene,
    options: &DrawOptions,
    progress: &dyn Progress,
) -> Result<(SplatPicture, Option<DeviceFailure>)> {
    let frame = frame_of(options)?;
    let placed = place(&frame, scene, BITS, progress)?;
    match shade(gpu, &frame, &placed, options, progress)? {
        Ok(rays) => Ok((finish(rays, &frame, &placed, options), None)),
        Err(failure) => {
            drop(placed);
            Ok((draw(scene, options, progress)?, Some(failure)))
        }
    }
}

/// The colours of all rays, unless the device fails.
fn shade(
    gpu: &Gpu,
    frame: &DrawFrame,
    placed: &[PlacedSplats],
    options: &DrawOptions,
    progress: &dyn Progress,
) -> Result<std::result::Result<Vec<Rgba>, DeviceFailure>> {
    let tiles = TilesOfSplats::new(frame, placed);
    progress.phase("drawing splats", Some(tiles.tiles.len() as u64), "tiles");
    let light = SplatLight::new(options.view.axes());
    let mut pixels = vec![options.background; frame.size.map(|side| side as usize).iter().product()];
    if tiles.tiles.is_empty() {
        return Ok(Ok(pixels));
    }
    let mut drawer = match SplatDrawer::new(gpu) {
        Ok(drawer) => drawer,
        Err(failure) => return Ok(Err(failure)),
    };
    let mut input = SplatBatch { view: view_of(frame), sizes: tiles.sizes.clone(), ..SplatBatch::default() };
    let mut from = 0;
    while from < tiles.tiles.len() {
        progress.check()?;
        let batch = tiles.batch(from, drawer.room());
        if let Err(failure) = tiles.draw(batch, &mut drawer, &mut input) {
            return Ok(Err(failure));
        }
        light_tiles(frame, &light, batch, drawer.pixels(batch.len()), &mut pixels);
        from += batch.len();
        progress.advance(batch.len() as u64);
    }
    Ok(Ok(pixels))
}

/// What the device is told of the eye.
fn view_of(frame: &DrawFrame) -> SplatView {
    let four = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
    // Drivers may know no infinite numbers.
    let [low, high] = frame.corners.map(|corner| four(corner.map(|c| c.clamp(f32::MIN, f32::MAX))));
    SplatView {
        origin: four(frame.origin),
        corner: four(frame.corner),
        across: four(frame.steps[0]),
        down: four(frame.steps[1]),
        low,
        high,
        parallel: frame.parallel.into(),
        open: frame.open.into(),
        ..SplatView::default()
    }
}

/// A tile that splats may touch.
#[derive(Clone, Copy)]
struct TouchedTile {
    column: u32,
    row: u32,
    splats: usize,
}

/// The tiles of a picture with their splats.
struct TilesOfSplats<'a> {
    /// By row of tiles: the pieces that may touch it, with the numbers of their sizes.
    rows: Vec<Vec<(&'a PlacedSplats, u32)>>,
    /// Row by row, those that have splats.
    tiles: Vec<TouchedTile>,
    /// Sizes of cells as the device knows them.
    sizes: Vec<[f32; 4]>,
}

impl TilesOfSplats<'_> {
    fn new<'a>(frame: &DrawFrame, placed: &'a [PlacedSplats]) -> TilesOfSplats<'a> {
        let mut sizes: Vec<[f32; 4]> = Vec::new();
        let mut pieces = Vec::with_capacity(placed.len());
        for placed in placed {
            let size = [placed.reach, placed.per_square, placed.together, 0.0];
            let known = sizes.iter().position(|known| *known == size);
            let number = known.unwrap_or_else(|| {
                sizes.push(size);
                sizes.len() - 1
            });
            pieces.push((placed, number as u32));
        }
        let [columns, rows] = frame.size.map(|side| side.div_ceil(TILE));
        let in_row = |row: u32| {
            let pieces: Vec<_> = pieces.iter().copied().filter(|(placed, _)| placed.is_in_row(row)).collect();
            let touched = |column: u32| {
                let splats = pieces.iter().map(|(placed, _)| placed.in_tile([column, row]).len()).sum();
                TouchedTile { column, row, splats }
            };
            let tiles: Vec<_> = (0..columns).map(touched).filter(|tile| tile.splats > 0).collect();
            (pieces, tiles)
        };
        let (rows, tiles): (Vec<_>, Vec<_>) = (0..rows).into_par_iter().map(in_row).unzip();
        TilesOfSplats { rows, tiles: tiles.concat(), sizes }
    }

    /// Tiles from one on whose splats there is room for all together, at least one tile.
    fn batch(&self, from: usize, room: SplatCapacity) -> &[TouchedTile] {
        let mut left = room.splats;
        let tiles = self.tiles[from..].iter().take(room.tiles);
        let fits = tiles.take_while(|tile| {
            let is_room = tile.splats <= left;
            left = left.saturating_sub(tile.splats);
            is_room
        });
        let count = fits.count().max(1);
        &self.tiles[from..from + count]
    }

    /// Draws a batch of tiles, in as many parts as the tile with the most splats needs.
    fn draw(
        &self,
        batch: &[TouchedTile],
        drawer: &mut SplatDrawer,
        input: &mut SplatBatch,
    ) -> std::result::Result<(), DeviceFailure> {
        let most = batch.iter().map(|tile| tile.splats).max().unwrap_or(0);
        let step = drawer.room().of_tile();
        if most <= step {
            self.pack(batch, 0..step, input);
            return drawer.draw(input);
        }
        for behind in (0..most).step_by(step) {
            self.pack(batch, behind..behind + step, input);
            drawer.find_nearest(input, behind == 0)?;
        }
        for behind in (0..most).step_by(step) {
            self.pack(batch, behind..behind + step, input);
            drawer.blend(input)?;
        }
        Ok(())
    }

    /// Tiles that have splats with these numbers among their own, with these splats.
    fn pack(&self, batch: &[TouchedTile], numbers: Range<usize>, input: &mut SplatBatch) {
        input.tiles.clear();
        let mut some = Vec::with_capacity(batch.len());
        let mut end = 0;
        for (number, tile) in batch.iter().enumerate().filter(|(_, tile)| tile.splats > numbers.start) {
            let count = tile.splats.min(numbers.end) - numbers.start;
            input.tiles.push(SplatTile {
                column: tile.column * TILE,
                row: tile.row * TILE,
                splats_from: end,
                splats: count as u32,
                pixels_from: (number * TILE_PIXELS) as u32,
            });
            some.push((tile, count));
            end += count as u32;
        }
        input.splats.resize(end as usize, TileSplat::default());
        let mut left = input.splats.as_mut_slice();
        let mut parts = Vec::with_capacity(some.len());
        for (tile, count) in some {
            let (part, others) = left.split_at_mut(count);
            parts.push((tile, part));
            left = others;
        }
        parts.into_par_iter().for_each(|(tile, part)| self.pack_tile(tile, numbers.start, part));
    }

    /// The splats of a tile behind some, as many as there are places.
    fn pack_tile(&self, tile: &TouchedTile, behind: usize, places: &mut [TileSplat]) {
        let pieces = self.rows[tile.row as usize].iter();
        let splats = pieces.flat_map(|&(placed, size)| {
            let numbers = placed.in_tile([tile.column, tile.row]).iter();
            numbers.map(move |number| (placed, size, *number as usize))
        });
        for (place, (placed, size, number)) in places.iter_mut().zip(splats.skip(behind)) {
            *place = tile_splat(placed, &placed.splats[number], size);
        }
    }
}

/// A splat as the device knows it.
fn tile_splat(placed: &PlacedSplats, splat: &PlacedSplat, size: u32) -> TileSplat {
    let four = |[x, y, z]: [f32; 3], w: f32| [x, y, z, w];
    let from = (splat.cuts >> 2) as usize;
    let cuts = &placed.cuts[from..from + (splat.cuts & 3) as usize];
    let cut = |number: usize| cuts.get(number).map_or([0.0; 4], |&(normal, d)| four(normal, d));
    let both = |[first, last]: [u16; 2]| u32::from(first) | u32::from(last) << 16;
    TileSplat {
        centre: four(splat.centre, splat.offset),
        normal: four(splat.normal, 0.0),
        first_cut: cut(0),
        second_cut: cut(1),
        columns: both(splat.columns),
        rows: both(splat.rows),
        size,
        cuts: cuts.len() as u32,
    }
}

/// Lights what the device has summed up, and puts it into the picture.
fn light_tiles(
    frame: &DrawFrame,
    light: &SplatLight,
    tiles: &[TouchedTile],
    sums: &[[f32; 4]],
    pixels: &mut [Rgba],
) {
    let lit = |(tile, sums): (&TouchedTile, &[[f32; 4]])| -> [Option<Rgba>; TILE_PIXELS] {
        std::array::from_fn(|n| {
            let [x, y, z, depth] = sums[n];
            let at = [tile.column as usize * SIDE + n % SIDE, tile.row as usize * SIDE + n / SIDE];
            (depth < NOTHING).then(|| light.pixel([x, y, z], frame.along(at[0], at[1])))
        })
    };
    let lit: Vec<_> = tiles.par_iter().zip(sums.par_chunks_exact(TILE_PIXELS)).map(lit).collect();
    let width = frame.size[0] as usize;
    for (tile, lit) in tiles.iter().zip(&lit) {
        let left = tile.column as usize * SIDE;
        let rows = pixels.chunks_exact_mut(width).skip(tile.row as usize * SIDE);
        for (row, lit) in rows.zip(lit.chunks_exact(SIDE)) {
            let row = &mut row[left..width.min(left + SIDE)];
            row.iter_mut().zip(lit).for_each(|(pixel, lit)| *pixel = lit.unwrap_or(*pixel));
        }
    }
}
