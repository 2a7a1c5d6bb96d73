//! One splat in the picture.

use super::packed::PackedSplat;
use super::view::{dot, LevelView, RADIUS, REACH};

/// A plane seen from its edge, by the cosine: it covers nothing.
const EDGE_ON: f32 = 1e-6;
/// What is nearer to the eye than this share of its distance from the middle is not drawn.
const NEAREST: f32 = 1e-3;

/// A splat that is seen. x and y are pixels to the right and down from where its middle is seen; places are in cells from its
/// middle, along the axes of the world.
pub(super) struct SeenSplat {
    /// First column and row, and those behind the last.
    pub first: [usize; 2],
    pub end: [usize; 2],
    pub normal: [f32; 3],
    /// x and y of the first pixel's middle.
    pub start: [f32; 2],
    /// A place is (`across` x + `down` y) t; without perspective t is 1.
    pub across: [f32; 3],
    pub down: [f32; 3],
    /// How far the middle is from the eye, or before the middle of what is seen; how that changes with x and y.
    depth: f32,
    pub slope: [f32; 2],
    /// With perspective 1/t = s + `slope` · (x, y).
    pub s: f32,
    /// From the middle of the cell to that of the splat.
    pub moved: [f32; 3],
    /// Planes n, d: what is left is where n · place ≤ d.
    pub cuts: [([f32; 3], f32); 2],
    pub cut_count: usize,
    /// What is left is below this.
    pub highest: Option<[f32; 3]>,
}

/// Unit normal, and offset in cells, of a packed plane.
#[inline(always)]
fn plane(packed: u32) -> ([f32; 3], f32) {
    let [x, y, z, w] = packed.to_le_bytes().map(|byte| f32::from(byte as i8));
    let square = x * x + y * y + z * z;
    let per = 1.0 / square.sqrt();
    ([x * per, y * per, z * per], w / 16.0)
}

impl SeenSplat {
    /// Nothing if the splat faces away, or is beside the picture.
    #[inline(always)]
    pub fn new<const PARALLEL: bool>(view: &LevelView, splat: &PackedSplat) -> Option<SeenSplat> {
        if PARALLEL && view.highest.is_none() {
            let raw = splat[2].to_le_bytes().map(|byte| f32::from(byte as i8));
            if dot([raw[0], raw[1], raw[2]], view.axes[2]) <= 0.0 {
                return None;
            }
        }
        let at = [splat[0] & 0xffff, splat[0] >> 16, splat[1] & 0xffff];
        let mut cell = [0.0f32; 3];
        (0..3).for_each(|a| cell[a] = (view.first[a] + view.cell_edge * f64::from(at[a])) as f32);
        let (normal, offset) = plane(splat[2]);
        let moved = normal.map(|c| c * offset);
        let mut middle = cell;
        (0..3).for_each(|a| middle[a] += moved[a] * view.cell);
        let n = view.seen(normal);
        // From the eye to the middle, by pictures' axes and the world's.
        let (m, c) = (view.seen(middle), view.seen(cell));
        let mut ray = view.axes[2].map(|c| -c);
        if !PARALLEL {
            (0..3).for_each(|a| ray[a] = middle[a] - view.axes[2][a] * view.distance);
        }
        let before = dot(normal, ray);
        // As the program does: with perspective a disc that just turns away still counts.
        let (nearest, farthest) =
            if PARALLEL { (EDGE_ON, 0.0) } else { (EDGE_ON * view.distance, RADIUS * view.cell) };
        if before.abs() < nearest || (before > farthest && view.highest.is_none()) {
            return None;
        }
        let [low, high] = if PARALLEL { parallel_box(view, n, m, c) } else { perspective_box(view, m)? };
        let mut placed = SeenSplat {
            first: [0; 2],
            end: [0; 2],
            normal,
            start: [0.0; 2],
            across: [0.0; 3],
            down: [0.0; 3],
            depth: -m[2],
            slope: [0.0; 2],
            s: 1.0,
            moved,
            cuts: [([0.0; 3], 0.0); 2],
            cut_count: 0,
            highest: None,
        };
        if !PARALLEL {
            placed.depth = view.distance - m[2];
            placed.s = view.distance / placed.depth;
        }
        let seen_at =
            [view.middle[0] + m[0] / view.pixel * placed.s, view.middle[1] - m[1] / view.pixel * placed.s];
        for axis in 0..2 {
            let first = (low[axis] - 0.5).ceil().max(0.0);
            let end = (high[axis] + 0.5).floor().min(view.size[axis]);
            if first >= end {
                return None;
            }
            placed.first[axis] = first as usize;
            placed.end[axis] = end as usize;
            placed.start[axis] = first + 0.5 - seen_at[axis];
        }
        let (right, up) = (n[0] / before, n[1] / before);
        let per_cell = view.pixel / view.cell;
        (0..3).for_each(|a| {
            placed.across[a] = (view.axes[0][a] - right * ray[a]) * per_cell;
            placed.down[a] = (up * ray[a] - view.axes[1][a]) * per_cell;
        });
        // Along parallel rays a plane goes away by this a pixel; with perspective the same changes 1/t.
        placed.slope = [right * view.pixel, -up * view.pixel];
        if PARALLEL {
            placed.slope = placed.slope.map(|c| -c);
        }
        placed.cut_by(splat);
        placed.highest = view.highest.map(|highest| {
            let mut left = highest;
            (0..3).for_each(|a| left[a] = (left[a] - middle[a]) / view.cell);
            left
        });
        Some(placed)
    }

