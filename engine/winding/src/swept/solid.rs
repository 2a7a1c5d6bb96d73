//! One convex solid, and how a lattice line meets it.

use super::cone::Cone;
use super::line::{Feature, IntervalEnd};
use crate::lattice::{BRICK_BITS, NodeKey, cross, dot, minus};

/// A convex solid in units from the root's corner. Only + − × ÷ and square roots, in one order and without fused
/// operations, so all machines compute the same bits.
#[derive(Clone, Copy, Debug)]
pub enum ConvexSolid {
    /// A box along the axes. Its lower faces belong to it, its upper ones do not.
    Box {
        /// Least coordinates.
        low: [f64; 3],
        /// Greatest ones.
        high: [f64; 3],
    },
    /// A ball that moves straight.
    Ball {
        /// Its centre at first.
        at: [f64; 3],
        /// How far it moves.
        way: [f64; 3],
        /// Its radius.
        radius: f64,
    },
    /// A frustum that moves straight without turning: a cylinder, a cone, or the part of a tool between two planes across its
    /// axis.
    Frustum {
        /// Where height 0 of its axis is at first.
        at: [f64; 3],
        /// How far it moves.
        way: [f64; 3],
        /// Rows of a rotation; the last is the tool's axis, from the tip upward.
        frame: [[f64; 3]; 3],
        /// Heights of its planes, the lower one first.
        height: [f64; 2],
        /// Radii there.
        radius: [f64; 2],
    },
}

/// A solid with the box around it.
#[derive(Clone, Copy, Debug)]
pub struct SweptSolid {
    shape: ConvexSolid,
    /// Least and greatest coordinates.
    bounds: [[f64; 3]; 2],
}

impl ConvexSolid {
    /// The upright frame.
    pub const UPRIGHT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
}

/// The cube of a node's samples: its least one, in units, and its edge.
pub fn cube_of(key: NodeKey) -> ([f64; 3], f64) {
    (key.base().map(|c| f64::from(c + 1)), f64::from(1u32 << (key.spacing_bits() + BRICK_BITS)))
}

impl SweptSolid {
    /// A solid.
    pub fn new(shape: ConvexSolid) -> SweptSolid {
        SweptSolid { shape, bounds: bounds(&shape) }
    }

    /// What it is.
    pub fn shape(&self) -> &ConvexSolid {
        &self.shape
    }

