//! Pixels while they are drawn.

use super::edges::SplatEdges;
use super::holes::each_hole;
use super::light::Lamps;
use super::packed::PackedSplat;
use super::place::SeenSplat;
use super::view::{DrawView, LevelView, REACH, TOGETHER};

/// Levels that a splat may have.
const LEVELS: usize = 32;
const BACKGROUND: [u8; 4] = [255; 4];

/// A picture and what it is made of, which one picture leaves to the next.
#[derive(Default)]
pub struct PageCanvas {
    /// How far the nearest splat of a pixel is.
    depth: Vec<f32>,
    /// Normals by weight, and levels by weight.
    sums: Vec<[f32; 4]>,
    /// Whether a splat was among the nearest of any pixel when it came; of a finished picture, whether it shows the splat.
    is_near: Vec<bool>,
    pixels: Vec<[u8; 4]>,
}

impl PageCanvas {
    /// The pixels of the last picture: red, green, blue, 255; rows from the top.
    pub fn pixels(&self) -> &[[u8; 4]] {
        &self.pixels
    }

    /// Which splats the last picture shows.
    pub fn seen(&self) -> &[bool] {
        &self.is_near
    }

    /// Draws splats.
    // Large, and called from two places.
    #[inline(never)]
    pub fn draw(&mut self, splats: &[PackedSplat], view: &DrawView) {
        let len = view.size[0] * view.size[1];
        self.depth.clear();
        self.depth.resize(len, f32::INFINITY);
        self.sums.clear();
        self.sums.resize(len, [0.0; 4]);
        self.is_near.clear();
        self.is_near.resize(splats.len(), false);
        let mut levels = Vec::with_capacity(LEVELS);
        (0..LEVELS).for_each(|level| levels.push(LevelView::new(view, level as u32)));
        if view.distance == 0.0 {
            self.nearest::<true>(splats, &levels);
            self.blend::<true>(splats, &levels);
        } else {
            self.nearest::<false>(splats, &levels);
            self.blend::<false>(splats, &levels);
        }
        self.light(view);
    }

    /// How far the nearest splats are.
    fn nearest<const PARALLEL: bool>(&mut self, splats: &[PackedSplat], levels: &[LevelView]) {
        let PageCanvas { depth, is_near, .. } = self;
        for (splat, is_near) in splats.iter().zip(is_near) {
            let level = &levels[level_of(splat)];
            if let Some(placed) = SeenSplat::new::<PARALLEL>(level, splat) {
                let together = TOGETHER * REACH * level.cell;
                each_pixel::<PARALLEL>(level.size[0] as usize, &placed, |at, along, _| {
                    *is_near |= along <= depth[at] + together;
                    depth[at] = depth[at].min(along);
                });
            }
        }
    }

    /// Adds up what lies with them.
    fn blend<const PARALLEL: bool>(&mut self, splats: &[PackedSplat], levels: &[LevelView]) {
        let PageCanvas { depth, is_near, sums, .. } = self;
        for (splat, is_near) in splats.iter().zip(is_near).filter(|(_, is_near)| **is_near) {
            *is_near = false;
            let number = level_of(splat);
            let level = &levels[number];
            if let Some(placed) = SeenSplat::new::<PARALLEL>(level, splat) {
                let together = TOGETHER * REACH * level.cell;
                each_pixel::<PARALLEL>(level.size[0] as usize, &placed, |at, along, weight| {
                    if along <= depth[at] + together {
                        *is_near = true;
                        let [x, y, z] = placed.normal.map(|c| c * weight);
                        let sum = &mut sums[at];
                        *sum = [sum[0] + x, sum[1] + y, sum[2] + z, sum[3] + number as f32 * weight];
                    }
                });
            }
        }
    }

    fn light(&mut self, view: &DrawView) {
        let [width, height] = view.size;
        let lamps = Lamps::new(view);
        let axes = view.axes.map(|axis| axis.map(|c| c as f32));
        self.pixels.clear();
        self.pixels.resize(width * height, BACKGROUND);
        for row in 0..height {
            let y = (height as f64 / 2.0 - row as f64 - 0.5) * view.pixel;
            for column in 0..width {
                let at = row * width + column;
                if self.depth[at] == f32::INFINITY {
                    continue;
                }
                let x = (column as f64 + 0.5 - width as f64 / 2.0) * view.pixel;
                let mut along = axes[2].map(|c| -c);
                if view.distance != 0.0 {
                    (0..3).for_each(|a| {
                        along[a] =
                            axes[0][a] * x as f32 + axes[1][a] * y as f32 - axes[2][a] * view.distance as f32
                    });
                }
                let [nx, ny, nz, levels] = self.sums[at];
                self.pixels[at] = lamps.pixel([nx, ny, nz], levels, along);
            }
        }
        self.fill_holes(view.size);
    }

    /// Gives holes the mean colour of what is around them.
    fn fill_holes(&mut self, size: [usize; 2]) {
        let PageCanvas { depth, pixels, .. } = self;
        let mut filled = Vec::new();
        each_hole(
            size,
            |at| depth[at] == f32::INFINITY,
            |at, covered| {
                let count = covered.len();
                let mut colour = [255; 4];
                for (c, mean) in colour.iter_mut().enumerate() {
                    let sum: usize = covered.iter().map(|&at| usize::from(pixels[at][c])).sum();
                    *mean = ((sum + count / 2) / count) as u8;
                }
                filled.push((at, colour));
            },
        );
        filled.into_iter().for_each(|(at, colour)| pixels[at] = colour);
    }
}

#[inline(always)]
fn level_of(splat: &PackedSplat) -> usize {
    (splat[1] >> 16 & 31) as usize
}

/// Calls for each pixel that a splat covers: which one, how far the splat is there, how much it counts.
#[inline(always)]
fn each_pixel<const PARALLEL: bool>(width: usize, splat: &SeenSplat, mut each: impl FnMut(usize, f32, f32)) {
    let [columns, rows] = [0, 1].map(|axis| splat.end[axis] - splat.first[axis]);
    let first = splat.first[1] * width + splat.first[0];
    let edges = if splat.is_large() { SplatEdges::new::<PARALLEL>(splat) } else { None };
    for row in 0..rows {
        let at = first + row * width;
        if let Some(edges) = &edges {
            let (from, end) = edges.columns(row);
            for column in from..end {
                let (along, weight) = splat.within::<PARALLEL>(column, row);
                each(at + column, along, weight);
            }
        } else {
            for column in 0..columns {
                if let Some((along, weight)) = splat.at::<PARALLEL>(column, row) {
                    each(at + column, along, weight);
                }
            }
        }
    }
}
