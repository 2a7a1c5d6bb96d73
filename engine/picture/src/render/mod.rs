//! Pictures of a tree in space, by casting rays through its bricks, on the processor or on a device.
//!
//! A ray goes from node to node (the octree's planes cut it into stretches) and leaves out those of which the index
//! says that there is nothing to be seen. So empty space and what lies within cost a few steps.
//!
//! In a brick it goes from cell to cell to where the field that the style asks for passes its level, and the place is
//! refined within the cell. Bricks are read and prepared as rays come to them, and kept under a byte budget.
//!
//! | file | owns |
//! |---|---|
//! | `camera` | the eye, and rays through the picture |
//! | `clip` | cuts and boxes |
//! | `nodes` | the tree as rays see it |
//! | `field` | what a brick says of distances and levels |
//! | `bricks` | bricks prepared, and their cache |
//! | `style` | what is shown: surfaces and haze |
//! | `stops` | functions of w, by a few values |
//! | `light` | colours in light |
//! | `frame`, `tiles` | one picture, and how it is drawn |
//! | `tint` | colours that something else than w decides |
//! | `relief` | depth made visible |
//! | `trace` | a ray through tree and brick |
//! | `caster` | pictures by a device, and bricks for it |
//! | `gpu_scene` | scene and frame as a device sees them |

mod bricks;
mod camera;
mod caster;
mod clip;
mod fetch;
mod field;
mod frame;
mod gpu_scene;
mod light;
mod nodes;
mod relief;
mod stops;
mod style;
mod tiles;
mod tint;
mod trace;

pub use camera::{Focus, Ray, Screen, View};
pub use caster::{Caster, CasterReport};
pub use clip::CutPlane;
pub use frame::Frame;
pub use nodes::NODE_BYTES;
pub use stops::{Stops, W_MAX};
pub use style::{BRIGHTNESS_MAX, BuiltIn, IsoSurface, Lighting, Paint, SURFACES_MAX, Style, VolumeStyle};
pub use tint::{Met, Tint};

use crate::error::{Error, Result};
use crate::lattice::MAX_LEVEL;
use crate::picture::{Animation, Canvas, PngRows, Rgba, WHITE, marks, write_apng, write_png};
use crate::progress::Progress;
use crate::store::BrickTree;
use bricks::Bricks;
use camera::Camera;
use clip::ClipBox;
use light::Light;
use nodes::Nodes;
use std::path::Path;
use std::sync::Arc;

/// Most rays along each side of a pixel.
pub const SUPERSAMPLE_MAX: u32 = 8;

/// Cells of a first, coarse picture, in pixels.
const COARSE_PIXELS: f64 = 4.0;

/// Rounds of fetching bricks from elsewhere, after which the rest comes as rays need it. Seldom do more bricks lie behind
/// each other at a pixel.
const ROUNDS_MAX: usize = 32;

/// What to draw, and how.
#[derive(Clone, Debug)]
pub struct RenderOptions {
    /// What is shown.
    pub style: Style,
    /// From where.
    pub view: View,
    /// So many pictures, seen from all around at the same size, `view` the first.
    pub turn: u32,
    /// What of the world is seen; `None` for all that is left of the part, as large as the picture can show it.
    pub focus: Option<Focus>,
    /// Least and greatest world coordinates of the part.
    pub bounds: [[f64; 3]; 2],
    /// What is cut away.
    pub cuts: Vec<CutPlane>,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Rays along each side of a pixel, 1 to [`SUPERSAMPLE_MAX`].
    pub supersample: u32,
    /// What is seen where nothing is; transparent pixels stay so.
    pub background: Rgba,
    /// Deepest level to use; `None` for all.
    pub level: Option<u8>,
    /// Size in pixels up to which the cells of a coarser level stand for what is below; 0 for leaves alone. Half a pixel
    /// looks like 0; with cells of a whole pixel, grooves between beads that are less than two pixels wide fill up.
    pub cell_pixels: f64,
    /// Bytes for prepared bricks, beside [`NODE_BYTES`] for each node; on a device also for those that are on their way there
    /// and for finished rows of the picture. Less costs time, nothing else.
    pub cache_bytes: u64,
}

