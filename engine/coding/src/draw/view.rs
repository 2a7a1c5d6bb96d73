//! Where the eye is.

/// What colours tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrawStyle {
    /// Two lamps.
    Light,
    /// The normal: red is x, green y, blue z.
    Normals,
    /// The level: from coarse to fine.
    Levels,
}

/// From where a part is seen, and how. Lengths and places are those of the world, around the middle of the part.
#[derive(Clone, Debug)]
pub struct DrawView {
    /// Columns and rows, at least 1.
    pub size: [usize; 2],
    /// Least corner of the root's cube, and its edge.
    pub origin: [f64; 3],
    /// Edge of the root's cube.
    pub edge: f64,
    /// To the right, upward, towards the eye; of length 1.
    pub axes: [[f64; 3]; 3],
    /// What is in the middle of the picture.
    pub centre: [f64; 3],
    /// Length of a pixel there.
    pub pixel: f64,
    /// From there to the eye; 0 for parallel rays.
    pub distance: f64,
    /// What is beyond this is cut away, which opens the part.
    pub highest: Option<[f64; 3]>,
    /// What colours tell.
    pub style: DrawStyle,
    /// The deepest level of the part.
    pub deepest: u32,
}

/// A view, for cells of one level.
#[derive(Clone, Debug)]
pub(super) struct LevelView {
    /// Columns and rows of the picture, and its middle in pixels.
    pub size: [f32; 2],
    pub middle: [f32; 2],
    pub axes: [[f32; 3]; 3],
    /// From the middle of what is seen to the eye.
    pub distance: f32,
    pub pixel: f32,
    /// Middle of the first cell of the root's cube from the middle of what is seen, and the edge of a cell.
    pub first: [f64; 3],
    pub cell_edge: f64,
    pub cell: f32,
    /// Pixels of a cell in the middle of what is seen.
    pub cell_pixels: f32,
    /// So far a cell and what is beyond it reaches along columns and rows, in pixels there.
    pub box_pixels: [f32; 2],
    /// What is cut away begins here, from the middle of what is seen.
    pub highest: Option<[f32; 3]>,
}

/// A splat reaches so far beyond the middle of its cell along each axis, in cells: gaps between planes that bend close.
pub const CELL_REACH: f64 = 0.65;
/// Half the diagonal of a cell, in cells: the radius of a disc.
pub const HALF_DIAGONAL: f64 = 0.866_025_403_784_438_6;
/// Splats this far behind the nearest belong to it, in reaches of a cell.
pub const TOGETHER: f32 = 1.1;

/// The same as numbers of the picture: how far a splat reaches and its radius, in cells.
pub(super) const REACH: f32 = CELL_REACH as f32;
pub(super) const RADIUS: f32 = HALF_DIAGONAL as f32;

impl LevelView {
    pub fn new(view: &DrawView, level: u32) -> LevelView {
        let cell = view.edge / (32u64 << level.min(32)) as f64;
        let axes = view.axes.map(|axis| axis.map(|c| c as f32));
        let cell_pixels = (cell / view.pixel) as f32;
        let reach = |axis: [f32; 3]| axis.iter().map(|c| c.abs()).sum::<f32>() * REACH * cell_pixels;
        let mut first = [0.0; 3];
        (0..3).for_each(|a| first[a] = view.origin[a] + 0.5 * cell - view.centre[a]);
        let size = view.size.map(|side| side as f32);
        LevelView {
            size,
            middle: size.map(|side| side / 2.0),
            axes,
            distance: view.distance as f32,
            pixel: view.pixel as f32,
            first,
            cell_edge: cell,
            cell: cell as f32,
            cell_pixels,
            box_pixels: [reach(axes[0]), reach(axes[1])],
            highest: view.highest.map(|at| {
                let mut from = [0.0; 3];
                (0..3).for_each(|a| from[a] = (at[a] - view.centre[a]) as f32);
                from
            }),
        }
    }

    /// A vector along the axes of the picture.
    #[inline(always)]
    pub fn seen(&self, of: [f32; 3]) -> [f32; 3] {
        self.axes.map(|axis| dot(axis, of))
    }
}

#[inline(always)]
pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
