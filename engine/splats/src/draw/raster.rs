//! Splats to pixels, tile by tile: the parts of splats that lie before or with the nearest, then their mean.

use super::frame::{DrawFrame, TILE_COLUMNS, TILE_ROWS};
use super::light::{SplatLight, dot};
use super::place::{PlacedSplat, PlacedSplats};
use crate::error::Result;
use crate::picture::Rgba;
use crate::progress::Progress;
use crate::wide::{Simd, SimdBase, SimdMask, dispatch, f32x8, level};
use rayon::prelude::*;

const TILE: usize = TILE_COLUMNS * TILE_ROWS;
/// Pixels that are tested together: two rows of four, which a small splat seldom leaves.
const BLOCK_COLUMNS: usize = 4;
const BLOCK_ROWS: usize = 2;
/// Room for parts at first.
const PARTS: usize = 8192;
const LANE_COLUMNS: [f32; 8] = [0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0];
const LANE_ROWS: [f32; 8] = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];

/// The colours of all pixels.
pub(super) fn shade(
    frame: &DrawFrame,
    placed: &[PlacedSplats],
    axes: [[f64; 3]; 3],
    background: Rgba,
    progress: &dyn Progress,
) -> Result<Vec<Rgba>> {
    let [width, height] = frame.size.map(|side| side as usize);
    progress.phase("drawing splats", Some(height.div_ceil(TILE_ROWS) as u64), "bands");
    let light = SplatLight::new(axes);
    let mut pixels = vec![background; width * height];
    pixels.par_chunks_mut(width * TILE_ROWS).enumerate().try_for_each(|(row, pixels)| {
        progress.check()?;
        let mut tile = DrawTile::new(frame);
        for column in 0..width.div_ceil(TILE_COLUMNS) {
            tile.begin([column, row]);
            for placed in placed {
                let numbers = placed.in_tile([column as u32, row as u32]);
                if !numbers.is_empty() {
                    dispatch!(level(), simd => tile.collect(simd, placed, numbers));
                }
            }
            if tile.used > 0 {
                tile.blend();
                tile.light(&light, pixels);
            }
        }
        progress.advance(1);
        Ok(())
    })?;
    Ok(pixels)
}

/// What a splat has in a pixel.
#[derive(Clone, Copy, Default)]
struct CoveredPixel {
    pixel: u32,
    /// How far along the ray.
    along: f32,
    /// Its normal by weight.
    normal: [f32; 3],
}

/// Pixels while they are drawn.
struct DrawTile<'a> {
    frame: &'a DrawFrame,
    /// The first column and row.
    first: [usize; 2],
    /// How far along the ray the nearest splat is.
    depth: Vec<f32>,
    /// Sum of normals by weight.
    normals: Vec<[f32; 3]>,
    /// In the order of splats; behind those in use is room.
    parts: Vec<CoveredPixel>,
    used: usize,
    /// Ends of parts, and how far behind the nearest they count.
    groups: Vec<(usize, f32)>,
}

/// A number that is linear in columns and rows: at a pixel, and its steps.
type Linear = [f32; 3];

