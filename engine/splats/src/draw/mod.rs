//! Pictures of splats on the processor.
//!
//! Three passes (Botsch 2004; Zwicker 2004): the nearest splat of each pixel, the mean normal of all splats that lie with it, light. A pixel's ray
//! is cut with each splat's plane, so perspective is exact. A splat is what its plane shares with its disc, with its cell and a
//! little beyond, and with what others leave of it. The picture has the same bytes for any number of threads.

mod flat;
mod light;
mod raster;

use crate::error::{Error, Result};
use crate::picture::{Rgba, SIDE_MAX, mean, write_png};
use crate::progress::Progress;
use crate::render::{CutPlane, Focus, SUPERSAMPLE_MAX, View};
use crate::splats::Disc;
use flat::{Flat, FlatFrame};
use std::path::Path;

/// Most rays of a picture: 32 bytes each are in memory.
const RAYS_MAX: u64 = 1 << 28;

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
    /// Splats that were drawn, those that face away left out.
    pub drawn: u64,
}

/// Draws splats.
///
/// # Errors
/// [`Error::Setting`] if nothing can be seen so; [`Error::Interrupted`].
pub fn draw(discs: &[Disc], options: &DrawOptions, progress: &dyn Progress) -> Result<SplatPicture> {
    let factor = options.supersample.clamp(1, SUPERSAMPLE_MAX);
    if options.size.iter().any(|side| !(1..=SIDE_MAX).contains(side)) {
        return Err(Error::setting(
            "a picture of no pixels, or of too many, cannot be drawn",
            "choose another size",
        ));
    }
    let size = options.size.map(|side| side * factor);
    if u64::from(size[0]) * u64::from(size[1]) > RAYS_MAX {
        let what = format!("{} × {} rays are more than splats are drawn with", size[0], size[1]);
        return Err(Error::setting(what, "choose a smaller `size` or `supersample`"));
    }
    let corners = left_of(options);
    let screen = options.view.screen(options.focus, corners, size)?;
    let frame = FlatFrame::new(&screen, size, corners, &options.cuts);
    let flats: Vec<Flat> = discs.iter().filter_map(|disc| frame.flat(disc)).collect();
    let rays = raster::shade(&frame, &flats, options.view.axes(), options.background, progress)?;
    let pixels = if factor == 1 { rays } else { averaged(&rays, size[0] as usize, factor as usize) };
    Ok(SplatPicture { size: options.size, pixels, drawn: flats.len() as u64 })
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
