//! w in a plane as a picture.

use super::brick_finder::{BrickFinder, nearest, tell_places, trilinear};
use super::legend::{SectionLegend, plain};
use super::plane::Plane;
use crate::error::{Error, Result};
use crate::lattice::{BRICK_CELLS, ROOT_BITS, RootCube, spacing_bits};
use crate::picture::{
    Canvas, Label, LabelPixels, PngRows, Rgba, SIDE_MAX, Scale, WHITE, marks, mean, write_png,
};
use crate::progress::Progress;
use crate::store::BrickTree;
use rayon::prelude::*;
use std::ops::Range;
use std::path::Path;

/// Pixels along the side of a tile, which a thread takes at once: those of a brick where a pixel is a sample.
const TILE: usize = 32;
/// Most samples along each side of a pixel that are averaged where it is larger than a cell.
const SAMPLES_MAX: f64 = 4.0;

/// What to draw.
#[derive(Clone, Debug)]
pub struct SectionPicture {
    /// Where.
    pub plane: Plane,
    /// Least and greatest world coordinates of what is to be seen, by the axes of [`Plane::sides`].
    pub window: [[f64; 2]; 2],
    /// Size of a pixel in world units; `None` for one pixel a sample of the finest level.
    pub pixel: Option<f64>,
    /// Deepest level to use; `None` for all.
    pub level: Option<u8>,
    /// The unit of length for legend and scale bar below the picture; `None` for the samples alone.
    pub legend: Option<String>,
    /// Words to be written into it, the most important first.
    pub labels: Vec<Label>,
}

/// Colours in the place of those of w. It is asked from many threads, and what it says depends on nothing but the place.
pub trait SectionTint: Sync {
    /// The colour at a world position, sRGB, `w` being the winding number that the picture has there; white where there is
    /// none.
    ///
    /// # Errors
    /// What reading gives.
    fn colour(&self, world: [f64; 3], w: f64) -> Result<Option<[u8; 3]>>;
}

/// What a section shows in the place of w.
pub struct Tinted<'a> {
    /// Its colours.
    pub tint: &'a dyn SectionTint,
    /// What they mean, for a picture so many pixels wide, if that is to stand below it.
    pub legend: Option<&'a dyn Fn(usize) -> Canvas>,
}

/// w at places of a plane, row by row from below.
pub struct SectionValues {
    /// How many places there are along the sides.
    pub size: [usize; 2],
    /// w at each.
    pub values: Vec<f64>,
    /// World coordinates of the first, by the axes of [`Plane::sides`].
    pub first: [f64; 2],
    /// World distance of neighbours.
    pub step: f64,
}

/// w as a picture of these pixels has it at their centres.
///
/// # Errors
/// As [`write_picture`].
pub fn section_values(
    tree: &dyn BrickTree,
    what: &SectionPicture,
    progress: &dyn Progress,
) -> Result<SectionValues> {
    let (_, whole, deepest) = survey(tree);
    let grid = Grid::new(tree.root(), what, deepest, whole, Scale::Counted)?;
    let [across, up] = grid.size;
    let row = |y: usize| {
        progress.check()?;
        let mut at_hand = BrickFinder::new(tree, deepest);
        let at = |x: usize| [0, 1].map(|a| grid.first[a] + [x, y][a] as f64 * grid.pixel);
        let value = |x: usize| grid.value(&mut at_hand, grid.plane.point(at(x), grid.at));
        (0..across).map(value).collect::<Result<Vec<f64>>>()
    };
    let rows: Vec<Vec<f64>> = (0..up).into_par_iter().map(row).collect::<Result<_>>()?;
    let first = grid.plane.within(grid.root.to_world(grid.plane.point(grid.first, grid.at).map(|u| u + 1.0)));
    let step = grid.pixel * grid.root.edge / f64::from(1u32 << ROOT_BITS);
    Ok(SectionValues { size: grid.size, values: rows.concat(), first, step })
}

/// What was drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct SectionSummary {
    /// Width and height in pixels, without the legend.
    pub size: [u32; 2],
    /// Size of a pixel in world units.
    pub pixel: f64,
    /// World position of the centre of the lower left pixel.
    pub origin: [f64; 3],
    /// Smallest and largest w of the whole tree, which the colours span.
    pub range: (i16, i16),
}

/// Where the pixels lie: `first` is the centre of the lower left one, in units from the root's first sample.
struct Grid {
    plane: Plane,
    first: [f64; 2],
    at: f64,
    /// In units.
    pixel: f64,
    size: [usize; 2],
    /// Samples along each side of a pixel.
    samples: usize,
    level: u8,
    whole: bool,
    scale: Scale,
    root: RootCube,
}

