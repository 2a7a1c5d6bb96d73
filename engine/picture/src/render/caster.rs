//! Pictures by a device: rays go there from brick to brick, and the bricks that they come to are prepared here and brought.
//! Whatever a device does not do, the processor does.

use super::bricks::{Bricks, RayBrick, ThreadBricks};
use super::frame::{Frame, TILE as BAND_ROWS};
use super::gpu_scene::{scene_words, sight_of};
use super::nodes::Nodes;
use super::relief::Band;
use super::{RenderSummary, Scene};
use crate::error::{Error, Result};
use crate::gpu::{DeviceFailure, Gpu, RayCaster, RayKernels, RayScene};
use crate::lattice::NodeKey;
use crate::picture::Rgba;
use crate::progress::Progress;
use crate::store::BrickTree;
use brickfield_shaders::{Sight, TILE};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
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

/// Draws pictures of a tree on a device. Bricks stay there from one picture to the next, as long as their style is the same.
pub struct Caster<'a> {
    tree: &'a dyn BrickTree,
    gpu: Gpu,
    kernels: Option<RayKernels>,
    /// With the last scene, until it fails.
    device: Option<Device<'a>>,
    /// Bands that are drawn but not handed over.
    ready: VecDeque<Band>,
    /// What bricks took on the device for scenes that it has no more.
    past: RenderSummary,
    report: CasterReport,
}

/// Why a band is not there.
enum Stop {
    Device(DeviceFailure),
    Error(Error),
}

/// Least size of a pixel for a device, in edges of the root cube, or in shares of the distance if that is larger.
const PIXEL_MIN: f32 = 1.0 / 8192.0;

/// Rounds in which rays go on and ask for nothing: each goes on by [`brickfield_shaders::RAY_STEPS_MAX`] steps, and no ray
/// passes more nodes than three times the cells along the root, 2^21.
const IDLE_MAX: u32 = 3 << 11;

type Cast<T> = std::result::Result<T, Stop>;

impl From<DeviceFailure> for Stop {
    fn from(failure: DeviceFailure) -> Stop {
        Stop::Device(failure)
    }
}

impl From<Error> for Stop {
    fn from(error: Error) -> Stop {
        Stop::Error(error)
    }
}

