//! Pictures of a tree in space, by casting rays through its bricks on the processor.
//!
//! A ray goes from node to node (the octree's planes cut it into stretches) and leaves out those of which the index says
//! that there is nothing to be seen: so empty space and what lies within cost a few steps. In a brick it goes from cell to
//! cell to where the field that the style asks for passes its level, and the place is refined within the cell. Bricks are
//! read and prepared as rays come to them, and kept under a byte budget.
//!
//! | file | owns |
//! |---|---|
//! | `camera` | the eye, and rays through the picture |
//! | `clip` | cuts and boxes |
//! | `nodes` | the tree as rays see it |
//! | `field` | what a brick says of distances and levels |
//! | `bricks` | bricks prepared, and their cache |
//! | `style` | what is shown, in which colours and light |
//! | `relief` | depth made visible |
//! | `trace` | a ray through tree and brick |

mod bricks;
mod camera;
mod clip;
mod field;
mod nodes;
mod relief;
mod style;
mod trace;

pub use camera::{Ray, View};
pub use clip::Cut;
pub use style::Style;

use crate::error::{Error, Result};
use crate::lattice::MAX_LEVEL;
use crate::picture::{PngRows, Rgba, mean, write_png};
use crate::progress::Progress;
use crate::store::BrickTree;
use bricks::Bricks;
use camera::Camera;
use clip::Clip;
use nodes::Nodes;
use rayon::prelude::*;
use relief::{Band, Between};
use std::path::Path;
use style::Light;
use trace::Tracer;

/// Pixels along the side of a tile, which a thread takes at once.
const TILE: u32 = 32;
/// Winding numbers below this are nothing in the style of boundaries: far from an open input they are never 0.
const LEAST_SEEN: f64 = 0.02;
/// Most rays along each side of a pixel.
pub const SUPERSAMPLE_MAX: u32 = 8;

/// What to draw, and how.
#[derive(Clone, Debug)]
pub struct RenderOptions {
    /// What is shown.
    pub style: Style,
    /// From where.
    pub view: View,
    /// Least and greatest world coordinates of the part, which the picture shows as large as it can, less what is cut away.
    pub bounds: [[f64; 3]; 2],
    /// What is cut away.
    pub cuts: Vec<Cut>,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Rays along each side of a pixel, 1 to [`SUPERSAMPLE_MAX`].
    pub supersample: u32,
    /// What is seen where nothing is; transparent pixels stay so.
    pub background: Rgba,
    /// Deepest level to use; `None` for all.
    pub level: Option<u8>,
    /// Bytes for prepared bricks. Less costs time, nothing else.
    pub cache_bytes: u64,
}

/// What drawing took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RenderSummary {
    /// Prepared bricks that threads asked each other for and found.
    pub found: u64,
    /// Bricks that were read and prepared.
    pub made: u64,
}

/// A tree, an eye, and light.
pub struct Scene<'a> {
    bricks: Bricks<'a>,
    nodes: Nodes,
    camera: Camera,
    clip: Clip,
    light: Light,
    style: Style,
    size: [u32; 2],
    supersample: u32,
    background: Rgba,
}

impl<'a> Scene<'a> {
    /// The scene that the options describe. Reads the index of `tree`, which must be complete, and no brick.
    ///
    /// # Errors
    /// [`Error::Setting`] if nothing is left by the cuts, or the view or a number makes no sense.
    pub fn new(tree: &'a dyn BrickTree, options: &RenderOptions) -> Result<Scene<'a>> {
        let RenderOptions {
            style,
            view,
            bounds,
            ref cuts,
            size,
            supersample,
            background,
            level,
            cache_bytes,
        } = *options;
        if !(1..=SUPERSAMPLE_MAX).contains(&supersample) || size.contains(&0) {
            return Err(Error::setting(
                format!("no picture has {} × {} pixels of {supersample} rays a side", size[0], size[1]),
                format!("choose 1 to {SUPERSAMPLE_MAX} rays, and sides above 0"),
            ));
        }
        let seen = Clip::new(bounds, cuts);
        if seen.is_empty() {
            let remedy = "choose planes within the part, and the side of them that is to go";
            return Err(Error::setting("the cuts leave nothing of the part", remedy));
        }
        let camera = Camera::fit(view, seen.corners(), size)?;
        let root = tree.root();
        let all = [root.origin, root.origin.map(|c| c + root.edge)];
        let nodes = Nodes::new(tree, level.unwrap_or(MAX_LEVEL));
        if nodes.is_empty() {
            return Err(Error::setting("the tree has no root", "build it again"));
        }
        let light = Light::new(camera.axes);
        let bricks = Bricks::new(tree, style, cache_bytes.saturating_sub(nodes.heap_bytes()));
        let clip = Clip::new(all, cuts);
        Ok(Scene { bricks, nodes, camera, clip, light, style, size, supersample, background })
    }

    /// The ray through a point of the picture, in pixels from its upper left corner.
    pub fn ray(&self, at: [f64; 2]) -> Ray {
        self.camera.ray(at)
    }

    /// How far along each of the rays the first opaque thing lies; `None` where there is none.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub fn distances(&self, rays: &[Ray]) -> Result<Vec<Option<f64>>> {
        let parts: Vec<Vec<Option<f64>>> = rays
            .par_chunks((TILE * TILE) as usize)
            .map(|rays| {
                let mut tracer = Tracer::new(self);
                rays.iter().map(|ray| Ok(tracer.follow(ray)?.1)).collect::<Result<_>>()
            })
            .collect::<Result<_>>()?;
        Ok(parts.concat())
    }

