//! Pictures by a device: rays go there from brick to brick, and the bricks that they come to are prepared here and brought.
//! Whatever a device does not do, the processor does.

use super::bricks::{Bricks, Lane};
use super::frame::{Frame, TILE as BAND_ROWS};
use super::relief::Band;
use super::sight::{scene_words, sight_of};
use super::{RenderSummary, Scene};
use crate::error::{Error, Result};
use crate::gpu::{Failure, Gpu, RayCaster, RayScene};
use crate::lattice::NodeKey;
use crate::picture::Rgba;
use crate::progress::{Progress, Silent};
use brickfield_shaders::{Sight, TILE};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Pixels along the side of a tile on the device.
const SIDE: usize = TILE as usize;
/// Rows of tiles in a band.
const BAND_TILES: u32 = BAND_ROWS / TILE;
/// Distances beyond this are those of nothing.
const NOTHING: f32 = 1e29;

/// What a device did for pictures.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CasterReport {
    /// Its name.
    pub name: String,
    /// For how many bricks it has room.
    pub pages: u32,
    /// Bricks that were brought there, as often as they were.
    pub brought: u64,
    /// Rounds of rays.
    pub rounds: u64,
    /// Bands of pictures that it drew.
    pub bands: u64,
    /// Bands that the processor drew, because the device failed or had no room.
    pub cpu_bands: u64,
    /// The first thing that went wrong.
    pub failure: Option<String>,
}

/// Draws a scene's pictures on a device. Bricks stay there from one picture to the next.
pub struct Caster<'s> {
    scene: &'s Scene<'s>,
    /// Until it fails.
    device: Option<Device<'s>>,
    /// Bands that are drawn but not handed over.
    ready: VecDeque<Band>,
    /// What bricks took on a device that has failed.
    past: RenderSummary,
    report: CasterReport,
}

/// Why a band is not there.
enum Stop {
    Device(Failure),
    Error(Error),
}

/// Least size of a pixel for a device, in edges of the root cube, or in shares of the distance if that is larger.
const PIXEL_MIN: f32 = 1.0 / 8192.0;

/// Rounds in which rays go on and ask for nothing: each goes on by [`brickfield_shaders::RAY_STEPS_MAX`] steps, and no ray
/// passes more nodes than three times the cells along the root, 2^21.
const IDLE_MAX: u32 = 3 << 11;

type Cast<T> = std::result::Result<T, Stop>;

impl From<Failure> for Stop {
    fn from(failure: Failure) -> Stop {
        Stop::Device(failure)
    }
}

impl From<Error> for Stop {
    fn from(error: Error) -> Stop {
        Stop::Error(error)
    }
}

impl<'s> Caster<'s> {
    /// A caster on a device, with as many rays and bricks as its memory allows. Where it has no room, or fails later, the
    /// processor draws; [`Caster::report`] tells.
    pub fn new(scene: &'s Scene<'s>, gpu: &Gpu) -> Caster<'s> {
        let report = CasterReport { name: gpu.info().name.clone(), ..CasterReport::default() };
        let (ready, past) = (VecDeque::new(), RenderSummary::default());
        let mut caster = Caster { scene, device: None, ready, past, report };
        match Device::new(scene, gpu) {
            Ok(device) => {
                caster.report.pages = device.rays.pages();
                caster.device = Some(device);
            }
            Err(failure) => note(&mut caster.report, failure),
        }
        caster
    }

    /// What the device did so far.
    pub fn report(&self) -> &CasterReport {
        &self.report
    }

    /// What drawing took so far, on the device and here.
    pub fn summary(&self) -> RenderSummary {
        let here = self.scene.summary();
        let there = self.device.as_ref().map_or(self.past, Device::summary);
        RenderSummary { found: here.found + there.found, made: here.made + there.made }
    }

    /// Draws a picture of the scene as [`Frame::draw`] does, up to rounding: single precision moves a colour by a step here
    /// and there, and decides otherwise where a ray grazes an edge. Pixels do not depend on the device's memory. Where they
    /// are smaller than an 8,192nd of the root cube, or of the distance, the processor draws.
    ///
    /// # Errors
    /// As [`Frame::draw`]; failures of the device are none.
    ///
    /// # Panics
    /// If the frame is another scene's.
    pub fn draw(
        &mut self,
        frame: &Frame<'_>,
        progress: &dyn Progress,
        row: impl FnMut(&[Rgba]) -> Result<()>,
    ) -> Result<()> {
        self.draw_until(frame, None, progress, row).map(|_| ())
    }

    /// Draws a picture in what time there is: from `deadline` on, coarser bricks that are there stand for those that are not,
    /// or nothing does. Says whether the picture is complete; if not, the same again comes closer to it, as long as the device
    /// has room for all bricks of it: some are brought by every call. Should the device fail, the processor completes the picture, however long it takes.
    ///
    /// # Errors
    /// What reading the tree and `row` give.
    ///
    /// # Panics
    /// If the frame is another scene's.
    pub fn sketch(
        &mut self,
        frame: &Frame<'_>,
        deadline: Instant,
        row: impl FnMut(&[Rgba]) -> Result<()>,
    ) -> Result<bool> {
        self.draw_until(frame, Some(deadline), &Silent, row)
    }

    fn draw_until(
        &mut self,
        frame: &Frame<'_>,
        deadline: Option<Instant>,
        progress: &dyn Progress,
        row: impl FnMut(&[Rgba]) -> Result<()>,
    ) -> Result<bool> {
        assert!(std::ptr::eq(frame.scene, self.scene), "a frame of another scene");
        self.ready.clear();
        let mut is_complete = true;
        let is_resolved = is_resolved(&sight_of(frame));
        let band = |number: u32| {
            let Some(device) = self.device.as_mut().filter(|_| is_resolved) else {
                self.report.cpu_bands += 1;
                return frame.band(number, progress);
            };
            if self.ready.is_empty() {
                match device.bands(frame, number, deadline, progress, &mut self.report) {
                    Ok((bands, all)) => {
                        self.ready = bands;
                        is_complete &= all;
                    }
                    Err(Stop::Error(error)) => return Err(error),
                    Err(Stop::Device(failure)) => {
                        self.past = device.summary();
                        self.device = None;
                        note(&mut self.report, failure);
                    }
                }
            }
            match self.ready.pop_front() {
                Some(band) => {
                    self.report.bands += 1;
                    Ok(band)
                }
                None => {
                    self.report.cpu_bands += 1;
                    frame.band(number, progress)
                }
            }
        };
        frame.draw_bands(progress, band, row)?;
        Ok(is_complete)
    }
}