/// Writes a picture of w in a plane. Of closed input every pixel shows the sample nearest to its centre, of those that
/// lie on its side of the boundary as [`super::contour()`] draws it, in the finest brick there, of open input w
/// between the samples, trilinear.
///
/// Pixels larger than a cell average up to 4 × 4 samples, of a level that is fine enough for them. Works in bands of
/// tiles on all threads; memory is that of a band and of the bricks that the tree keeps. The bytes do not depend on
/// the number of threads.
///
/// # Errors
/// [`Error::Setting`] if the window is empty or the picture too large; [`Error::Interrupted`]; what reading the tree and
/// writing the file give.
pub fn write_picture(
    tree: &dyn BrickTree,
    what: &SectionPicture,
    path: &Path,
    progress: &dyn Progress,
) -> Result<SectionSummary> {
    write_tinted_picture(tree, what, None, path, progress)
}

/// As [`write_picture`], in other colours than those of w if there are any. Pixels are averaged as those of w are.
///
/// # Errors
/// As [`write_picture`]; what the colours give.
pub fn write_tinted_picture(
    tree: &dyn BrickTree,
    what: &SectionPicture,
    tinted: Option<&Tinted<'_>>,
    path: &Path,
    progress: &dyn Progress,
) -> Result<SectionSummary> {
    let (range, whole, deepest) = survey(tree);
    let scale = if whole { Scale::Counted } else { Scale::Even(f64::from(range.1.max(1))) };
    let grid = Grid::new(tree.root(), what, deepest.min(what.level.unwrap_or(deepest)), whole, scale)?;
    let root = tree.root();
    let pixel = grid.pixel * root.edge / f64::from(1u32 << ROOT_BITS);
    let legend = what.legend.as_ref().map(|unit| {
        let title = format!("{} = {} {unit}", what.plane.letter(), plain(what.plane.at));
        let scale = tinted.is_none().then_some(scale);
        SectionLegend { title, scale, range, pixel, unit }.draw(grid.size[0])
    });
    let below = tinted.and_then(|tinted| tinted.legend).map(|legend| legend(grid.size[0]));
    let legends = || legend.iter().chain(&below);
    let marks = marks(&what.labels, grid.size, |uv| {
        let at = grid.plane.within(root.from_first_sample(grid.plane.point(uv, grid.plane.at)));
        let [right, up] = [0, 1].map(|a| (at[a] - grid.first[a]) / grid.pixel);
        [right, grid.size[1] as f64 - 1.0 - up]
    });
    let width = legends().map(Canvas::width).fold(grid.size[0], usize::max);
    let height = grid.size[1] + legends().map(|legend| legend.rows().count()).sum::<usize>();
    let size = [width as u32, height as u32];
    write_png(path, size, true, |rows| {
        let tint = tinted.map(|tinted| tinted.tint);
        grid.draw((tree, tint), width, (rows, &marks), progress)?;
        legends().flat_map(Canvas::rows).try_for_each(|row| {
            let mut row = row.to_vec();
            row.resize(width, WHITE);
            rows.row(&row)
        })
    })?;
    let origin = root.to_world(what.plane.point(grid.first, grid.at).map(|u| u + 1.0));
    Ok(SectionSummary { size: grid.size.map(|side| side as u32), pixel, origin, range })
}

/// Smallest and largest w, whether all samples are whole, and the deepest level. Reads no brick.
fn survey(tree: &dyn BrickTree) -> ((i16, i16), bool, u8) {
    let keys = tree.keys();
    let mut found = ((i16::MAX, i16::MIN), true, keys.last().map_or(0, |key| key.level()));
    for node in keys.into_iter().filter_map(|key| tree.node(key)) {
        found.0 = (found.0.0.min(node.min), found.0.1.max(node.max));
        found.1 &= !node.fractions;
    }
    found
}

impl Grid {
    fn new(root: RootCube, what: &SectionPicture, deepest: u8, whole: bool, scale: Scale) -> Result<Grid> {
        let plane = what.plane;
        let units = |uv: [f64; 2]| root.from_first_sample(plane.point(uv, plane.at));
        let [low, high] = what.window.map(units);
        let at = low[plane.axis.index()];
        let [low, high] = [low, high].map(|point| plane.within(point));
        let cell = f64::from(1u32 << spacing_bits(deepest));
        let pixel = what.pixel.map_or(cell, |pixel| pixel * f64::from(1u32 << ROOT_BITS) / root.edge);
        // Without a size of their own pixels are samples.
        let first = match what.pixel {
            None => low.map(|c| (c / cell).floor() * cell),
            Some(_) => low.map(|c| c + pixel / 2.0),
        };
        let sides = [0, 1].map(|a| ((high[a] - first[a]) / pixel + 0.5).ceil().max(1.0));
        let most = f64::from(SIDE_MAX) - 1000.0;
        if !sides.iter().all(|side| *side <= most) {
            return Err(Error::setting(
                format!("the picture would have {} × {} pixels", sides[0], sides[1]),
                "choose larger pixels with `pixel`, or a number of pixels with `side`",
            ));
        }
        let samples = (pixel / cell - 0.01).ceil().clamp(1.0, SAMPLES_MAX);
        let fine_enough = |level: &u8| f64::from(1u32 << spacing_bits(*level)) <= pixel / samples * 1.01;
        let level = (0..=deepest).find(fine_enough).unwrap_or(deepest);
        let size = sides.map(|side| side as usize);
        Ok(Grid { plane, first, at, pixel, size, samples: samples as usize, level, whole, scale, root })
    }