    #[inline(always)]
    fn cut_by(&mut self, splat: &PackedSplat) {
        for bit in 0..2 {
            let packed = splat[3 + bit];
            if packed != 0 {
                let (normal, offset) = plane(packed);
                let sign = if splat[1] >> (24 + bit) & 1 == 0 { 1.0 } else { -1.0 };
                let normal = normal.map(|c| c * sign);
                self.cuts[self.cut_count] = (normal, offset * sign - dot(normal, self.moved));
                self.cut_count += 1;
            }
        }
    }

    /// How far the splat is at a pixel of its box, counted from the first, and how much it counts there; nothing where it is not.
    #[inline(always)]
    pub fn at<const PARALLEL: bool>(&self, column: usize, row: usize) -> Option<(f32, f32)> {
        let (x, y) = (self.start[0] + column as f32, self.start[1] + row as f32);
        let t = self.along::<PARALLEL>(x, y);
        let place = self.place(x, y, t);
        let share = dot(place, place) * PER_SQUARE;
        let mut is_in = share <= 1.0 && t > 0.0;
        for (c, moved) in place.iter().zip(&self.moved) {
            is_in &= (c + moved).abs() <= REACH;
        }
        for (normal, d) in &self.cuts[..self.cut_count] {
            is_in &= dot(*normal, place) <= *d;
        }
        if let Some(highest) = self.highest {
            is_in &= (0..3).all(|a| place[a] <= highest[a]);
        }
        if is_in {
            Some((self.depth_at::<PARALLEL>(x, y, t), weight(share)))
        } else {
            None
        }
    }

    /// The same where it is known to be.
    #[inline(always)]
    pub fn within<const PARALLEL: bool>(&self, column: usize, row: usize) -> (f32, f32) {
        let (x, y) = (self.start[0] + column as f32, self.start[1] + row as f32);
        let t = self.along::<PARALLEL>(x, y);
        let place = self.place(x, y, t);
        (self.depth_at::<PARALLEL>(x, y, t), weight(dot(place, place) * PER_SQUARE))
    }

    #[inline(always)]
    fn place(&self, x: f32, y: f32, t: f32) -> [f32; 3] {
        let mut place = [0.0; 3];
        (0..3).for_each(|a| place[a] = (self.across[a] * x + self.down[a] * y) * t);
        place
    }

    #[inline(always)]
    fn along<const PARALLEL: bool>(&self, x: f32, y: f32) -> f32 {
        if PARALLEL {
            1.0
        } else {
            1.0 / (self.s + self.slope[0] * x + self.slope[1] * y)
        }
    }

    #[inline(always)]
    fn depth_at<const PARALLEL: bool>(&self, x: f32, y: f32, t: f32) -> f32 {
        if PARALLEL {
            self.depth + self.slope[0] * x + self.slope[1] * y
        } else {
            t * self.depth * self.s
        }
    }

    /// Whether so many pixels are in the box that it pays to know the splat's edges.
    #[inline(always)]
    pub fn is_large(&self) -> bool {
        (self.end[0] - self.first[0]) * (self.end[1] - self.first[1]) >= LARGE
    }
}

/// A splat that is worth the pains has at least so many pixels in its box.
const LARGE: usize = 64;
const PER_SQUARE: f32 = 1.0 / (RADIUS * RADIUS);

/// How much a splat counts, by the square of the distance from its middle as a share of that of its edge.
#[inline(always)]
fn weight(share: f32) -> f32 {
    (1.0 - share) * (1.0 - share) + 1e-4
}

/// Columns and rows between which a disc and its cell lie: `n` is its normal, `m` its middle, `c` that of the cell, along the axes of the picture.
#[inline(always)]
fn parallel_box(view: &LevelView, n: [f32; 3], m: [f32; 3], c: [f32; 3]) -> [[f32; 2]; 2] {
    let (mut low, mut high) = ([0.0; 2], [0.0; 2]);
    for axis in 0..2 {
        let sign = if axis == 0 { 1.0 } else { -1.0 };
        let middle = view.middle[axis] + sign * m[axis] / view.pixel;
        let cell = view.middle[axis] + sign * c[axis] / view.pixel;
        let disc = RADIUS * view.cell_pixels * (1.0 - n[axis] * n[axis]).max(0.0).sqrt();
        low[axis] = (middle - disc).max(cell - view.box_pixels[axis]);
        high[axis] = (middle + disc).min(cell + view.box_pixels[axis]);
    }
    [low, high]
}

/// The same of a ball around the disc; nothing if it is not before the eye.
#[inline(always)]
fn perspective_box(view: &LevelView, m: [f32; 3]) -> Option<[[f32; 2]; 2]> {
    let (far, radius) = (view.distance - m[2], RADIUS * view.cell);
    let nearest = (far - radius).max(view.distance * NEAREST);
    if far + radius <= nearest {
        return None;
    }
    let (mut low, mut high) = ([0.0; 2], [0.0; 2]);
    let (wide, narrow) = (view.distance / nearest / view.pixel, view.distance / (far + radius) / view.pixel);
    for axis in 0..2 {
        let middle = if axis == 0 { m[0] } else { -m[1] };
        let (least, most) = (middle - radius, middle + radius);
        low[axis] = view.middle[axis] + least * if least < 0.0 { wide } else { narrow };
        high[axis] = view.middle[axis] + most * if most > 0.0 { wide } else { narrow };
    }
    Some([low, high])
}
