//! Splats as a picture needs them: small numbers around its middle, and the pixels that they may touch.

use crate::lattice::{cross, dot};
use crate::render::{CutPlane, Screen};
use crate::splats::Disc;

/// A splat reaches so far beyond the middle of its cell along each axis, in cells: gaps between planes that bend close.
const CELL_REACH: f64 = 0.65;

/// A splat in coordinates around the middle of what is seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flat {
    pub centre: [f32; 3],
    pub normal: [f32; 3],
    /// One divided by the square of the radius.
    pub per_square: f32,
    /// Middle of the cell, and how far the splat reaches from there along each axis.
    pub cell_centre: [f32; 3],
    pub reach: f32,
    /// Planes n, d: what is left has n · x ≤ d.
    pub cuts: [([f32; 3], f32); 2],
    pub cut_count: u8,
    /// Pixels that it may touch: first and last column and row.
    pub columns: [u32; 2],
    pub rows: [u32; 2],
}

/// The picture.
pub(super) struct FlatFrame {
    pub size: [u32; 2],
    /// What is kept of the world.
    pub corners: [[f32; 3]; 2],
    /// Whether cuts open the part, so that what faces away is seen, too.
    pub open: bool,
    /// Where rays begin, the first ray's direction, and the steps of pixels, around `middle`.
    pub origin: [f32; 3],
    pub corner: [f32; 3],
    pub steps: [[f32; 3]; 2],
    pub parallel: bool,
    /// A length along a ray, as one of world units.
    pub per_unit: f32,
    middle: [f64; 3],
    screen: Screen,
    axes: [[f64; 3]; 3],
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = dot(a, a).sqrt();
    a.map(|c| c / length)
}

impl FlatFrame {
    pub fn new(screen: &Screen, size: [u32; 2], corners: [[f64; 3]; 2], cuts: &[CutPlane]) -> FlatFrame {
        let middle: [f64; 3] = std::array::from_fn(|a| (corners[0][a] + corners[1][a]) / 2.0);
        let right = unit(screen.steps[0]);
        let down = unit(screen.steps[1]);
        let away = cross(right, down);
        let around = |p: [f64; 3]| std::array::from_fn(|a| (p[a] - middle[a]) as f32);
        // Splats may reach beyond the part, but not beyond a cut.
        let mut kept = [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]];
        for cut in cuts {
            let (side, axis) = (usize::from(cut.above), cut.axis.index());
            kept[side][axis] = corners[side][axis];
        }
        let per_unit = if screen.parallel { 1.0 } else { 1.0 / screen.distance };
        FlatFrame {
            size,
            corners: kept.map(around),
            open: !cuts.is_empty(),
            origin: around(screen.origin),
            corner: screen.corner.map(|c| c as f32),
            steps: screen.steps.map(|step| step.map(|c| c as f32)),
            parallel: screen.parallel,
            per_unit: per_unit as f32,
            middle,
            screen: *screen,
            axes: [right, down, away],
        }
    }

    /// A splat in the picture; none if it is outside, faces away, or all of it is cut off.
    pub fn flat(&self, disc: &Disc) -> Option<Flat> {
        let around = |p: [f64; 3]| -> [f32; 3] { std::array::from_fn(|a| (p[a] - self.middle[a]) as f32) };
        let reach = CELL_REACH * disc.cell;
        let cell_centre = around(disc.cell_centre);
        let is_seen = (0..3).all(|a| {
            cell_centre[a] + reach as f32 >= self.corners[0][a]
                && cell_centre[a] - reach as f32 <= self.corners[1][a]
        });
        if !is_seen {
            return None;
        }
        let from: [f64; 3] = std::array::from_fn(|a| disc.centre[a] - self.screen.origin[a]);
        let sight = if self.screen.parallel { self.screen.corner } else { from };
        // With perspective the far edge of a disc may face the eye while its centre does not.
        let slack = if self.screen.parallel { 0.0 } else { disc.radius };
        if !self.open && dot(disc.normal, sight) > slack {
            return None;
        }
        let [x, y, depth] = self.axes.map(|axis| dot(axis, from));
        let (scale, corner) = if self.screen.parallel {
            (1.0 / self.screen.pixel, [0.0; 2])
        } else {
            // The sphere around the disc must be before the eye.
            if depth <= disc.radius * 1.01 {
                return None;
            }
            let scale = self.screen.distance / depth / self.screen.pixel;
            let half = [0, 1].map(|n| -dot(self.axes[n], self.screen.corner) / self.screen.pixel);
            (scale, half)
        };
        // Along an axis of the picture a disc reaches as far as its plane lets it; nearer parts look larger.
        let nearer = if self.screen.parallel { 1.0 } else { depth / (depth - disc.radius) };
        let pixels = |n: usize, at: f64| {
            let extent = disc.radius * (1.0 - dot(disc.normal, self.axes[n]).powi(2)).max(0.0).sqrt();
            let extent = if self.screen.parallel { extent } else { disc.radius };
            let (at, extent) = (at * scale + corner[n], extent * scale * nearer);
            let last = f64::from(self.size[n]) - 1.0;
            let [low, high] = [(at - extent - 0.5).ceil(), (at + extent - 0.5).floor()];
            (low <= last && high >= 0.0 && low <= high).then(|| [low.max(0.0) as u32, high.min(last) as u32])
        };
        let (columns, rows) = (pixels(0, x)?, pixels(1, y)?);
        let mut cuts = [([0.0; 3], 0.0); 2];
        for (to, (n, d)) in cuts.iter_mut().zip(&disc.cuts) {
            *to = (n.map(|c| c as f32), (d - dot(*n, self.middle)) as f32);
        }
        Some(Flat {
            centre: around(disc.centre),
            normal: disc.normal.map(|c| c as f32),
            per_square: (1.0 / (disc.radius * disc.radius)) as f32,
            cell_centre,
            reach: reach as f32,
            cuts,
            cut_count: disc.cuts.len().min(2) as u8,
            columns,
            rows,
        })
    }
}