impl DrawTile<'_> {
    fn new(frame: &DrawFrame) -> DrawTile<'_> {
        let (depth, normals) = (vec![0.0; TILE], vec![[0.0; 3]; TILE]);
        DrawTile { frame, first: [0; 2], depth, normals, parts: Vec::new(), used: 0, groups: Vec::new() }
    }

    fn begin(&mut self, tile: [usize; 2]) {
        self.first = [tile[0] * TILE_COLUMNS, tile[1] * TILE_ROWS];
        self.depth.fill(f32::INFINITY);
        self.normals.fill([0.0; 3]);
        self.used = 0;
        self.groups.clear();
    }

    /// Takes in splats, and with them the depth of pixels.
    #[inline(always)]
    fn collect<S: Simd>(&mut self, simd: S, placed: &PlacedSplats, numbers: &[u32]) {
        for &number in numbers {
            let splat = &placed.splats[number as usize];
            let last = [self.first[0] + TILE_COLUMNS - 1, self.first[1] + TILE_ROWS - 1];
            let (columns, rows) = (splat.columns.map(usize::from), splat.rows.map(usize::from));
            let columns = [columns[0].max(self.first[0]), columns[1].min(last[0])];
            let rows = [rows[0].max(self.first[1]), rows[1].min(last[1])];
            if self.frame.parallel {
                let plane = ParallelPlane::new(self.frame, splat, columns[0], rows[0]);
                self.fill(simd, placed, splat, (columns, rows), plane);
            } else {
                let plane = PerspectivePlane::new(self.frame, splat, columns[0], rows[0]);
                self.fill(simd, placed, splat, (columns, rows), plane);
            }
        }
        self.groups.push((self.used, placed.together));
    }

    #[inline(always)]
    fn fill<S: Simd>(
        &mut self,
        simd: S,
        placed: &PlacedSplats,
        splat: &PlacedSplat,
        (columns, rows): ([usize; 2], [usize; 2]),
        plane: impl PlaneOfSplat,
    ) {
        let mut row = rows[0];
        while row <= rows[1] {
            let mut column = columns[0];
            while column <= columns[1] {
                let left = columns[1] + 1 - column;
                let in_row = if left < BLOCK_COLUMNS { (1 << left) - 1 } else { 0xf };
                let wanted = if row == rows[1] { in_row } else { in_row | in_row << BLOCK_COLUMNS };
                let x =
                    f32x8::from_slice(simd, &LANE_COLUMNS) + f32x8::splat(simd, (column - columns[0]) as f32);
                let y = f32x8::from_slice(simd, &LANE_ROWS) + f32x8::splat(simd, (row - rows[0]) as f32);
                let (t, q) = plane.meet(simd, self.frame, x, y);
                let (bits, weight) = covers(simd, self.frame, placed, splat, t, q);
                let bits = bits & wanted;
                if bits != 0 {
                    let at = (row - self.first[1]) * TILE_COLUMNS + column - self.first[0];
                    self.take(bits, at, (t.to_array(), weight.to_array()), splat.normal, placed.together);
                }
                column += BLOCK_COLUMNS;
            }
            row += BLOCK_ROWS;
        }
    }

    #[inline(always)]
    fn take(
        &mut self,
        mut bits: u64,
        at: usize,
        (along, weight): ([f32; 8], [f32; 8]),
        normal: [f32; 3],
        together: f32,
    ) {
        if self.parts.len() < self.used + 8 {
            self.parts.resize((2 * self.used).max(PARTS), CoveredPixel::default());
        }
        let parts = &mut self.parts[self.used..self.used + 8];
        let mut used = 0;
        while bits != 0 {
            let lane = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let pixel = at + lane / BLOCK_COLUMNS * TILE_COLUMNS + lane % BLOCK_COLUMNS;
            let (along, depth) = (along[lane], &mut self.depth[pixel]);
            let normal = [normal[0] * weight[lane], normal[1] * weight[lane], normal[2] * weight[lane]];
            parts[used & 7] = CoveredPixel { pixel: pixel as u32, along, normal };
            // What is too far behind already stays so. No branch: a processor could not foresee it.
            used += usize::from(along <= *depth + together);
            *depth = if along < *depth { along } else { *depth };
        }
        self.used += used;
    }

    /// Adds up what lies with the nearest.
    fn blend(&mut self) {
        let mut from = 0;
        for &(to, together) in &self.groups {
            for part in &self.parts[from..to] {
                let pixel = part.pixel as usize;
                if part.along <= self.depth[pixel] + together {
                    let sum = &mut self.normals[pixel];
                    (0..3).for_each(|a| sum[a] += part.normal[a]);
                }
            }
            from = to;
        }
    }

    /// Lights the tile's pixels in those of its band.
    fn light(&self, light: &SplatLight, pixels: &mut [Rgba]) {
        let frame = self.frame;
        let width = frame.size[0] as usize;
        for (row, pixels) in pixels.chunks_exact_mut(width).enumerate() {
            let end = (self.first[0] + TILE_COLUMNS).min(width);
            for (column, pixel) in pixels[self.first[0]..end].iter_mut().enumerate() {
                let n = row * TILE_COLUMNS + column;
                if self.depth[n] == f32::INFINITY {
                    continue;
                }
                let along = frame.along(self.first[0] + column, self.first[1] + row);
                *pixel = light.pixel(self.normals[n], along);
            }
        }
    }
}

/// Where rays meet a splat's plane.
trait PlaneOfSplat: Copy {
    /// How far along the rays through pixels, by columns and rows from the first; and the places from the splat's centre.
    fn meet<S: Simd>(self, simd: S, frame: &DrawFrame, x: f32x8<S>, y: f32x8<S>)
    -> (f32x8<S>, [f32x8<S>; 3]);
}

#[inline(always)]
fn linear<S: Simd>(simd: S, of: Linear, x: f32x8<S>, y: f32x8<S>) -> f32x8<S> {
    f32x8::splat(simd, of[0]) + x * f32x8::splat(simd, of[1]) + y * f32x8::splat(simd, of[2])
}

/// Of parallel rays: all is linear.
#[derive(Clone, Copy)]
struct ParallelPlane {
    along: Linear,
    place: [Linear; 3],
}

