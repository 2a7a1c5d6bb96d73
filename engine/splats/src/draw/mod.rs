//! Pictures of splats, on the processor or a device.
//!
//! Three passes (Botsch 2004; Zwicker 2004): the nearest splat of each pixel, the mean normal of all splats that lie with it, light. A pixel's ray
//! is cut with each splat's plane, so perspective is exact. A splat is what its plane shares with its disc, with its cell and a
//! little beyond, and with what others leave of it. The picture has the same bytes for any number of threads.
//!
//! | file | owns |
//! |---|---|
//! | `scene` | splats as they wait to be drawn |
//! | `frame` | the picture's rays and axes |
//! | `place` | pixels that splats may touch, sorted by tile |
//! | `raster` | tiles: coverage, the nearest, the mean |
//! | `device` | the same on a device |
//! | `light` | colours |
//! | `fill` | pixels that splats leave empty among them |

mod device;
mod fill;
mod frame;
mod light;
mod place;
mod raster;
mod scene;

use crate::error::{Error, Result};
use crate::picture::{Rgba, SIDE_MAX, mean, write_png};
use crate::progress::Progress;
use crate::render::{CutPlane, Focus, SUPERSAMPLE_MAX, View};
use frame::{DrawFrame, TILE_BITS, TileBits};
use place::PlacedSplats;
use rayon::prelude::*;
use scene::SceneNode;
use std::path::Path;

pub use device::draw_on;
pub use scene::SplatScene;

/// Splats that are placed in one piece, at least, where a level has so many.
const PIECE: usize = 16_384;

/// Most rays of a picture, and of one of its sides.
const RAYS_MAX: u64 = 1 << 28;
const SIDE_RAYS_MAX: u32 = 1 << 16;

/// What to draw, and how.
#[derive(Clone, Debug)]
pub struct DrawOptions {
    /// From where.
    pub view: View,
    /// What of the world is seen; `None` for all that is left of the part.
    pub focus: Option<Focus>,
    /// Least and greatest world coordinates of the part.
    pub bounds: [[f64; 3]; 2],
    /// What is cut away; what is behind is seen from within.
    pub cuts: Vec<CutPlane>,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Rays along each side of a pixel, 1 to [`SUPERSAMPLE_MAX`].
    pub supersample: u32,
    /// What is seen where nothing is.
    pub background: Rgba,
}

/// A picture of splats.
pub struct SplatPicture {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Rows from the top.
    pub pixels: Vec<Rgba>,
    /// Splats that were drawn: those that face away or lie beside the picture are left out, hidden ones are not.
    pub drawn: u64,
}

/// Draws splats on the processor.
///
/// # Errors
/// [`Error::Setting`] if nothing can be seen so; [`Error::Interrupted`].
pub fn draw(scene: &SplatScene, options: &DrawOptions, progress: &dyn Progress) -> Result<SplatPicture> {
    let frame = frame_of(options)?;
    let placed = place(&frame, scene, TILE_BITS, progress)?;
    let rays = raster::shade(&frame, &placed, options.view.axes(), options.background, progress)?;
    Ok(finish(rays, &frame, &placed, options))
}

/// Rays along each side of a pixel.
fn rays_of(options: &DrawOptions) -> u32 {
    options.supersample.clamp(1, SUPERSAMPLE_MAX)
}

fn frame_of(options: &DrawOptions) -> Result<DrawFrame> {
    if options.size.iter().any(|side| !(1..=SIDE_MAX).contains(side)) {
        return Err(Error::setting(
            "a picture of no pixels, or of too many, cannot be drawn",
            "choose another size",
        ));
    }
    let size = options.size.map(|side| side * rays_of(options));
    let is_long = size.iter().any(|side| *side > SIDE_RAYS_MAX);
    if is_long || u64::from(size[0]) * u64::from(size[1]) > RAYS_MAX {
        let what = format!("{} × {} rays are more than splats are drawn with", size[0], size[1]);
        return Err(Error::setting(what, "choose a smaller `size` or `supersample`"));
    }
    let corners = left_of(options);
    let screen = options.view.screen(options.focus, corners, size)?;
    Ok(DrawFrame::new(&screen, size, corners, &options.cuts))
}

/// Places splats, for tiles of a size.
fn place(
    frame: &DrawFrame,
    scene: &SplatScene,
    bits: TileBits,
    progress: &dyn Progress,
) -> Result<Vec<PlacedSplats>> {
    let pieces = pieces(&scene.nodes);
    progress.phase("placing splats", Some(pieces.len() as u64), "pieces");
    let place = |nodes: &&[SceneNode]| {
        progress.check()?;
        let placed = PlacedSplats::new(frame, nodes, bits);
        progress.advance(1);
        Ok(placed)
    };
    pieces.par_iter().map(place).collect()
}

/// A picture of rays' colours.
fn finish(
    mut rays: Vec<Rgba>,
    frame: &DrawFrame,
    placed: &[PlacedSplats],
    options: &DrawOptions,
) -> SplatPicture {
    let width = frame.size[0] as usize;
    fill::fill_holes(&mut rays, width, options.background);
    let factor = rays_of(options) as usize;
    let pixels = if factor == 1 { rays } else { averaged(&rays, width, factor) };
    let drawn = placed.iter().map(|placed| placed.splats.len() as u64).sum();
    SplatPicture { size: options.size, pixels, drawn }
}

/// Nodes that follow each other and have cells of one size, in pieces that do not depend on threads.
fn pieces(nodes: &[SceneNode]) -> Vec<&[SceneNode]> {
    let mut pieces = Vec::new();
    for level in nodes.chunk_by(|a, b| a.cell == b.cell) {
        let (mut from, mut splats) = (0, 0);
        for (n, node) in level.iter().enumerate() {
            splats += node.len;
            if splats >= PIECE || n + 1 == level.len() {
                pieces.push(&level[from..=n]);
                (from, splats) = (n + 1, 0);
            }
        }
    }
    pieces
}

/// Writes a picture as PNG; it has its name only when it is complete.
///
/// # Errors
/// What writing gives.
pub fn write_picture(picture: &SplatPicture, opaque: bool, path: &Path) -> Result<()> {
    let mut rows = picture.pixels.chunks_exact(picture.size[0] as usize);
    write_png(path, picture.size, opaque, |png| rows.try_for_each(|row| png.row(row)))
}

/// The box of what no cut takes away.
fn left_of(options: &DrawOptions) -> [[f64; 3]; 2] {
    let mut corners = options.bounds;
    for cut in &options.cuts {
        let axis = cut.axis.index();
        let bound = &mut corners[usize::from(cut.above)][axis];
        *bound = if cut.above { bound.min(cut.at) } else { bound.max(cut.at) };
    }
    corners
}

fn averaged(rays: &[Rgba], width: usize, factor: usize) -> Vec<Rgba> {
    let columns = width / factor;
    let mut some = Vec::with_capacity(factor * factor);
    let mut pixels = Vec::with_capacity(rays.len() / factor / factor);
    for rows in rays.chunks_exact(width * factor) {
        for column in 0..columns {
            some.clear();
            for row in 0..factor {
                some.extend_from_slice(&rows[row * width + column * factor..][..factor]);
            }
            pixels.push(mean(&some));
        }
    }
    pixels
}

#[cfg(test)]
mod tests;