/// Whether pixels are so large, beside the numbers by which single precision tells of places, that they do not show it.
/// With pixels of 2^-15, 17 of 1000 were off by more than two steps of 255. Views from closer by are the processor's.
fn is_resolved(sight: &Sight) -> bool {
    sight.pixel >= PIXEL_MIN * sight.distance.max(1.0)
}

fn note(report: &mut CasterReport, failure: Failure) {
    report.failure.get_or_insert_with(|| failure.to_string());
}

/// A device with the scene on it.
struct Device<'s> {
    rays: RayCaster,
    bricks: Bricks<'s>,
    /// By node.
    keys: Vec<NodeKey>,
    /// By thread.
    lanes: Vec<Mutex<Lane>>,
}

impl<'s> Device<'s> {
    fn new(scene: &'s Scene<'s>, gpu: &Gpu) -> std::result::Result<Device<'s>, Failure> {
        let (tree, style) = (scene.bricks.tree, &scene.bricks.style);
        let words = scene_words(&scene.nodes, style);
        let has_cuts = scene.clip.cut_sides().iter().flatten().any(|is_cut| *is_cut);
        let counts = style.counts() || has_cuts && style.caps();
        let haze = style.volume.is_some();
        let (nodes, shells) = (&words.nodes, &words.shells);
        let rays = RayCaster::new(gpu, RayScene { nodes, shells, tables: &words.tables, haze, counts })?;
        let keys = scene.nodes.keys(tree);
        let bytes_max = scene.bricks.bytes_max.saturating_sub(size_of_val(&*keys) as u64);
        Ok(Device {
            rays,
            bricks: Bricks::new(tree, style.clone(), counts, bytes_max),
            keys,
            lanes: (0..rayon::current_num_threads()).map(|_| Mutex::default()).collect(),
        })
    }

    fn summary(&self) -> RenderSummary {
        let (found, made) = self.bricks.found_and_made();
        RenderSummary { found, made }
    }

    /// Some bands of a picture from the one of this number on, as many as there is room for rays, at least one; and whether
    /// they are complete.
    fn bands(
        &mut self,
        frame: &Frame<'_>,
        number: u32,
        deadline: Option<Instant>,
        progress: &dyn Progress,
        report: &mut CasterReport,
    ) -> Cast<(VecDeque<Band>, bool)> {
        let sight = sight_of(frame);
        let [width, height] = frame.scene.size;
        let across = width.div_ceil(TILE);
        let tiles_max = self.rays.tiles_max(sight.rays);
        let count = (tiles_max / (across * BAND_TILES)).clamp(1, height.div_ceil(BAND_ROWS) - number);
        let rows = height.min((number + count) * BAND_ROWS) - number * BAND_ROWS;
        let mut canvas = Canvas::new(width as usize, rows as usize, frame.scene.bricks.tree.root().edge);
        let (first, tiles) = (number * BAND_TILES * across, rows.div_ceil(TILE) * across);
        let mut is_complete = true;
        for from in (0..tiles).step_by(tiles_max as usize) {
            let some = tiles_max.min(tiles - from);
            let sight = Sight { first_tile: first + from, ..sight };
            is_complete &= self.cast(sight, some, deadline, progress, report)?;
            canvas.take(from as usize, self.rays.pixels()?);
        }
        Ok((canvas.bands(), is_complete))
    }

    /// Follows the rays of some tiles, in rounds, to their ends. Every round brings at least one of the bricks that rays wait
    /// for, if there are any, and a ray whose brick is there goes on beyond it: so there is an end. A device that asks for
    /// nothing that can be brought, or for nothing while rays wait, for longer than any ray is, is at fault.
    fn cast(
        &mut self,
        sight: Sight,
        tiles: u32,
        deadline: Option<Instant>,
        progress: &dyn Progress,
        report: &mut CasterReport,
    ) -> Cast<bool> {
        self.rays.begin(sight, tiles);
        let (mut is_draft, mut is_complete) = (false, true);
        let mut idle = 0;
        loop {
            progress.check()?;
            let end = self.rays.round(is_draft)?;
            report.rounds += 1;
            if end.wanted > 0 {
                is_complete &= !is_draft;
                if !is_draft {
                    let brought = self.bring()?;
                    if brought == 0 {
                        return Err(Failure::Lost.into());
                    }
                    report.brought += brought;
                }
            }
            if end.waiting == 0 {
                return Ok(is_complete);
            }
            idle = if end.wanted > 0 { 0 } else { idle + 1 };
            if idle > IDLE_MAX {
                return Err(Failure::Timeout.into());
            }
            is_draft = deadline.is_some_and(|deadline| Instant::now() >= deadline);
        }
    }

    /// Prepares the bricks that rays want, on all threads, and brings them.
    fn bring(&mut self) -> Result<u64> {
        // In the order of the tree, not in that in which rays happened to ask.
        let mut wanted = self.rays.wanted().to_vec();
        wanted.retain(|node| (*node as usize) < self.keys.len());
        wanted.truncate(self.rays.pages() as usize);
        wanted.sort_unstable();
        let (bricks, keys, lanes) = (&self.bricks, &self.keys, &self.lanes);
        let prepared: Vec<_> = wanted
            .par_iter()
            .map(|node| {
                let lane = &lanes[rayon::current_thread_index().unwrap_or(0) % lanes.len()];
                bricks.get(keys[*node as usize], &mut lane.lock().unwrap_or_else(PoisonError::into_inner))
            })
            .collect::<Result<_>>()?;
        let mut count = 0;
        for (node, prepared) in wanted.iter().zip(prepared) {
            count += u64::from(self.rays.bring(*node, |words| prepared.write(words)));
        }
        Ok(count)
    }
}

