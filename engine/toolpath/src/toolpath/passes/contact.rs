//! Where two segments of a bead come near each other.
//!
//! Points of the two are given by their ways along the bead, s and t. That they are near, far enough apart along the
//! path, and far enough for a corner, are conditions d < W, t − s > 2 W and d < (t − s) / 4, each of them convex in
//! (s, t).
//!
//! For a given t − s the least d follows in closed form, and it is a convex function of t − s. So one search along t −
//! s finds a point that meets all of them, if there is one.

use crate::lattice::{dot, length, minus};

/// Widths along the path within which a stretch is no earlier one.
pub(super) const BACK_WIDTHS: f64 = 2.0;
/// Widths of a pass's beginning, which a loop may come back to.
const CLOSING_WIDTHS: f64 = 2.0;
/// Part of a bead's width within which centre lines are near: beads that merely touch, but for rounding, are not.
const NEAR: f64 = 0.99;
/// Part of the way between two points to which their distance must come for the path to have turned back. At a corner of
/// the angle α it is sin(α/2), so α is 29° at most.
const TURNED: f64 = 0.25;
/// Cosine between directions below which they are opposite: that of a turn by 180° − 29°.
const OPPOSITE: f64 = -0.875;
/// Heights along the tool's axis within which two stretches are of one layer: layers that touch, but for rounding, are.
pub(super) const HEIGHTS: f64 = 1.02;
/// Steps of the search, each of which leaves two thirds.
const STEPS: usize = 24;

/// A segment of a bead.
#[derive(Clone, Copy)]
pub(super) struct ContactSegment {
    pub a: [f64; 3],
    pub b: [f64; 3],
    /// Ways along the bead to its ends.
    pub way: (f64, f64),
    pub width: f64,
    pub height: f64,
}

/// A place where the path comes back to an earlier stretch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    /// Way to the place of the earlier stretch.
    pub earlier: f64,
    /// Way to the place beside it, on the line of the later segment.
    pub here: f64,
    /// Whether the two run in opposite directions.
    pub is_opposite: bool,
    /// The mean of both widths.
    pub width: f64,
}

/// Two segments in the plane across the tool's axis.
struct Pair {
    /// From the earlier segment's first end to that of the later one.
    from: [f64; 3],
    /// Steps along both, per length.
    u: [f64; 3],
    v: [f64; 3],
    /// Least way along the earlier one, and its length; the length of the later one.
    s: (f64, f64),
    t_end: f64,
}

impl ContactSegment {
    /// Direction per length of way.
    fn direction(&self) -> [f64; 3] {
        let length = self.way.1 - self.way.0;
        minus(self.b, self.a).map(|c| if length > 0.0 { c / length } else { 0.0 })
    }

    /// Where this segment comes back to an earlier one of a pass that began at the way `begun`.
    pub fn contact(&self, earlier: &ContactSegment, axis: [f64; 3], begun: f64) -> Option<Contact> {
        let width = 0.5 * (self.width + earlier.width);
        let height = 0.5 * (self.height + earlier.height);
        let [u, v] = [earlier.direction(), self.direction()];
        let from = minus(self.a, earlier.a);
        let across = |d: [f64; 3]| {
            let up = dot(d, axis);
            [0, 1, 2].map(|i| d[i] - up * axis[i])
        };
        let is_opposite = dot(u, v) < OPPOSITE;
        let span = earlier.way.1 - earlier.way.0;
        let closing = if is_opposite { 0.0 } else { begun + CLOSING_WIDTHS * width - earlier.way.0 };
        let pair = Pair {
            from: across(from),
            u: across(u),
            v: across(v),
            s: (closing.max(0.0), span),
            t_end: self.way.1 - self.way.0,
        };
        let (s, t) = pair.search(width, self.way.0 - earlier.way.0)?;
        let at = [0, 1, 2].map(|i| from[i] + t * v[i] - s * u[i]);
        if dot(at, axis).abs() > HEIGHTS * height {
            return None;
        }
        let size = length(pair.v);
        let beside = if size > 0.0 { t - dot(across(at), pair.v) / (size * size) } else { t };
        Some(Contact { earlier: earlier.way.0 + s, here: self.way.0 + beside, is_opposite, width })
    }
}

impl Pair {
    /// Places on both that meet all conditions. `offset` is the way from the first end of one to that of the other.
    fn search(&self, width: f64, offset: f64) -> Option<(f64, f64)> {
        let (s_start, s_end) = self.s;
        if s_start > s_end {
            return None;
        }
        // Of the way between two places.
        let mut low = (offset - s_end).max(BACK_WIDTHS * width);
        let mut high = offset + self.t_end - s_start;
        if low >= high {
            return None;
        }
        let excess = |way: f64| {
            let (d, place) = self.nearest(way - offset);
            (d - (NEAR * width).min(TURNED * way), place)
        };
        for _ in 0..STEPS {
            let third = (high - low) / 3.0;
            let (one, two) = (low + third, high - third);
            let [at_one, at_two] = [one, two].map(excess);
            for (excess, place) in [at_one, at_two] {
                if excess < 0.0 {
                    return Some(place);
                }
            }
            // No place is farther than a third from one of the two, and a step changes d by no more than itself.
            if at_one.0.min(at_two.0) > (1.0 + TURNED) * third {
                return None;
            }
            if at_one.0 < at_two.0 { high = two } else { low = one }
        }
        None
    }

    /// The least distance of two places s and s + `ahead`, and the two.
    fn nearest(&self, ahead: f64) -> (f64, (f64, f64)) {
        let e = [0, 1, 2].map(|i| self.from[i] + ahead * self.v[i]);
        let f = minus(self.v, self.u);
        let ff = dot(f, f);
        let (least, most) = (self.s.0.max(-ahead), self.s.1.min(self.t_end - ahead));
        let best = if ff > 1e-18 { -dot(e, f) / ff } else { least };
        let s = best.min(most).max(least);
        let d = length([0, 1, 2].map(|i| e[i] + s * f[i]));
        (d, (s, s + ahead))
    }
}