    /// Least and greatest coordinates along the axes, in units.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        self.bounds
    }

    /// Whether a point lies inside, by the line along x through it.
    pub fn contains(&self, at: [f64; 3]) -> bool {
        self.line(0, at).is_some_and(|interval| interval.low.at <= at[0] && at[0] < interval.high.at)
    }

    /// The outward direction, of any length, at an end of the interval of the line through `at` along `axis`.
    pub fn outward(&self, axis: usize, mut at: [f64; 3], end: &IntervalEnd) -> [f64; 3] {
        at[axis] = end.at;
        match (&self.shape, end.feature) {
            (_, Feature::LowFace | Feature::HighFace) => {
                let mut normal = [0.0; 3];
                normal[axis] = if end.feature == Feature::LowFace { -1.0 } else { 1.0 };
                normal
            }
            (ConvexSolid::Ball { at: centre, way, .. }, _) => {
                let from = minus(at, *centre);
                let squared = dot(*way, *way);
                let step = if squared > 0.0 { (dot(from, *way) / squared).clamp(0.0, 1.0) } else { 0.0 };
                minus(from, way.map(|c| c * step))
            }
            (ConvexSolid::Frustum { at: place, way, frame, height, radius }, feature) => {
                let from = minus(minus(at, *place), way.map(|c| c * end.step));
                let local = frame.map(|row| dot(row, from));
                let cone = Cone { height: *height, radius: *radius, way: frame.map(|row| dot(row, *way)) };
                let normal = cone_normal(&cone, local, feature);
                [0, 1, 2].map(|a| normal[0] * frame[0][a] + normal[1] * frame[1][a] + normal[2] * frame[2][a])
            }
            (ConvexSolid::Box { .. }, _) => [0.0, 0.0, 1.0],
        }
    }

    /// Whether all samples of a node lie inside.
    pub fn covers(&self, key: NodeKey) -> bool {
        let (low, size) = cube_of(key);
        self.covers_cube(low, size)
    }

    /// Whether no sample of a node lies inside.
    pub fn misses(&self, key: NodeKey) -> bool {
        let (low, size) = cube_of(key);
        self.misses_cube(low, size)
    }

    /// Whether the box around the solid meets a node, and the solid itself, where it is longer than the node: `false` only
    /// where it [misses](SweptSolid::misses).
    pub fn may_meet(&self, key: NodeKey) -> bool {
        let (low, size) = cube_of(key);
        let [least, greatest] = &self.bounds;
        let is_beside = |a: usize| low[a] + size < least[a] - 1.0 || low[a] > greatest[a] + 1.0;
        let is_long = |a: &usize| greatest[*a] - least[*a] > size;
        !(0..3).any(is_beside) && ((0..3).filter(is_long).count() < 2 || !self.misses_cube(low, size))
    }

    /// Whether the whole cube lies inside, with a margin far above rounding.
    pub fn covers_cube(&self, low: [f64; 3], size: f64) -> bool {
        const MARGIN: f64 = 1e-3;
        let [least, greatest] = &self.bounds;
        if (0..3).any(|a| low[a] < least[a] || low[a] + size > greatest[a]) {
            return false;
        }
        // The solid is convex, so its edges along x speak for the cube.
        (0..4usize).all(|corner| {
            let at = [low[0], low[1] + size * (corner & 1) as f64, low[2] + size * (corner >> 1) as f64];
            self.line(0, at)
                .is_some_and(|i| i.low.at + MARGIN <= low[0] && low[0] + size + MARGIN <= i.high.at)
        })
    }

    /// Whether some direction separates the cube from the solid, by more than rounding.
    pub fn misses_cube(&self, low: [f64; 3], size: f64) -> bool {
        let [least, greatest] = &self.bounds;
        if (0..3).any(|a| low[a] + size < least[a] - 1.0 || low[a] > greatest[a] + 1.0) {
            return true;
        }
        let (at, way) = match &self.shape {
            ConvexSolid::Box { .. } => return false,
            ConvexSolid::Ball { at, way, .. } | ConvexSolid::Frustum { at, way, .. } => (*at, *way),
        };
        let half = 0.5 * size;
        let centre = low.map(|c| c + half);
        let separates = |direction: [f64; 3]| {
            let [from, to] = self.reach(direction, at, way);
            let middle = dot(direction, minus(centre, at));
            let cube = half * (direction[0].abs() + direction[1].abs() + direction[2].abs());
            middle + cube < from - 1.0 || middle - cube > to + 1.0
        };
        let length = dot(way, way).sqrt();
        if length == 0.0 {
            // From the solid's middle towards the cube.
            let to = minus(centre, at);
            let size = dot(to, to).sqrt();
            return size > 0.0 && separates(to.map(|c| c / size));
        }
        let along = way.map(|c| c / length);
        let axis = match &self.shape {
            ConvexSolid::Frustum { frame, .. } => frame[2],
            _ => [0.0, 0.0, 1.0],
        };
        let side = cross(axis, along);
        let size = dot(side, side).sqrt();
        if separates(along) {
            return true;
        }
        if size < 1e-9 {
            return false;
        }
        let side = side.map(|c| c / size);
        separates(side) || separates(cross(side, along))
    }

    /// Least and greatest coordinate along a unit direction, from `at`.
    fn reach(&self, direction: [f64; 3], at: [f64; 3], way: [f64; 3]) -> [f64; 2] {
        let moved = dot(direction, way);
        let still = match &self.shape {
            ConvexSolid::Ball { radius, .. } => [-radius, *radius],
            ConvexSolid::Frustum { frame, height, radius, .. } => {
                let up = dot(direction, frame[2]);
                let across = (1.0 - up * up).max(0.0).sqrt();
                let end = |e: usize, sign: f64| height[e] * up + sign * radius[e] * across;
                [end(0, -1.0).min(end(1, -1.0)), end(0, 1.0).max(end(1, 1.0))]
            }
            ConvexSolid::Box { low, high } => {
                let far = |sign: f64| {
                    (0..3).map(move |a| {
                        let (one, other) = (low[a] - at[a], high[a] - at[a]);
                        let (one, other) = (one * direction[a], other * direction[a]);
                        if sign > 0.0 { one.max(other) } else { one.min(other) }
                    })
                };
                [far(-1.0).sum(), far(1.0).sum()]
            }
        };
        [still[0] + moved.min(0.0), still[1] + moved.max(0.0)]
    }
}

fn bounds(shape: &ConvexSolid) -> [[f64; 3]; 2] {
    let moved = |at: &[f64; 3], way: &[f64; 3], reach: [[f64; 3]; 2]| {
        let low = [0, 1, 2].map(|a| at[a] + way[a].min(0.0) + reach[0][a]);
        let high = [0, 1, 2].map(|a| at[a] + way[a].max(0.0) + reach[1][a]);
        [low, high]
    };
    match shape {
        ConvexSolid::Box { low, high } => [*low, *high],
        ConvexSolid::Ball { at, way, radius } => moved(at, way, [[-radius; 3], [*radius; 3]]),
        ConvexSolid::Frustum { at, way, frame, height, radius } => {
            let reach = [0, 1, 2].map(|a| {
                let up = frame[2][a];
                let across = (frame[0][a] * frame[0][a] + frame[1][a] * frame[1][a]).sqrt();
                let end = |e: usize, sign: f64| height[e] * up + sign * radius[e] * across;
                [end(0, -1.0).min(end(1, -1.0)), end(0, 1.0).max(end(1, 1.0))]
            });
            moved(at, way, [reach.map(|r| r[0]), reach.map(|r| r[1])])
        }
    }
}

/// The outward direction in the frustum's frame at a place relative to where the tool stands then.
fn cone_normal(cone: &Cone, local: [f64; 3], feature: Feature) -> [f64; 3] {
    let [x, y, z] = local;
    let distance = (x * x + y * y).sqrt();
    match feature {
        Feature::Low => [0.0, 0.0, -1.0],
        Feature::High => [0.0, 0.0, 1.0],
        Feature::LowRim | Feature::HighRim => {
            let normal = cross(cone.way, [-y, x, 0.0]);
            let middle = 0.5 * (cone.height[0] + cone.height[1]);
            let outward = normal[0] * x + normal[1] * y + normal[2] * (z - middle);
            if outward < 0.0 { normal.map(|c| -c) } else { normal }
        }
        _ if distance > 0.0 => [x, y, -cone.slope() * distance],
        _ => [0.0, 0.0, if cone.slope() > 0.0 { -1.0 } else { 1.0 }],
    }
}