    fn draw(
        &self,
        (tree, tint): (&dyn BrickTree, Option<&dyn SectionTint>),
        width: usize,
        (rows, marks): (&mut PngRows<'_>, &[LabelPixels]),
        progress: &dyn Progress,
    ) -> Result<()> {
        let bands = self.size[1].div_ceil(TILE);
        progress.phase("drawing", Some(bands as u64), "bands");
        for band in 0..bands {
            progress.check()?;
            tell_places(tree, self.level, self.places(band..band + 2));
            let tiles: Vec<Vec<Rgba>> = (0..self.size[0].div_ceil(TILE))
                .into_par_iter()
                .map_init(
                    || BrickFinder::new(tree, self.level),
                    |at_hand, tile| {
                        at_hand.clear();
                        self.tile((at_hand, tint), [tile * TILE, band * TILE])
                    },
                )
                .collect::<Result<_>>()?;
            for y in 0..TILE.min(self.size[1] - band * TILE) {
                let mut row: Vec<Rgba> =
                    tiles.iter().flat_map(|tile| &tile[y * TILE..(y + 1) * TILE]).copied().collect();
                row.truncate(self.size[0]);
                marks.iter().for_each(|mark| mark.put(band * TILE + y, &mut row));
                row.resize(width, WHITE);
                rows.row(&row)?;
            }
            progress.advance(1);
        }
        Ok(())
    }

    /// Positions in some bands of tiles, several in each brick.
    fn places(&self, bands: Range<usize>) -> impl Iterator<Item = [f64; 3]> {
        let brick = BRICK_CELLS as f64 * f64::from(1u32 << spacing_bits(self.level));
        let step = (brick / self.pixel / 2.0).max(1.0) as usize;
        let rows = (bands.start * TILE..(bands.end * TILE).min(self.size[1] + step)).step_by(step);
        let columns = (0..self.size[0] + step).step_by(step);
        rows.flat_map(move |y| columns.clone().map(move |x| [x, y])).map(move |[x, y]| {
            let steps = [x as f64, self.size[1] as f64 - 1.0 - y as f64];
            self.plane.point(std::array::from_fn(|a| self.first[a] + steps[a] * self.pixel), self.at)
        })
    }

    /// The pixels of a tile whose upper left one is `from`, counted from the picture's upper left one.
    fn tile(
        &self,
        (at_hand, tint): (&mut BrickFinder<'_>, Option<&dyn SectionTint>),
        from: [usize; 2],
    ) -> Result<Vec<Rgba>> {
        let mut pixels = Vec::with_capacity(TILE * TILE);
        let mut parts = Vec::with_capacity(self.samples * self.samples);
        for y in 0..TILE {
            let up = self.size[1] as f64 - 1.0 - (from[1] + y) as f64;
            for x in 0..TILE {
                parts.clear();
                for part in 0..self.samples * self.samples {
                    let offset = |n: usize| (n as f64 + 0.5) / self.samples as f64 - 0.5;
                    let steps = [
                        (from[0] + x) as f64 + offset(part % self.samples),
                        up + offset(part / self.samples),
                    ];
                    let uv = std::array::from_fn(|a| self.first[a] + steps[a] * self.pixel);
                    let at = self.plane.point(uv, self.at);
                    let w = self.value(at_hand, at)?;
                    parts.push(match tint {
                        Some(tint) => self.tinted(tint, at, w)?,
                        None => self.scale.colour(w),
                    });
                }
                pixels.push(mean(&parts));
            }
        }
        Ok(pixels)
    }

    fn tinted(&self, tint: &dyn SectionTint, at: [f64; 3], w: f64) -> Result<Rgba> {
        let colour = tint.colour(self.root.to_world(at.map(|c| c + 1.0)), w)?;
        Ok(colour.map_or(WHITE, |[r, g, b]| [r, g, b, 255]))
    }

    fn value(&self, at_hand: &mut BrickFinder<'_>, at: [f64; 3]) -> Result<f64> {
        Ok(match at_hand.at(at)? {
            None => 0.0,
            Some(held) if self.whole => f64::from(nearest(held, self.plane, self.at, held.local(at))),
            Some(held) => trilinear(&held.brick, held.local(at), |w| w),
        })
    }
}
