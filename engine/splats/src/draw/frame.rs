//! The picture: where rays begin, what of the world is kept, axes, tiles.

use crate::lattice::{cross, dot, unit};
use crate::render::{CutPlane, Screen};

/// Columns and rows of a tile, as powers of two.
pub(super) type TileBits = [u32; 2];

/// Pixels of a tile: few enough to stay in the first cache with what they hold.
pub(super) const TILE_BITS: TileBits = [6, 4];
pub(super) const TILE_COLUMNS: usize = 1 << TILE_BITS[0];
pub(super) const TILE_ROWS: usize = 1 << TILE_BITS[1];

/// The picture. Coordinates are those around the middle of what is seen.
pub(super) struct DrawFrame {
    pub size: [u32; 2],
    /// What is kept of the world.
    pub corners: [[f32; 3]; 2],
    /// Whether cuts open the part, so that what faces away is seen, too.
    pub open: bool,
    /// Where rays begin, the first ray's direction, and the steps of pixels.
    pub origin: [f32; 3],
    pub corner: [f32; 3],
    pub steps: [[f32; 3]; 2],
    pub parallel: bool,
    /// A length along a ray, as one of world units.
    pub per_unit: f32,
    /// To the right, down and away, of length 1.
    pub axes: [[f32; 3]; 3],
    /// Pixels of a world unit in the middle, and how far that is from the eye.
    pub per_pixel: f32,
    pub distance: f32,
    /// From the middle of the picture to its corner in pixels, where rays begin in one point.
    pub shift: [f32; 2],
    middle: [f64; 3],
}

impl DrawFrame {
    pub fn new(screen: &Screen, size: [u32; 2], corners: [[f64; 3]; 2], cuts: &[CutPlane]) -> DrawFrame {
        let middle: [f64; 3] = std::array::from_fn(|a| (corners[0][a] + corners[1][a]) / 2.0);
        let right = unit(screen.steps[0]);
        let down = unit(screen.steps[1]);
        let axes = [right, down, cross(right, down)];
        let around = |p: [f64; 3]| std::array::from_fn(|a| (p[a] - middle[a]) as f32);
        // Splats may reach beyond the part, but not beyond a cut.
        let mut kept = [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]];
        for cut in cuts {
            let (side, axis) = (usize::from(cut.above), cut.axis.index());
            kept[side][axis] = corners[side][axis];
        }
        let per_unit = if screen.parallel { 1.0 } else { 1.0 / screen.distance };
        let shift = if screen.parallel {
            [0.0; 2]
        } else {
            [0, 1].map(|n| (-dot(axes[n], screen.corner) / screen.pixel) as f32)
        };
        DrawFrame {
            size,
            corners: kept.map(around),
            open: !cuts.is_empty(),
            origin: around(screen.origin),
            corner: screen.corner.map(|c| c as f32),
            steps: screen.steps.map(|step| step.map(|c| c as f32)),
            parallel: screen.parallel,
            per_unit: per_unit as f32,
            axes: axes.map(|axis| axis.map(|c| c as f32)),
            per_pixel: (1.0 / screen.pixel) as f32,
            distance: screen.distance as f32,
            shift,
            middle,
        }
    }

    /// The direction of the ray through a pixel.
    #[inline]
    pub fn along(&self, column: usize, row: usize) -> [f32; 3] {
        if self.parallel {
            return self.corner;
        }
        let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
        std::array::from_fn(|a| self.corner[a] + self.steps[0][a] * x + self.steps[1][a] * y)
    }

    /// A place of the world.
    pub fn around(&self, p: [f64; 3]) -> [f32; 3] {
        std::array::from_fn(|a| (p[a] - self.middle[a]) as f32)
    }
}
