//! Convex polygons in space, and what of a triangle lies in which cell.

use crate::lattice::{BRICK_CELLS, NodeKey, Triangle, Vector, cross, dot, minus, normal};

/// A triangle in cells of a brick, with its plane n·x = d.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellFacet {
    pub corners: [Vector; 3],
    pub normal: Vector,
    pub offset: f64,
    /// Its bounding box.
    pub low: Vector,
    pub high: Vector,
}

impl CellFacet {
    /// Of a triangle with an area. It begins with its least corner, so that it does not matter with which the input does.
    pub fn new(t: &Triangle, key: NodeKey) -> CellFacet {
        let least = (0..3).min_by_key(|&n| t[n]).unwrap_or(0);
        let t: Triangle = std::array::from_fn(|n| t[(least + n) % 3]);
        let first = key.base().map(|b| b + 1);
        let spacing = f64::from(1u32 << key.spacing_bits());
        let corners = t.map(|v| std::array::from_fn(|a| f64::from(v[a] - first[a]) / spacing));
        let long = normal(&t).map(|c| c as f64);
        let length = dot(long, long).sqrt();
        let normal = long.map(|c| c / length);
        let [a, b, c]: [Vector; 3] = corners;
        let low = std::array::from_fn(|axis| a[axis].min(b[axis]).min(c[axis]));
        let high = std::array::from_fn(|axis| a[axis].max(b[axis]).max(c[axis]));
        CellFacet { corners, normal, offset: dot(normal, a), low, high }
    }

    /// How far a point is in front of its plane.
    #[inline]
    pub fn height(&self, p: Vector) -> f64 {
        dot(self.normal, p) - self.offset
    }

    /// Calls `cell` with the cells of a brick that its bounding box meets.
    pub fn for_bounds(&self, mut cell: impl FnMut([usize; 3])) {
        let [x, y, z] = [0, 1, 2].map(|axis| {
            // Casts end at 0. One that touches a side belongs to the cells on both.
            let last = BRICK_CELLS - 1;
            let from = ((self.low[axis] - NEAR).ceil() - 1.0).max(0.0) as usize;
            let to = ((self.high[axis] + NEAR).floor().max(-1.0) + 1.0) as usize;
            from..to.min(last + 1)
        });
        for k in z {
            for j in y.clone() {
                x.clone().for_each(|i| cell([i, j, k]));
            }
        }
    }

    /// How far a point of its plane is within its edges; negative beyond them.
    pub fn depth(&self, p: Vector) -> f64 {
        (0..3).map(|edge| self.depth_at(edge, p)).fold(f64::INFINITY, f64::min)
    }

    /// How far a point of its plane is within one of its edges.
    pub fn depth_at(&self, edge: usize, p: Vector) -> f64 {
        let from = self.corners[edge];
        let along = minus(self.corners[(edge + 1) % 3], from);
        dot(cross(self.normal, along), minus(p, from)) / dot(along, along).sqrt()
    }
}

/// Corners of a polygon at most: three of a triangle, six planes of a cell, and some that divide it further.
const CORNERS: usize = 12;

/// A convex polygon, with its corners in order.
#[derive(Clone, Copy, Debug)]
pub(super) struct ConvexPolygon {
    corners: [Vector; CORNERS],
    count: usize,
}

impl ConvexPolygon {
    const EMPTY: ConvexPolygon = ConvexPolygon { corners: [[0.0; 3]; CORNERS], count: 0 };

    pub fn triangle(corners: [Vector; 3]) -> ConvexPolygon {
        let mut polygon = ConvexPolygon { count: 3, ..ConvexPolygon::EMPTY };
        polygon.corners[..3].copy_from_slice(&corners);
        polygon
    }

    #[inline]
    pub fn corners(&self) -> &[Vector] {
        &self.corners[..self.count]
    }

    pub fn is_empty(&self) -> bool {
        self.count < 3
    }

    /// True if there is no room for more corners.
    pub fn is_full(&self) -> bool {
        self.count + 2 > CORNERS
    }

    pub fn middle(&self) -> Vector {
        let mut sum = [0.0; 3];
        self.corners().iter().for_each(|p| (0..3).for_each(|a| sum[a] += p[a]));
        sum.map(|c| c / self.count as f64)
    }

    /// The greatest distance of two corners, or more, by less than twice.
    pub fn length(&self) -> f64 {
        let extent: Vector =
            std::array::from_fn(|axis| self.range(axis)).map(|(low, high): (f64, f64)| high - low);
        dot(extent, extent).sqrt()
    }

    /// Twice its area.
    pub fn area(&self) -> f64 {
        let Some((&first, rest)) = self.corners().split_first() else { return 0.0 };
        let mut sum = [0.0; 3];
        for pair in rest.windows(2) {
            let n = cross(minus(pair[0], first), minus(pair[1], first));
            (0..3).for_each(|a| sum[a] += n[a]);
        }
        dot(sum, sum).sqrt()
    }

