//! The fixed-point lattice that every part of the program shares.
//!
//! The root is a cube of 2^24 *units* per edge. Vertices are snapped to **even** unit coordinates, samples
//! sit on **odd** ones, so no sample line passes through a vertex. A brick of level `L` has the side
//! 2^(24−L) units and 32 samples an axis with spacing h = 2^(19−L) at `base + i·h + 1`. Child sample `2i` is
//! parent sample `i`: lattices nest.

mod equations;
mod facet;
mod key;
mod length;
mod mix;
mod root;
mod vector;

pub use equations::solved_positive;
pub use facet::{CubeTest, bounds, has_area, normal};
pub use key::morton;
pub use key::{NodeKey, Octant};
pub use length::millimetres;
pub use mix::{GOLDEN, hash_bits, mix};
pub use root::RootCube;
pub use vector::{Vector, cross, dot, frame, length, minus, unit};

/// log₂ of the root cube's edge in units.
pub const ROOT_BITS: u32 = 24;
/// log₂ of [`BRICK_CELLS`].
pub const BRICK_BITS: u32 = 5;
/// Cells, and owned samples, along a brick's axis.
pub const BRICK_CELLS: usize = 1 << BRICK_BITS;
/// Samples along a brick's axis including the apron layer, which repeats the upper neighbour's first one.
pub const BRICK_POINTS: usize = BRICK_CELLS + 1;
/// Deepest level: the spacing there is 8 units, so a snapped vertex is still within an eighth of a cell.
pub const MAX_LEVEL: u8 = 16;

/// Position in lattice units.
pub type Units = [i32; 3];
/// One snapped triangle: three vertices in lattice units, counter-clockwise seen from outside.
pub type Triangle = [Units; 3];

/// A lattice axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Axis {
    /// Fastest in memory.
    X = 0,
    /// Middle.
    Y = 1,
    /// Slowest in memory.
    Z = 2,
}

impl Axis {
    /// The three axes in order.
    pub const ALL: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

    /// 0, 1 or 2.
    #[inline]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The other two axes `(u, v)` such that (axis, u, v) is right-handed.
    #[inline]
    pub const fn others(self) -> (Axis, Axis) {
        match self {
            Axis::X => (Axis::Y, Axis::Z),
            Axis::Y => (Axis::Z, Axis::X),
            Axis::Z => (Axis::X, Axis::Y),
        }
    }

    /// The other two axes in their order: (y, z), (x, z) or (x, y).
    #[inline]
    pub const fn others_in_order(self) -> [Axis; 2] {
        match self {
            Axis::X => [Axis::Y, Axis::Z],
            Axis::Y => [Axis::X, Axis::Z],
            Axis::Z => [Axis::X, Axis::Y],
        }
    }
}

/// log₂ of the sample spacing of `level`, in units.
#[inline]
pub const fn spacing_bits(level: u8) -> u32 {
    ROOT_BITS - BRICK_BITS - level as u32
}