impl RenderOptions {
    /// The whole part between two corners, solid on white, from a view: one picture of 1024 × 1024 pixels with four rays each.
    pub fn of(bounds: [[f64; 3]; 2], view: View) -> RenderOptions {
        RenderOptions {
            style: Style::solid(),
            view,
            turn: 1,
            focus: None,
            bounds,
            cuts: Vec::new(),
            size: [1024; 2],
            supersample: 2,
            background: [255; 4],
            level: None,
            cell_pixels: 0.5,
            cache_bytes: 256 << 20,
        }
    }
}

/// What drawing took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RenderSummary {
    /// Prepared bricks that threads asked each other for and found.
    pub found: u64,
    /// Bricks that were read and prepared.
    pub made: u64,
}

/// A tree, eyes, and light.
pub struct Scene<'a> {
    bricks: Arc<Bricks<'a>>,
    nodes: Arc<Nodes>,
    /// Deepest level of `nodes`.
    level: u8,
    eyes: Vec<Eye>,
    clip: ClipBox,
    size: [u32; 2],
    supersample: u32,
    background: Rgba,
    cell_pixels: f64,
    tint: Option<&'a dyn Tint>,
    below: Option<Canvas>,
}

/// From where a picture is seen, and in which light.
struct Eye {
    camera: Camera,
    light: Light,
}

impl<'a> Scene<'a> {
    /// The scene that the options describe. Reads the index of `tree`, which must be complete, and no brick.
    ///
    /// # Errors
    /// [`Error::Setting`] if nothing is left by the cuts, or style, view or a number makes no sense.
    pub fn new(tree: &'a dyn BrickTree, options: &RenderOptions) -> Result<Scene<'a>> {
        let level = options.level.unwrap_or(MAX_LEVEL);
        options.style.check()?;
        let nodes = Nodes::new(tree, level);
        if nodes.is_empty() {
            return Err(Error::setting("the tree has no root", "build it again"));
        }
        let bricks = Bricks::new(tree, options.style.clone(), options.style.counts(), options.cache_bytes);
        Scene::of(Arc::new(bricks), Arc::new(nodes), level, options)
    }

    /// The scene that other options describe, of the same tree and under the same [`RenderOptions::cache_bytes`]. The index
    /// is not read again unless levels differ, and bricks that were prepared stay unless styles differ.
    ///
    /// # Errors
    /// As [`Scene::new`].
    pub fn with(&self, options: &RenderOptions) -> Result<Scene<'a>> {
        let level = options.level.unwrap_or(MAX_LEVEL);
        let tree = self.bricks.tree;
        if level != self.level {
            return Scene::new(tree, options);
        }
        let bricks = if self.bricks.style == options.style {
            Arc::clone(&self.bricks)
        } else {
            options.style.check()?;
            let style = options.style.clone();
            let counts = style.counts();
            Arc::new(Bricks::new(tree, style, counts, self.bricks.bytes_max))
        };
        Scene::of(bricks, Arc::clone(&self.nodes), level, options)
    }

