//! Where a section lies.

use crate::lattice::Axis;

/// What is seen beyond the part, as a share of its longer side.
const MARGIN: f64 = 0.02;

/// A plane across an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// The axis that it is perpendicular to.
    pub axis: Axis,
    /// Its world coordinate on that axis.
    pub at: f64,
}

impl Plane {
    /// What of the plane is seen of a part between two corners: least and greatest coordinates by [`Self::sides`], with a margin
    /// of a fiftieth of the longer one.
    pub fn window(self, corners: [[f64; 3]; 2]) -> [[f64; 2]; 2] {
        let [low, high] = corners.map(|corner| self.sides().map(|side| corner[side.index()]));
        let margin = (high[0] - low[0]).max(high[1] - low[1]) * MARGIN;
        [low.map(|c| c - margin), high.map(|c| c + margin)]
    }

    /// The axes of the picture: to the right, and upward. (x, y), (x, z) or (y, z).
    pub fn sides(self) -> [Axis; 2] {
        self.axis.others_in_order()
    }

    /// The world position of a place in it, by the axes of [`Self::sides`].
    pub fn place(self, uv: [f64; 2]) -> [f64; 3] {
        self.point(uv, self.at)
    }

    /// The axis as a letter.
    pub fn letter(self) -> char {
        ['x', 'y', 'z'][self.axis.index()]
    }

    /// The point of space at `uv` of the plane `at`, in whatever coordinates both are.
    pub(super) fn point<T: Copy>(self, uv: [T; 2], at: T) -> [T; 3] {
        let mut point = [at; 3];
        for (side, c) in self.sides().into_iter().zip(uv) {
            point[side.index()] = c;
        }
        point
    }

    /// The two coordinates of a point in the plane.
    pub(super) fn within<T: Copy>(self, point: [T; 3]) -> [T; 2] {
        self.sides().map(|side| point[side.index()])
    }
}