/// Pixels that come tile by tile.
struct Canvas {
    width: usize,
    rows: usize,
    /// Length of an edge of the root cube.
    edge: f64,
    pixels: Vec<Rgba>,
    depths: Vec<f64>,
}

impl Canvas {
    fn new(width: usize, rows: usize, edge: f64) -> Canvas {
        let count = width * rows;
        Canvas { width, rows, edge, pixels: vec![[0; 4]; count], depths: vec![f64::INFINITY; count] }
    }

    /// Takes tiles from the one of this number on.
    fn take(&mut self, first: usize, tiles: &[[u32; 2]]) {
        let across = self.width.div_ceil(SIDE);
        for (number, tile) in (first..).zip(tiles.chunks_exact(SIDE * SIDE)) {
            let [left, top] = [number % across * SIDE, number / across * SIDE];
            let columns = SIDE.min(self.width - left);
            for (y, row) in (top..self.rows).zip(tile.chunks_exact(SIDE)) {
                let at = y * self.width + left;
                for (n, [colour, depth]) in row[..columns].iter().enumerate() {
                    self.pixels[at + n] = colour.to_le_bytes();
                    let depth = f32::from_bits(*depth);
                    self.depths[at + n] =
                        if depth < NOTHING { f64::from(depth) * self.edge } else { f64::INFINITY };
                }
            }
        }
    }

    fn bands(self) -> VecDeque<Band> {
        let size = self.width * BAND_ROWS as usize;
        let parts = self.pixels.chunks(size).zip(self.depths.chunks(size));
        parts
            .map(|(pixels, depths)| Band {
                width: self.width,
                pixels: pixels.to_vec(),
                depths: depths.to_vec(),
            })
            .collect()
    }
}