    /// Hands over the rows of the picture from the top. The pixels depend neither on the number of threads nor on the
    /// memory for bricks.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; what reading the tree and `row` give.
    pub fn draw(&self, progress: &dyn Progress, mut row: impl FnMut(&[Rgba]) -> Result<()>) -> Result<()> {
        let bands = self.size[1].div_ceil(TILE);
        progress.phase("drawing", Some(bands.into()), "bands");
        // The row of bands around the one that is handed over: above, itself, below.
        let mut around: [Option<Band>; 3] = [None, None, None];
        for number in 0..=bands {
            progress.check()?;
            around.rotate_left(1);
            around[2] = (number < bands).then(|| self.band(number)).transpose()?;
            let [above, band, below] = around.each_ref().map(Option::as_ref);
            let Some(band) = band else { continue };
            let between = Between { above, band, below, unit: relief::unit_of(self.size[1]) };
            for y in 0..band.rows() {
                row(&between.row(y, |distance| self.camera.pixel_at(distance)))?;
            }
            progress.advance(1);
        }
        Ok(())
    }

    /// A row of tiles.
    fn band(&self, number: u32) -> Result<Band> {
        let [width, height] = self.size;
        let rows = TILE.min(height - number * TILE);
        let tiles: Vec<Vec<(Rgba, f64)>> = (0..width.div_ceil(TILE))
            .into_par_iter()
            .map_init(
                || Tracer::new(self),
                |tracer, tile| self.tile(tracer, [tile * TILE, number * TILE], [TILE, rows]),
            )
            .collect::<Result<_>>()?;
        let pixel = |n: usize| {
            let (x, y) = (n % width as usize, n / width as usize);
            tiles[x / TILE as usize][y * TILE as usize + x % TILE as usize]
        };
        let (pixels, depths) = (0..width as usize * rows as usize).map(pixel).unzip();
        Ok(Band { width: width as usize, pixels, depths })
    }

    /// The pixels of a tile, with the depth of the nearest opaque thing in each.
    fn tile(
        &self,
        tracer: &mut Tracer<'_>,
        from: [u32; 2],
        [width, height]: [u32; 2],
    ) -> Result<Vec<(Rgba, f64)>> {
        let rays = self.supersample;
        let mut parts = Vec::with_capacity((rays * rays) as usize);
        let mut pixels = Vec::with_capacity((width * height) as usize);
        for pixel in 0..width * height {
            parts.clear();
            let mut nearest = f64::INFINITY;
            for ray in 0..rays * rays {
                let offset = |n: u32| (f64::from(n) + 0.5) / f64::from(rays);
                let x = f64::from(from[0] + pixel % width) + offset(ray % rays);
                let y = f64::from(from[1] + pixel / width) + offset(ray / rays);
                let (gathered, hit) = tracer.follow(&self.camera.ray([x, y]))?;
                nearest = nearest.min(hit.unwrap_or(f64::INFINITY));
                parts.push(gathered.over(self.background));
            }
            pixels.push((mean(&parts), nearest));
        }
        Ok(pixels)
    }

    /// What drawing took so far.
    pub fn summary(&self) -> RenderSummary {
        let (found, made) = self.bricks.found_and_made();
        RenderSummary { found, made }
    }
}

/// Draws a scene into a PNG, which has its name only when it is complete.
///
/// # Errors
/// As [`Scene::draw`], and what writing gives.
pub fn write_scene(scene: &Scene<'_>, path: &Path, progress: &dyn Progress) -> Result<()> {
    let draw = |rows: &mut PngRows<'_>| scene.draw(progress, |row| rows.row(row));
    write_png(path, scene.size, scene.background[3] == 255, draw)
}
