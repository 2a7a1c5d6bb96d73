//! Where a brick lies in the world: its samples, its cells, and places in them.

use crate::lattice::{BRICK_CELLS, BRICK_POINTS, NodeKey, RootCube};
use crate::wide::{Simd, SimdBase, f32x8, f64x8, in_fours, narrowed};

/// World coordinates of a brick's samples by axis.
pub(super) type SampleCoordinates = [[f32; BRICK_POINTS]; 3];

/// Where a coordinate of the world lies along an axis, 0..1 in the cells with this number.
#[inline(always)]
pub(super) fn along(lattice: &SampleCoordinates, axis: usize, cell: usize, coordinate: f32) -> f64 {
    let [low, high] = [cell, cell + 1].map(|n| f64::from(lattice[axis][n]));
    (f64::from(coordinate) - low) / (high - low)
}

/// From cell coordinates of a brick to the world.
#[derive(Clone, Copy)]
pub(super) struct CellFrame {
    root: RootCube,
    key: NodeKey,
    origin: [f64; 3],
    spacing: f64,
    /// How far vertices stay away from their cell's faces, as a share of the cell.
    pub margin: f64,
}

impl CellFrame {
    pub(super) fn new(root: RootCube, key: NodeKey) -> CellFrame {
        let spacing = root.spacing(key.level());
        let farthest = root.origin.iter().fold(0.0f64, |m, &o| m.max(o.abs()).max((o + root.edge).abs()));
        // More than one step of f32 on each side keeps the vertices of different cells, and the extra ones on
        // the faces between them, apart. No more than that: a face of the part that lies on the border of
        // cells is moved by the margin, and what it encloses grows or shrinks.
        let step = f64::from((farthest as f32).next_up()) - f64::from(farthest as f32);
        let margin = (1.01 * step / spacing).min(0.25);
        let origin = root.to_world(key.base().map(|b| f64::from(b) + 1.0));
        CellFrame { root, key, origin, spacing, margin }
    }

    /// World coordinates of the brick's samples. They follow from the place in the root alone, so that all bricks have the
    /// same number for one plane of samples, to the last bit.
    pub(super) fn lattice(&self) -> SampleCoordinates {
        let samples: [[f32; 3]; BRICK_POINTS] = std::array::from_fn(|n| self.sample(n));
        std::array::from_fn(|a| std::array::from_fn(|n| samples[n][a]))
    }

    /// World coordinates of the brick's lower and upper corner.
    pub(super) fn bounds(&self) -> [[f32; 3]; 2] {
        [0, BRICK_CELLS].map(|n| self.sample(n))
    }

    /// World coordinates of the sample (n, n, n).
    fn sample(&self, n: usize) -> [f32; 3] {
        let step = (n as i32) << self.key.spacing_bits();
        self.root.sample(self.key.base().map(|b| b + step))
    }

    /// A point of the world in cells of the brick.
    pub(super) fn local(&self, position: [f32; 3]) -> [f64; 3] {
        std::array::from_fn(|a| (f64::from(position[a]) - self.origin[a]) / self.spacing)
    }

    /// World position of a point, in cells of the brick, moved into the cell `cell` where it is not.
    pub(super) fn world_within(&self, cell: [i32; 3], point: [f64; 3]) -> [f32; 3] {
        let [low, high] = [self.margin, 1.0 - self.margin];
        std::array::from_fn(|a| {
            let cell = f64::from(cell[a]);
            (self.origin[a] + (cell + (point[a] - cell).clamp(low, high)) * self.spacing) as f32
        })
    }

    /// World position of the point `at`, 0..1 an axis, of a block of `size` cells an axis from `corner` on, or near it
    /// where that is taken: two sheets in one block may have their vertices at the same point.
    pub(super) fn free_place(
        &self,
        (corner, size): ([usize; 3], f64),
        mut at: [f64; 3],
        mut is_taken: impl FnMut(&[f32; 3]) -> bool,
    ) -> [f32; 3] {
        let place = |at: [f64; 3]| self.world(corner, at.map(|c| c * size));
        let margin = self.margin / size;
        let mut position = place(at);
        let mut tries = 0;
        while is_taken(&position) && tries < 48 {
            let axis = tries % 3;
            let step = (1.0 / 64.0 / size).max(margin) * (1 + tries / 3) as f64;
            at[axis] = (at[axis] + if at[axis] < 0.5 { step } else { -step }).clamp(margin, 1.0 - margin);
            position = place(at);
            tries += 1;
        }
        position
    }

    /// World position of the point `at`, 0..1 an axis, of a cell.
    #[inline]
    pub(super) fn world(&self, cell: [usize; 3], at: [f64; 3]) -> [f32; 3] {
        std::array::from_fn(|a| (self.origin[a] + (cell[a] as f64 + at[a]) * self.spacing) as f32)
    }

    /// The same of eight cells, by their lower corners; a fourth number fills the vectors.
    #[inline(always)]
    pub(super) fn world_wide<S: Simd>(
        &self,
        simd: S,
        corners: [f64x8<S>; 3],
        at: [f64x8<S>; 3],
    ) -> [[f32; 4]; 8] {
        let mut places = [f32x8::splat(simd, 0.0); 3];
        for a in 0..3 {
            places[a] = narrowed(simd, (corners[a] + at[a]) * self.spacing + self.origin[a]);
        }
        let [x, y, z] = places;
        in_fours([x, y, z, x])
    }
}

/// The box around two boxes.
pub(super) fn united([low, high]: [[f32; 3]; 2], other: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    [std::array::from_fn(|a| low[a].min(other[0][a])), std::array::from_fn(|a| high[a].max(other[1][a]))]
}
