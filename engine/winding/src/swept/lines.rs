//! Parallel lattice lines against one solid: what they have in common is worked out once.

use super::cone::Cone;
use super::line::{Feature, Hull, Interval};
use super::solid::{ConvexSolid, SweptSolid};
use crate::lattice::{dot, minus};

/// All lattice lines along one axis, against one solid.
pub struct ParallelLines<'a> {
    solid: &'a SweptSolid,
    axis: usize,
    shape: LinesOf<'a>,
}

/// What such lines have in common, by the shape of the solid.
enum LinesOf<'a> {
    /// Ends of all of them.
    Box([f64; 2]),
    Ball(BallLines),
    Frustum {
        frame: &'a [[f64; 3]; 3],
        cone: Cone,
        /// Their direction in the frustum's frame.
        along: [f64; 3],
    },
}

impl SweptSolid {
    /// The interval in which the line through `at` along `axis` meets the solid; the coordinate of `at` itself does not
    /// matter. `None` if the line misses the solid or only touches it.
    pub fn line(&self, axis: usize, at: [f64; 3]) -> Option<Interval> {
        self.lines(axis).meet(at)
    }

    /// All lines along an axis, with what they have in common worked out once.
    pub fn lines(&self, axis: usize) -> ParallelLines<'_> {
        let shape = match self.shape() {
            ConvexSolid::Box { low, high } => LinesOf::Box([low[axis], high[axis]]),
            ConvexSolid::Ball { way, radius, .. } => LinesOf::Ball(BallLines::new(axis, *way, *radius)),
            ConvexSolid::Frustum { way, frame, height, radius, .. } => {
                let way = frame.map(|row| dot(row, *way));
                let cone = Cone { height: *height, radius: *radius, way };
                LinesOf::Frustum { frame, cone, along: frame.map(|row| row[axis]) }
            }
        };
        ParallelLines { solid: self, axis, shape }
    }
}

impl ParallelLines<'_> {
    /// The interval in which the line through a point meets the solid, as [`SweptSolid::line`].
    #[inline]
    pub fn meet(&self, at: [f64; 3]) -> Option<Interval> {
        let (axis, [low, high]) = (self.axis, self.solid.bounds());
        if (0..3).any(|a| a != axis && (at[a] < low[a] || at[a] >= high[a])) {
            return None;
        }
        let mut hull = Hull::default();
        let from = |place: &[f64; 3]| {
            let mut from = minus(at, *place);
            from[axis] = 0.0;
            from
        };
        match (&self.shape, self.solid.shape()) {
            (LinesOf::Ball(lines), ConvexSolid::Ball { at: centre, .. }) => {
                lines.meet(from(centre), centre[axis], &mut hull);
            }
            (LinesOf::Frustum { frame, cone, along }, ConvexSolid::Frustum { at: place, .. }) => {
                let from = from(place);
                cone.meet(frame.map(|row| dot(row, from)), *along, place[axis], &mut hull);
            }
            (LinesOf::Box([low, high]), _) => {
                hull.add(*low, 0.0, Feature::LowFace);
                hull.add(*high, 0.0, Feature::HighFace);
            }
            _ => {}
        }
        hull.interval()
    }
}

/// Lines along an axis through a ball that moves: through its first and its last place, and the cylinder between both.
struct BallLines {
    axis: usize,
    way: [f64; 3],
    radius: f64,
    /// Of a ball that does not stand still.
    cylinder: Option<CylinderLines>,
}

struct CylinderLines {
    length: f64,
    /// The unit direction of the way.
    along: [f64; 3],
    /// The part of the lines' direction across that way, and its square.
    across: [f64; 3],
    squared: f64,
}

impl BallLines {
    fn new(axis: usize, way: [f64; 3], radius: f64) -> BallLines {
        let cylinder = (way != [0.0; 3]).then(|| {
            let length = dot(way, way).sqrt();
            let along = way.map(|c| c / length);
            let mut direction = [0.0; 3];
            direction[axis] = 1.0;
            let across = minus(direction, along.map(|c| c * dot(along, direction)));
            CylinderLines { length, along, across, squared: dot(across, across) }
        });
        BallLines { axis, way, radius, cylinder }
    }

    /// Adds the ends of the line through `from`, relative to the centre at first.
    #[inline]
    fn meet(&self, from: [f64; 3], shift: f64, hull: &mut Hull) {
        let BallLines { axis, radius, .. } = *self;
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut add = |at: f64| {
            low = if at < low { at } else { low };
            high = if at > high { at } else { high };
        };
        let mut ball = |centre: [f64; 3]| {
            let off = minus(from, centre);
            let across = (0..3).filter(|&a| a != axis).map(|a| off[a] * off[a]).sum::<f64>();
            let rest = radius * radius - across;
            if rest >= 0.0 {
                let half = rest.sqrt();
                add(centre[axis] - half);
                add(centre[axis] + half);
            }
        };
        ball([0.0; 3]);
        if let Some(cylinder) = &self.cylinder {
            ball(self.way);
            cylinder.ends(axis, from, radius).into_iter().flatten().for_each(add);
        }
        if low <= high {
            hull.add(low + shift, 0.0, Feature::Ball);
            hull.add(high + shift, 0.0, Feature::Ball);
        }
    }
}

impl CylinderLines {
    /// Where the line through a point goes in and out of the side, between both ends.
    #[inline]
    fn ends(&self, axis: usize, from: [f64; 3], radius: f64) -> [Option<f64>; 2] {
        let CylinderLines { length, along, across, squared: a } = *self;
        let p = minus(from, along.map(|c| c * dot(along, from)));
        let (b, c) = (dot(p, across), dot(p, p) - radius * radius);
        let rest = b * b - a * c;
        if a <= 1e-14 || rest < 0.0 {
            return [None; 2];
        }
        let root = rest.sqrt();
        [(-b - root) / a, (-b + root) / a].map(|t| {
            let step = dot(along, from) + t * along[axis];
            (0.0..=length).contains(&step).then_some(t)
        })
    }
}