impl<'a> Caster<'a> {
    /// A caster on a device, with as many rays and bricks as its memory allows. Where it has no room, or fails later, the
    /// processor draws; [`Caster::report`] tells.
    pub fn new(scene: &Scene<'a>, gpu: &Gpu) -> Caster<'a> {
        let report = CasterReport { name: gpu.info().name.clone(), ..CasterReport::default() };
        let (ready, past) = (VecDeque::new(), RenderSummary::default());
        let (tree, gpu) = (scene.bricks.tree, gpu.clone());
        let mut caster = Caster { tree, gpu, kernels: None, device: None, ready, past, report };
        caster.prepare(scene);
        caster
    }

    /// Puts a scene on the device, unless what it needs is there.
    fn prepare(&mut self, scene: &Scene<'_>) {
        if self.has_failed() || self.device.as_ref().is_some_and(|device| device.suits(scene)) {
            return;
        }
        // It takes the place of the one before.
        self.leave();
        match self.device_with(scene) {
            Ok(device) => {
                self.report.pages = device.rays.pages();
                self.device = Some(device);
            }
            Err(failure) => self.fail(failure),
        }
    }

    fn device_with(&mut self, scene: &Scene<'_>) -> std::result::Result<Device<'a>, DeviceFailure> {
        let kernels = match self.kernels.take() {
            Some(kernels) => kernels,
            None => RayKernels::new(&self.gpu)?,
        };
        Device::new(self.tree, scene, &self.gpu, self.kernels.insert(kernels))
    }

    /// Gives up what is on the device.
    fn leave(&mut self) {
        self.past = self.summary();
        self.device = None;
    }

    fn fail(&mut self, failure: DeviceFailure) {
        self.leave();
        self.report.failure.get_or_insert_with(|| failure.to_string());
    }

    /// Whether the device has failed, so that the processor draws.
    pub fn has_failed(&self) -> bool {
        self.report.failure.is_some()
    }

    /// Whether the device can draw this picture, if it does not fail: pixels are at least an 8,192nd of the root cube, and of
    /// the distance.
    pub fn resolves(frame: &Frame<'_>) -> bool {
        is_resolved(&sight_of(frame))
    }

    /// What the device did so far.
    pub fn report(&self) -> &CasterReport {
        &self.report
    }

    /// What drawing on the device took so far, beside [`Scene::summary`].
    pub fn summary(&self) -> RenderSummary {
        let now = self.device.as_ref().map_or_else(RenderSummary::default, Device::summary);
        RenderSummary { found: self.past.found + now.found, made: self.past.made + now.made }
    }

    /// Draws a picture as [`Frame::draw`] does, up to rounding: single precision moves a colour by a step here and
    /// there, and decides otherwise where a ray grazes an edge. Pixels do not depend on the device's memory.
    ///
    /// Where they are smaller than [`Caster::resolves`] says, the processor draws. What the device has of the last
    /// picture's scene stays if this one's is made from it ([`Scene::with`]) in the same style; but bricks are brought
    /// anew as cuts begin to show what lies within.
    ///
    /// # Errors
    /// As [`Frame::draw`]; failures of the device are none.
    ///
    /// # Panics
    /// If the frame shows another tree.
    pub fn draw(
        &mut self,
        frame: &Frame<'_>,
        progress: &dyn Progress,
        row: impl FnMut(&[Rgba]) -> Result<()>,
    ) -> Result<()> {
        self.draw_until(frame, None, progress, row).map(|_| ())
    }

    /// Draws a picture in what time there is: from `deadline` on, coarser bricks that are there stand for those that
    /// are not, or nothing does. Says whether the picture is complete; if not, the same again comes closer to it, as
    /// long as the device has room for all bricks of it: some are brought by every call.
    ///
    /// Should the device fail, the processor completes the picture, however long it takes.
    ///
    /// # Errors
    /// As [`Frame::draw`].
    ///
    /// # Panics
    /// If the frame shows another tree.
    pub fn sketch(
        &mut self,
        frame: &Frame<'_>,
        deadline: Instant,
        progress: &dyn Progress,
        row: impl FnMut(&[Rgba]) -> Result<()>,
    ) -> Result<bool> {
        self.draw_until(frame, Some(deadline), progress, row)
    }

    fn draw_until(
        &mut self,
        frame: &Frame<'_>,
        deadline: Option<Instant>,
        progress: &dyn Progress,
        row: impl FnMut(&[Rgba]) -> Result<()>,
    ) -> Result<bool> {
        assert!(std::ptr::addr_eq(frame.scene.bricks.tree, self.tree), "a frame of another tree");
        self.ready.clear();
        let mut is_complete = true;
        let order = PictureJob { frame, sight: sight_of(frame), deadline, progress };
        let is_resolved = is_resolved(&order.sight);
        if is_resolved {
            self.prepare(frame.scene);
        }
        // What is kept of bricks here and for the device is within bounds each by itself.
        match &self.device {
            Some(_) if is_resolved => frame.scene.bricks.clear(),
            Some(device) => device.bricks.clear(),
            None => {}
        }
        let band = |number: u32| {
            let Some(device) = self.device.as_mut().filter(|_| is_resolved) else {
                self.report.cpu_bands += 1;
                return frame.band(number, progress);
            };
            if self.ready.is_empty() {
                match device.bands(&order, number, &mut self.report) {
                    Ok((bands, all)) => {
                        self.ready = bands;
                        is_complete &= all;
                    }
                    Err(Stop::Error(error)) => return Err(error),
                    Err(Stop::Device(failure)) => self.fail(failure),
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

/// A picture that is to be drawn.
struct PictureJob<'f> {
    frame: &'f Frame<'f>,
    /// What the device is told of it.
    sight: Sight,
    /// When coarser bricks will do.
    deadline: Option<Instant>,
    progress: &'f dyn Progress,
}

/// A device with a scene on it.
struct Device<'a> {
    rays: RayCaster,
    nodes: Arc<Nodes>,
    bricks: Bricks<'a>,
    /// By node.
    keys: Vec<NodeKey>,
    /// By thread.
    lanes: Vec<Mutex<ThreadBricks>>,
}

/// Whether bricks must know w itself.
fn counts(scene: &Scene<'_>) -> bool {
    let style = &scene.bricks.style;
    let has_cuts = scene.clip.cut_sides().iter().flatten().any(|is_cut| *is_cut);
    style.counts() || has_cuts && style.caps()
}

impl<'a> Device<'a> {
    /// A scene of `tree` on the device.
    fn new(
        tree: &'a dyn BrickTree,
        scene: &Scene<'_>,
        gpu: &Gpu,
        kernels: &RayKernels,
    ) -> std::result::Result<Device<'a>, DeviceFailure> {
        let style = &scene.bricks.style;
        let words = scene_words(&scene.nodes, style);
        let counts = counts(scene);
        let haze = style.volume.is_some();
        let (nodes, shells) = (&words.nodes, &words.shells);
        let shown = RayScene { nodes, shells, tables: &words.tables, haze, counts };
        let rays = RayCaster::new(gpu, kernels, shown)?;
        let keys = scene.nodes.keys(tree);
        // Beside what is kept: the bricks that are brought together, and the bands of as many pixels as there are rays.
        let brought = rays.staged_max() as usize * RayBrick::heap_bytes_max(style, counts);
        let bands = rays.tiles_max(1) as usize * SIDE * SIDE * PIXEL_BYTES;
        let beside = (size_of_val(&*keys) + brought + bands) as u64;
        let bytes_max = scene.bricks.bytes_max.saturating_sub(beside);
        Ok(Device {
            rays,
            nodes: Arc::clone(&scene.nodes),
            bricks: Bricks::new(tree, style.clone(), counts, bytes_max),
            keys,
            lanes: (0..rayon::current_num_threads()).map(|_| Mutex::default()).collect(),
        })
    }

    /// Whether a scene's pictures can be drawn with what is there.
    fn suits(&self, scene: &Scene<'_>) -> bool {
        Arc::ptr_eq(&self.nodes, &scene.nodes)
            && self.bricks.style == scene.bricks.style
            && self.bricks.counts >= counts(scene)
    }

    fn summary(&self) -> RenderSummary {
        let (found, made) = self.bricks.found_and_made();
        RenderSummary { found, made }
    }

    /// Some bands of a picture from the one of this number on, as many as there is room for rays, at least one; and whether
    /// they are complete.
    fn bands(
        &mut self,
        order: &PictureJob<'_>,
        number: u32,
        report: &mut CasterReport,
    ) -> Cast<(VecDeque<Band>, bool)> {
        let PictureJob { frame, sight, .. } = *order;
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
            is_complete &= self.cast(order, sight, some, report)?;
            canvas.take(from as usize, self.rays.pixels()?);
        }
        Ok((canvas.bands, is_complete))
    }

    /// Follows the rays of some tiles, in rounds, to their ends. Every round brings at least one of the bricks that
    /// rays wait for, if there are any, and a ray whose brick is there goes on beyond it: so there is an end.
    ///
    /// A device that asks for nothing that can be brought, or for nothing while rays wait, for longer than any ray is,
    /// is at fault.
    fn cast(
        &mut self,
        order: &PictureJob<'_>,
        sight: Sight,
        tiles: u32,
        report: &mut CasterReport,
    ) -> Cast<bool> {
        self.rays.begin(sight, tiles);
        let (mut is_draft, mut is_complete) = (false, true);
        let mut idle = 0;
        loop {
            order.progress.check()?;
            let end = self.rays.round(is_draft)?;
            report.rounds += 1;
            if end.wanted > 0 {
                is_complete &= !is_draft;
                if !is_draft {
                    let brought = self.bring()?;
                    if brought == 0 {
                        return Err(DeviceFailure::Lost.into());
                    }
                    report.brought += brought;
                }
            }
            if end.waiting == 0 {
                return Ok(is_complete);
            }
            idle = if end.wanted > 0 { 0 } else { idle + 1 };
            if idle > IDLE_MAX {
                return Err(DeviceFailure::Timeout.into());
            }
            is_draft = order.deadline.is_some_and(|deadline| Instant::now() >= deadline);
        }
    }

    /// Prepares the bricks that rays want, on all threads, and brings them.
    fn bring(&mut self) -> Result<u64> {
        // In the order of the tree, not in that in which rays happened to ask.
        let mut wanted = self.rays.wanted().to_vec();
        wanted.sort_unstable();
        wanted.dedup();
        wanted.retain(|node| (*node as usize) < self.keys.len() && !self.rays.has(*node));
        wanted.truncate(self.rays.pages() as usize);
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
    /// Length of an edge of the root cube.
    edge: f64,
    bands: VecDeque<Band>,
}

/// Bytes of a pixel of a canvas.
const PIXEL_BYTES: usize = size_of::<Rgba>() + size_of::<f64>();

impl Canvas {
    fn new(width: usize, rows: usize, edge: f64) -> Canvas {
        let band = |from: usize| {
            let count = width * (rows - from).min(BAND_ROWS as usize);
            Band { width, pixels: vec![[0; 4]; count], depths: vec![f64::INFINITY; count] }
        };
        Canvas { width, edge, bands: (0..rows).step_by(BAND_ROWS as usize).map(band).collect() }
    }

    /// Takes tiles from the one of this number on.
    fn take(&mut self, first: usize, tiles: &[[u32; 2]]) {
        let across = self.width.div_ceil(SIDE);
        for (number, tile) in (first..).zip(tiles.chunks_exact(SIDE * SIDE)) {
            let [left, row_of_tiles] = [number % across * SIDE, number / across];
            let columns = SIDE.min(self.width - left);
            let band = &mut self.bands[row_of_tiles / BAND_TILES as usize];
            let top = row_of_tiles % BAND_TILES as usize * SIDE;
            for (y, row) in (top..band.rows()).zip(tile.chunks_exact(SIDE)) {
                let at = y * self.width + left;
                for (n, [colour, depth]) in row[..columns].iter().enumerate() {
                    band.pixels[at + n] = colour.to_le_bytes();
                    let depth = f32::from_bits(*depth);
                    band.depths[at + n] =
                        if depth < NOTHING { f64::from(depth) * self.edge } else { f64::INFINITY };
                }
            }
        }
    }
}
