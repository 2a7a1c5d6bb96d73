//! A line against a frustum that moves: the frustum between two planes across its axis, on a straight way.
//!
//! With t along the line and s along the way, all points of the line that the frustum passes are the shadow on t of a convex
//! region of the plane (t, s): 0 ≤ s ≤ 1, heights between the planes, and a distance from the axis of no more than the radius
//! there. The ends of the shadow are the ends of the region's border lines, or lie where the side turns back by itself.

use super::line::{Feature, Hull};

/// A frustum in its own frame, whose third axis is that of the tool, relative to the place of the tool as it starts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    /// Heights of the planes, the lower one first, and the radii there.
    pub height: [f64; 2],
    pub radius: [f64; 2],
    /// How far it moves.
    pub way: [f64; 3],
}

/// Two linear functions of (t, s) across the axis, the height, and the radius at that height.
struct Region {
    /// Constant part, part of t, part of s.
    across: [[f64; 2]; 3],
    height: [f64; 3],
    radius: [f64; 3],
}

/// Part of a line: from, to; empty if it ends before it begins.
type Range = (f64, f64);

impl Cone {
    /// How much the radius grows with the height.
    pub fn slope(&self) -> f64 {
        (self.radius[1] - self.radius[0]) / (self.height[1] - self.height[0])
    }

    /// Adds the ends of what the line through `from` in the direction `along` meets, as multiples of `along`, plus `shift`.
    pub fn meet(&self, from: [f64; 3], along: [f64; 3], shift: f64, hull: &mut Hull) {
        let (slope, [low, high]) = (self.slope(), self.height);
        let region = Region {
            across: [[from[0], from[1]], [along[0], along[1]], [-self.way[0], -self.way[1]]],
            height: [from[2], along[2], -self.way[2]],
            radius: [self.radius[0] + slope * (from[2] - low), slope * along[2], -slope * self.way[2]],
        };
        region.at_step(0.0, (low, high), shift, hull);
        if self.way == [0.0; 3] {
            return;
        }
        region.at_step(1.0, (low, high), shift, hull);
        region.at_height(low, self.radius[0], Feature::LowRim, shift, hull);
        region.at_height(high, self.radius[1], Feature::HighRim, shift, hull);
        region.turning(self.height, shift, hull);
    }
}

impl Region {
    /// The border line of a step `s`.
    fn at_step(&self, s: f64, (low, high): Range, shift: f64, hull: &mut Hull) {
        let constant = |part: &[f64; 3]| part[0] + s * part[2];
        let (h, dh) = (constant(&self.height), self.height[1]);
        let (mut range, mut ends) = ((f64::NEG_INFINITY, f64::INFINITY), [Feature::Side; 2]);
        if dh == 0.0 {
            if h < low || h >= high {
                return;
            }
        } else {
            let (a, b) = ((low - h) / dh, (high - h) / dh);
            (range, ends) = if a < b {
                ((a, b), [Feature::Low, Feature::High])
            } else {
                ((b, a), [Feature::High, Feature::Low])
            };
        }
        let x = [0, 1].map(|a| self.across[0][a] + s * self.across[2][a]);
        let within = inside(x, self.across[1], constant(&self.radius), self.radius[1], range);
        let Some((from, to)) = within else { return };
        hull.add(from + shift, s, if from > range.0 { Feature::Side } else { ends[0] });
        hull.add(to + shift, s, if to < range.1 { Feature::Side } else { ends[1] });
    }