    /// Least and greatest coordinate along an axis.
    #[inline]
    pub fn range(&self, axis: usize) -> (f64, f64) {
        let first = self.corners[0][axis];
        self.corners().iter().fold((first, first), |(low, high), p| (low.min(p[axis]), high.max(p[axis])))
    }

    /// What of it has no positive height.
    pub fn below(&self, height: impl Fn(Vector) -> f64) -> ConvexPolygon {
        let mut kept = ConvexPolygon::EMPTY;
        self.put_below(height, &mut kept);
        kept
    }

    /// Puts that into `kept`.
    #[inline]
    fn put_below(&self, height: impl Fn(Vector) -> f64, kept: &mut ConvexPolygon) {
        kept.count = 0;
        let Some(&(mut last)) = self.corners().last() else { return };
        let mut last_height = height(last);
        for &corner in self.corners() {
            let own = height(corner);
            if (own > 0.0) != (last_height > 0.0) {
                let share = last_height / (last_height - own);
                kept.push(std::array::from_fn(|a| last[a] + (corner[a] - last[a]) * share));
            }
            if own <= 0.0 {
                kept.push(corner);
            }
            (last, last_height) = (corner, own);
        }
    }

    #[inline]
    fn push(&mut self, corner: Vector) {
        if self.count < CORNERS {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    /// What of it lies between two planes across an axis, on which new corners lie exactly: itself if all of it does, else
    /// what is put into one of `parts`.
    #[inline]
    fn between<'a>(
        &'a self,
        axis: usize,
        low: f64,
        high: f64,
        parts: &'a mut [ConvexPolygon; 2],
    ) -> &'a ConvexPolygon {
        let [above, below] = parts;
        let (least, most) = self.range(axis);
        let mut part = self;
        if least < low {
            part.put_below(|p| low - p[axis], above);
            above.move_onto(axis, low, |c| c < low + NEAR);
            part = above;
        }
        if most > high {
            part.put_below(|p| p[axis] - high, below);
            below.move_onto(axis, high, |c| c > high - NEAR);
            part = below;
        }
        part
    }

    #[inline]
    fn move_onto(&mut self, axis: usize, plane: f64, is_near: impl Fn(f64) -> bool) {
        for corner in &mut self.corners[..self.count] {
            if is_near(corner[axis]) {
                corner[axis] = plane;
            }
        }
    }

    /// Calls `part` with each cell of a brick that it has an area in, and with what of it lies there, until that is false.
    /// Returns whether it never was.
    pub fn all_cells(&self, mut part: impl FnMut([usize; 3], &ConvexPolygon) -> bool) -> bool {
        let (mut whole, mut parts) = (*self, [ConvexPolygon::EMPTY; 2]);
        for axis in 0..3 {
            whole = *whole.between(axis, 0.0, BRICK_CELLS as f64, &mut parts);
            if whole.is_empty() {
                return true;
            }
        }
        whole.all_layers(2, [0; 3], &mut part)
    }

    /// As [`ConvexPolygon::all_cells`] of what lies in a brick and, along the axes behind `axis`, in a cell.
    fn all_layers(
        &self,
        axis: usize,
        mut cell: [usize; 3],
        part: &mut impl FnMut([usize; 3], &ConvexPolygon) -> bool,
    ) -> bool {
        let (low, high) = self.range(axis);
        let (last, mut parts) = (BRICK_CELLS - 1, [ConvexPolygon::EMPTY; 2]);
        for at in (low as usize).min(last)..=(high as usize).min(last) {
            cell[axis] = at;
            let own = self.between(axis, at as f64, at as f64 + 1.0, &mut parts);
            let goes_on = match axis {
                _ if own.is_empty() => true,
                0 => own.is_on_side(cell) || part(cell, own),
                _ => own.all_layers(axis - 1, cell, part),
            };
            if !goes_on {
                return false;
            }
        }
        true
    }

    /// What of it lies in a cell.
    pub fn within(&self, cell: [usize; 3]) -> ConvexPolygon {
        let (mut part, mut parts) = (*self, [ConvexPolygon::EMPTY; 2]);
        for (axis, from) in cell.into_iter().enumerate() {
            if !part.is_empty() {
                part = *part.between(axis, from as f64, from as f64 + 1.0, &mut parts);
            }
        }
        part
    }

    /// Whether it lies in a side of a cell: it is another cell's, or has no area.
    fn is_on_side(&self, cell: [usize; 3]) -> bool {
        (0..3).any(|axis| {
            let (low, high) = self.range(axis);
            let from = cell[axis] as f64;
            high < from + NEAR || low > from + 1.0 - NEAR
        })
    }
}

/// In cells: no vertex is so near to the plane of a side, since the one is even and the other odd.
pub(super) const NEAR: f64 = 1e-9;