impl ParallelPlane {
    #[inline(always)]
    fn new(frame: &DrawFrame, splat: &PlacedSplat, column: usize, row: usize) -> ParallelPlane {
        let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
        let [right, down] = frame.steps;
        let mut to = [0.0; 3];
        for a in 0..3 {
            to[a] = splat.centre[a] - (frame.origin[a] + right[a] * x + down[a] * y);
        }
        let n = splat.normal;
        let per = 1.0 / dot(n, frame.corner);
        let along = [dot(n, to) * per, -dot(n, right) * per, -dot(n, down) * per];
        let mut place = [[0.0; 3]; 3];
        for a in 0..3 {
            let away = frame.corner[a];
            place[a] = [away * along[0] - to[a], right[a] + away * along[1], down[a] + away * along[2]];
        }
        ParallelPlane { along, place }
    }
}

impl PlaneOfSplat for ParallelPlane {
    #[inline(always)]
    fn meet<S: Simd>(self, simd: S, _: &DrawFrame, x: f32x8<S>, y: f32x8<S>) -> (f32x8<S>, [f32x8<S>; 3]) {
        let place = [
            linear(simd, self.place[0], x, y),
            linear(simd, self.place[1], x, y),
            linear(simd, self.place[2], x, y),
        ];
        (linear(simd, self.along, x, y), place)
    }
}

/// Of rays from the eye.
#[derive(Clone, Copy)]
struct PerspectivePlane {
    /// Direction of the ray through the first pixel.
    ray: [f32; 3],
    /// From the eye to the centre, and the distance of the plane from the eye.
    to: [f32; 3],
    before: f32,
    /// Along the normal, the direction of rays.
    slope: Linear,
}

impl PerspectivePlane {
    #[inline(always)]
    fn new(frame: &DrawFrame, splat: &PlacedSplat, column: usize, row: usize) -> PerspectivePlane {
        let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
        let [right, down] = frame.steps;
        let (mut ray, mut to) = ([0.0; 3], [0.0; 3]);
        for a in 0..3 {
            ray[a] = frame.corner[a] + right[a] * x + down[a] * y;
            to[a] = splat.centre[a] - frame.origin[a];
        }
        let n = splat.normal;
        PerspectivePlane { ray, to, before: dot(n, to), slope: [dot(n, ray), dot(n, right), dot(n, down)] }
    }
}

impl PlaneOfSplat for PerspectivePlane {
    #[inline(always)]
    fn meet<S: Simd>(
        self,
        simd: S,
        frame: &DrawFrame,
        x: f32x8<S>,
        y: f32x8<S>,
    ) -> (f32x8<S>, [f32x8<S>; 3]) {
        let along = f32x8::splat(simd, self.before) / linear(simd, self.slope, x, y);
        let mut place = [along; 3];
        for (a, place) in place.iter_mut().enumerate() {
            let ray = linear(simd, [self.ray[a], frame.steps[0][a], frame.steps[1][a]], x, y);
            *place = ray * along - f32x8::splat(simd, self.to[a]);
        }
        (along, place)
    }
}

/// A bit for each place of a splat's plane where the splat is, and how much it counts there.
#[inline(always)]
fn covers<S: Simd>(
    simd: S,
    frame: &DrawFrame,
    placed: &PlacedSplats,
    splat: &PlacedSplat,
    along: f32x8<S>,
    q: [f32x8<S>; 3],
) -> (u64, f32x8<S>) {
    let one = f32x8::splat(simd, 1.0);
    let share = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2]) * f32x8::splat(simd, placed.per_square);
    let reach = f32x8::splat(simd, placed.reach);
    let mut is_in = share.simd_le(one) & along.simd_gt(f32x8::splat(simd, 0.0));
    for (a, q) in q.iter().enumerate() {
        is_in &= (*q + f32x8::splat(simd, splat.normal[a] * splat.offset)).abs().simd_le(reach);
    }
    let from = (splat.cuts >> 2) as usize;
    for (n, d) in &placed.cuts[from..from + (splat.cuts & 3) as usize] {
        let before = q[0] * f32x8::splat(simd, n[0])
            + q[1] * f32x8::splat(simd, n[1])
            + q[2] * f32x8::splat(simd, n[2]);
        is_in &= before.simd_le(f32x8::splat(simd, *d));
    }
    if frame.open {
        for (a, q) in q.iter().enumerate() {
            let p = *q + f32x8::splat(simd, splat.centre[a]);
            is_in = is_in
                & p.simd_ge(f32x8::splat(simd, frame.corners[0][a]))
                & p.simd_le(f32x8::splat(simd, frame.corners[1][a]));
        }
    }
    let rest = one - share;
    (is_in.to_bitmask(), rest * rest + f32x8::splat(simd, 1e-4))
}