    fn of(
        bricks: Arc<Bricks<'a>>,
        nodes: Arc<Nodes>,
        level: u8,
        options: &RenderOptions,
    ) -> Result<Scene<'a>> {
        let RenderOptions { ref cuts, size, supersample, background, cell_pixels, .. } = *options;
        if !(1..=SUPERSAMPLE_MAX).contains(&supersample) || size.contains(&0) {
            return Err(Error::setting(
                format!("no picture has {} × {} pixels of {supersample} rays a side", size[0], size[1]),
                format!("choose 1 to {SUPERSAMPLE_MAX} rays, and sides above 0"),
            ));
        }
        let seen = ClipBox::new(options.bounds, cuts);
        if seen.is_empty() {
            let [low, high] = options.bounds;
            let ends: Vec<String> =
                (0..3).map(|a| format!("{} {:.3} to {:.3}", ["x", "y", "z"][a], low[a], high[a])).collect();
            let remedy =
                format!("choose planes within {}, and the side of them that is to go", ends.join(", "));
            return Err(Error::setting("the cuts leave nothing of the part", remedy));
        }
        let root = bricks.tree.root();
        let all = [root.origin, root.origin.map(|c| c + root.edge)];
        let views = options.view.around(options.turn);
        let cameras = match options.focus {
            None => Camera::fit(&views, seen.corners(), size)?,
            Some(focus) => {
                views.into_iter().map(|view| Camera::at(view, focus, all, size)).collect::<Result<_>>()?
            }
        };
        let lighting = options.style.lighting;
        let eye = |camera: Camera| Eye { light: Light::new(camera.axes, lighting), camera };
        let eyes = cameras.into_iter().map(eye).collect();
        let clip = ClipBox::new(all, cuts);
        Ok(Scene {
            bricks,
            nodes,
            level,
            eyes,
            clip,
            size,
            supersample,
            background,
            cell_pixels,
            tint: None,
            below: None,
        })
    }

    /// The same with colours that something else than w decides. Only the processor draws them.
    pub fn tinted(self, tint: &'a dyn Tint) -> Scene<'a> {
        Scene { tint: Some(tint), ..self }
    }

    /// The same with a legend below each picture in files.
    pub fn with_legend(self, legend: Canvas) -> Scene<'a> {
        Scene { below: Some(legend), ..self }
    }

    /// Width and height of its pictures in files, with what stands below them.
    pub fn file_size(&self) -> [u32; 2] {
        let [width, height] = self.size;
        let Some(below) = &self.below else { return self.size };
        [width.max(below.width() as u32), height + below.rows().count() as u32]
    }

    /// Its pictures, one for each view.
    pub fn frames(&self) -> impl ExactSizeIterator<Item = Frame<'_>> {
        self.eyes.iter().map(|eye| Frame {
            scene: self,
            eye,
            supersample: self.supersample,
            cell_pixels: self.cell_pixels,
            labels: Vec::new(),
        })
    }

    /// What drawing took so far.
    pub fn summary(&self) -> RenderSummary {
        let (found, made) = self.bricks.found_and_made();
        RenderSummary { found, made }
    }
}

/// Draws a picture, on a device if there is one, into a PNG, which has its name only when it is complete.
///
/// # Errors
/// As [`Frame::draw`], and what writing gives.
pub fn write_frame(
    frame: &Frame<'_>,
    caster: Option<&mut Caster<'_>>,
    path: &Path,
    progress: &dyn Progress,
) -> Result<()> {
    let draw = |rows: &mut PngRows<'_>| draw(frame, caster, progress, rows);
    write_png(path, frame.scene.file_size(), frame.scene.background[3] == 255, draw)
}

fn draw(
    frame: &Frame<'_>,
    caster: Option<&mut Caster<'_>>,
    progress: &dyn Progress,
    rows: &mut PngRows<'_>,
) -> Result<()> {
    let width = frame.scene.file_size()[0] as usize;
    let mut padded = Vec::new();
    let marks = marks(&frame.labels, frame.scene.size.map(|side| side as usize), |at| at);
    let (mut marked, mut number) = (Vec::new(), 0);
    let mut wide = |row: &[Rgba]| {
        marked.clear();
        marked.extend_from_slice(row);
        marks.iter().for_each(|mark| mark.put(number, &mut marked));
        number += 1;
        let row = &marked;
        if row.len() == width {
            return rows.row(row);
        }
        padded.clear();
        padded.extend_from_slice(row);
        padded.resize(width, WHITE);
        rows.row(&padded)
    };
    match caster.filter(|_| frame.scene.tint.is_none()) {
        Some(caster) => caster.draw(frame, progress, &mut wide)?,
        None => frame.draw(progress, &mut wide)?,
    }
    frame.scene.below.iter().flat_map(Canvas::rows).try_for_each(wide)
}

/// Draws all pictures into an animated PNG, which has its name only when it is complete. They are seen one after the other
/// in `seconds`, again and again. Memory is that of one picture.
///
/// # Errors
/// As [`write_frame`], and [`Error::Setting`] if there are too many pictures, or too large ones.
pub fn write_turn(
    scene: &Scene<'_>,
    mut caster: Option<&mut Caster<'_>>,
    path: &Path,
    seconds: f64,
    progress: &dyn Progress,
) -> Result<()> {
    let frames: Vec<Frame<'_>> = scene.frames().collect();
    let what = Animation {
        size: scene.file_size(),
        opaque: scene.background[3] == 255,
        frames: frames.len(),
        seconds,
    };
    write_apng(path, what, |number, rows| draw(&frames[number], caster.as_deref_mut(), progress, rows))
}