    /// The border line of a height, where the radius is `radius`.
    fn at_height(&self, height: f64, radius: f64, rim: Feature, shift: f64, hull: &mut Hull) {
        let [h, of_t, of_s] = self.height;
        let [x, x_t, x_s] = self.across;
        if of_t == 0.0 && of_s == 0.0 {
            return;
        }
        let flat = if rim == Feature::LowRim { Feature::Low } else { Feature::High };
        let mut add = |t: f64, s: f64, is_rim: bool| hull.add(t + shift, s, if is_rim { rim } else { flat });
        if of_t.abs() >= of_s.abs() {
            // t by s.
            let (t, slope) = ((height - h) / of_t, -of_s / of_t);
            let across = [0, 1].map(|a| x[a] + t * x_t[a]);
            let along = [0, 1].map(|a| x_s[a] + slope * x_t[a]);
            let Some((from, to)) = inside(across, along, radius, 0.0, (0.0, 1.0)) else { return };
            add(t + slope * from, from, from > 0.0);
            add(t + slope * to, to, to < 1.0);
        } else {
            // s by t.
            let (s, slope) = ((height - h) / of_s, -of_t / of_s);
            let across = [0, 1].map(|a| x[a] + s * x_s[a]);
            let along = [0, 1].map(|a| x_t[a] + slope * x_s[a]);
            let range = match slope {
                0.0 if (0.0..=1.0).contains(&s) => (f64::NEG_INFINITY, f64::INFINITY),
                0.0 => return,
                _ => {
                    let (a, b) = (-s / slope, (1.0 - s) / slope);
                    if a < b { (a, b) } else { (b, a) }
                }
            };
            let Some((from, to)) = inside(across, along, radius, 0.0, range) else { return };
            add(from, s + slope * from, from > range.0);
            add(to, s + slope * to, to < range.1);
        }
    }

    /// Where the side turns back: the line only touches the frustum that stands there.
    fn turning(&self, height: [f64; 2], shift: f64, hull: &mut Hull) {
        let of = |i: usize, j: usize| {
            let [a, b] = [self.across[i], self.across[j]];
            a[0] * b[0] + a[1] * b[1] - self.radius[i] * self.radius[j]
        };
        let c22 = of(2, 2);
        let (c01, c12) = (of(0, 2), of(1, 2));
        if c22 <= 0.0 {
            return;
        }
        let (a, b, c) = (of(1, 1) - c12 * c12 / c22, of(0, 1) - c01 * c12 / c22, of(0, 0) - c01 * c01 / c22);
        let rest = b * b - a * c;
        if rest < 0.0 {
            return;
        }
        // Of a hyperbola, whose a is below 0, one branch is the side's. Both ways to write the roots, so that one of each
        // pair keeps its digits where a is next to nothing.
        let root = rest.sqrt();
        let sum = if b < 0.0 { -b + root } else { -b - root };
        for t in [sum / a, c / sum] {
            if !t.is_finite() {
                continue;
            }
            let s = -(c01 + c12 * t) / c22;
            let value = |part: &[f64; 3]| part[0] + t * part[1] + s * part[2];
            let (h, radius) = (value(&self.height), value(&self.radius));
            if (0.0..=1.0).contains(&s) && height[0] <= h && h < height[1] && radius >= 0.0 {
                hull.add(t + shift, s, Feature::Side);
            }
        }
    }
}

/// The part of a range in which |x + u·dx| ≤ r + u·dr; within the range the right side is not negative.
fn inside(x: [f64; 2], dx: [f64; 2], r: f64, dr: f64, (from, to): Range) -> Option<Range> {
    let a = dx[0] * dx[0] + dx[1] * dx[1] - dr * dr;
    let b = x[0] * dx[0] + x[1] * dx[1] - r * dr;
    let c = x[0] * x[0] + x[1] * x[1] - r * r;
    let size = dx[0] * dx[0] + dx[1] * dx[1] + dr * dr;
    let (low, high) = if a.abs() <= size * 1e-14 {
        // Along the side, or no motion at all.
        match b {
            0.0 if c <= 0.0 => (from, to),
            0.0 => return None,
            b if b > 0.0 => (from, to.min(-c / (2.0 * b))),
            b => (from.max(-c / (2.0 * b)), to),
        }
    } else {
        let rest = b * b - a * c;
        if rest < 0.0 {
            if a > 0.0 {
                return None;
            }
            (from, to)
        } else {
            let root = rest.sqrt();
            let (one, other) = ((-b - root) / a, (-b + root) / a);
            if a > 0.0 {
                (from.max(one), to.min(other))
            } else if from <= other {
                // a < 0: outside of the roots, of which `other` is the lower one.
                (from, to.min(other))
            } else {
                (from.max(one), to)
            }
        }
    };
    (low <= high && low.is_finite() && high.is_finite()).then_some((low, high))
}
