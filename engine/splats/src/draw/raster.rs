//! Splats to pixels, by bands of rows.

use super::flat::{Flat, FlatFrame};
use super::light::{SplatLight, dot, unit};
use crate::error::Result;
use crate::picture::Rgba;
use crate::progress::Progress;
use rayon::prelude::*;

/// Rows of a band: few enough to stay in the cache.
const BAND: usize = 16;
/// Splats this far behind the nearest belong to it, in reaches of a cell.
const TOGETHER: f32 = 1.1;

/// The colours of all pixels.
pub(super) fn shade(
    frame: &FlatFrame,
    flats: &[Flat],
    axes: [[f64; 3]; 3],
    background: Rgba,
    progress: &dyn Progress,
) -> Result<Vec<Rgba>> {
    let [width, height] = frame.size.map(|side| side as usize);
    let bands = height.div_ceil(BAND);
    progress.phase("drawing splats", Some(bands as u64), "bands");
    let bins = bins(flats, bands);
    let light = SplatLight::new(axes);
    let mut pixels = vec![background; width * height];
    pixels.par_chunks_mut(width * BAND).enumerate().try_for_each(|(number, pixels)| {
        progress.check()?;
        let mut band = Band::new(frame, number * BAND, pixels.len());
        for &n in &bins.numbers[bins.starts[number] as usize..bins.starts[number + 1] as usize] {
            band.splat(&flats[n as usize], Pass::Depth);
        }
        for &n in &bins.numbers[bins.starts[number] as usize..bins.starts[number + 1] as usize] {
            band.splat(&flats[n as usize], Pass::Blend);
        }
        band.light(&light, pixels);
        progress.advance(1);
        Ok(())
    })?;
    Ok(pixels)
}

/// The splats of each band, in order.
struct Bins {
    starts: Vec<u32>,
    numbers: Vec<u32>,
}

fn bins(flats: &[Flat], bands: usize) -> Bins {
    let mut starts = vec![0u32; bands + 2];
    let range = |flat: &Flat| flat.rows[0] as usize / BAND..=flat.rows[1] as usize / BAND;
    for flat in flats {
        range(flat).for_each(|band| starts[band + 2] += 1);
    }
    for band in 2..starts.len() {
        starts[band] += starts[band - 1];
    }
    let mut numbers = vec![0; starts[bands + 1] as usize];
    for (n, flat) in flats.iter().enumerate() {
        for band in range(flat) {
            numbers[starts[band + 1] as usize] = n as u32;
            starts[band + 1] += 1;
        }
    }
    Bins { starts, numbers }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Pass {
    Depth,
    Blend,
}

/// Rows of a picture while they are drawn.
struct Band<'a> {
    frame: &'a FlatFrame,
    first: usize,
    /// How far along the ray the nearest splat is.
    depth: Vec<f32>,
    /// Sum of normals by weight.
    normals: Vec<[f32; 3]>,
}

impl Band<'_> {
    fn new(frame: &FlatFrame, first: usize, pixels: usize) -> Band<'_> {
        Band { frame, first, depth: vec![f32::INFINITY; pixels], normals: vec![[0.0; 3]; pixels] }
    }

    /// Draws a splat where its rows are the band's.
    fn splat(&mut self, flat: &Flat, pass: Pass) {
        let frame = self.frame;
        let width = frame.size[0] as usize;
        let last = self.first + self.depth.len() / width - 1;
        let rows = (flat.rows[0] as usize).max(self.first)..=(flat.rows[1] as usize).min(last);
        let n = flat.normal;
        let together = flat.reach * TOGETHER * frame.per_unit;
        for row in rows {
            let (x, y) = (flat.columns[0] as f32 + 0.5, row as f32 + 0.5);
            let over: [f32; 3] = std::array::from_fn(|a| frame.steps[0][a] * x + frame.steps[1][a] * y);
            // Where the ray begins, its direction, and how both change to the right.
            let (mut from, mut along) = match frame.parallel {
                true => (std::array::from_fn(|a| frame.origin[a] + over[a]), frame.corner),
                false => (frame.origin, std::array::from_fn(|a| frame.corner[a] + over[a])),
            };
            let at = (row - self.first) * width;
            for column in flat.columns[0] as usize..=flat.columns[1] as usize {
                if let Some((t, p)) = meet(flat, n, from, along)
                    && let Some(weight) = covers(flat, frame, p)
                {
                    let pixel = at + column;
                    match pass {
                        Pass::Depth => self.depth[pixel] = self.depth[pixel].min(t),
                        Pass::Blend if t <= self.depth[pixel] + together => {
                            let sum = &mut self.normals[pixel];
                            (0..3).for_each(|a| sum[a] += n[a] * weight);
                        }
                        Pass::Blend => {}
                    }
                }
                let moving = if frame.parallel { &mut from } else { &mut along };
                (0..3).for_each(|a| moving[a] += frame.steps[0][a]);
            }
        }
    }

    fn light(&self, light: &SplatLight, pixels: &mut [Rgba]) {
        let width = self.frame.size[0] as usize;
        for (n, pixel) in pixels.iter_mut().enumerate().filter(|(n, _)| self.depth[*n] < f32::INFINITY) {
            let (x, y) = ((n % width) as f32 + 0.5, (self.first + n / width) as f32 + 0.5);
            let frame = self.frame;
            let along: [f32; 3] = match frame.parallel {
                true => frame.corner,
                false => {
                    std::array::from_fn(|a| frame.corner[a] + frame.steps[0][a] * x + frame.steps[1][a] * y)
                }
            };
            let normal = unit(self.normals[n]);
            let within = dot(normal, along) > 0.0;
            let [r, g, b] = light.colour(if within { normal.map(|c| -c) } else { normal }, within);
            *pixel = [r, g, b, 255];
        }
    }
}

/// Where a ray meets the plane of a splat: how far along it, and the place.
#[inline(always)]
fn meet(flat: &Flat, n: [f32; 3], from: [f32; 3], along: [f32; 3]) -> Option<(f32, [f32; 3])> {
    let to: [f32; 3] = std::array::from_fn(|a| flat.centre[a] - from[a]);
    let t = dot(n, to) / dot(n, along);
    (t > 0.0 && t.is_finite()).then(|| (t, std::array::from_fn(|a| from[a] + along[a] * t)))
}

/// How much a place of a splat's plane counts; nothing where the splat is not.
#[inline(always)]
fn covers(flat: &Flat, frame: &FlatFrame, p: [f32; 3]) -> Option<f32> {
    let q: [f32; 3] = std::array::from_fn(|a| p[a] - flat.centre[a]);
    let share = dot(q, q) * flat.per_square;
    let in_cell = (0..3).all(|a| (p[a] - flat.cell_centre[a]).abs() <= flat.reach);
    let is_left = |(n, d): &([f32; 3], f32)| dot(*n, p) <= *d;
    let is_kept = flat.cuts[..usize::from(flat.cut_count)].iter().all(is_left);
    let in_view = !frame.open || (0..3).all(|a| p[a] >= frame.corners[0][a] && p[a] <= frame.corners[1][a]);
    let weight = (1.0 - share) * (1.0 - share) + 1e-4;
    (share <= 1.0 && in_cell && is_kept && in_view).then_some(weight)
}
