//! The area within a layer's outer perimeters.

/// Most corners of all outlines of a layer and feature.
const CORNERS_MAX: usize = 1 << 20;

/// Closed beads of a feature in a layer.
#[derive(Default)]
pub(super) struct OutlineLoops {
    loops: Vec<Loop>,
    corners: usize,
    /// Whether there are beads that are not closed, or too many.
    is_open: bool,
}

/// A polygon.
struct Loop {
    points: Vec<[f64; 2]>,
    low: [f64; 2],
    high: [f64; 2],
    width: f64,
}

impl OutlineLoops {
    /// Takes a bead; tells whether it is closed, so that its ends are within a width of each other.
    pub fn push(&mut self, points: &[[f64; 3]], width: f64) -> bool {
        let (first, last) = (points[0], points[points.len() - 1]);
        let d = [0, 1].map(|i| last[i] - first[i]);
        let is_closed = points.len() > 3 && first[2] == last[2] && d[0] * d[0] + d[1] * d[1] <= width * width;
        self.corners += points.len();
        self.is_open |= !is_closed || self.corners > CORNERS_MAX;
        if is_closed && !self.is_open {
            let points: Vec<[f64; 2]> = points.iter().map(|p| [p[0], p[1]]).collect();
            let bound = |limit: fn(f64, f64) -> f64| {
                [0, 1].map(|a| points.iter().map(|p| p[a]).fold(points[0][a], limit))
            };
            let (low, high) = (bound(f64::min), bound(f64::max));
            self.loops.push(Loop { points, low, high, width });
        }
        is_closed
    }

    /// The area within all loops, holes taken off, with half a width around; `None` if there are none, or others than
    /// loops.
    pub fn area(self) -> Option<f64> {
        if self.is_open || self.loops.is_empty() {
            return None;
        }
        let sum = self.loops.iter().enumerate().map(|(number, polygon)| {
            let others = self.loops.iter().enumerate().filter(|(other, _)| *other != number);
            let around = others.filter(|(_, other)| other.holds(polygon)).count();
            // What is around by half a width has the area, half a width times the perimeter, and a circle.
            let (area, perimeter) = polygon.measure();
            let (side, circle) = (
                0.5 * polygon.width * perimeter,
                std::f64::consts::FRAC_PI_4 * polygon.width * polygon.width,
            );
            if around % 2 == 0 { area + side + circle } else { -(area - side + circle).max(0.0) }
        });
        Some(sum.sum())
    }
}

impl Loop {
    /// Area and perimeter.
    fn measure(&self) -> (f64, f64) {
        let next = self.points.iter().cycle().skip(1);
        let (mut area, mut perimeter) = (0.0, 0.0);
        for (p, q) in self.points.iter().zip(next) {
            let from = |p: &[f64; 2]| [p[0] - self.low[0], p[1] - self.low[1]];
            let (a, b) = (from(p), from(q));
            area += 0.5 * (a[0] * b[1] - a[1] * b[0]);
            perimeter += ((q[0] - p[0]) * (q[0] - p[0]) + (q[1] - p[1]) * (q[1] - p[1])).sqrt();
        }
        (area.abs(), perimeter)
    }

    /// Whether another loop, which does not cross this one, lies within.
    fn holds(&self, other: &Loop) -> bool {
        let is_within = |a: usize| self.low[a] <= other.low[a] && other.high[a] <= self.high[a];
        if !is_within(0) || !is_within(1) {
            return false;
        }
        let p = other.points[0];
        let next = self.points.iter().cycle().skip(1);
        let crossings = self.points.iter().zip(next).filter(|(a, b)| {
            (a[1] <= p[1]) != (b[1] <= p[1]) && p[0] < a[0] + (p[1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1])
        });
        crossings.count() % 2 == 1
    }
}
