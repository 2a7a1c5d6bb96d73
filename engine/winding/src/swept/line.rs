//! The interval in which a lattice line meets a solid, and what of the solid bounds it.

/// What of a solid bounds an interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// The lower one of the faces across the line.
    LowFace,
    /// The upper one.
    HighFace,
    /// The surface of a ball.
    Ball,
    /// The side of a body of revolution.
    Side,
    /// Its lower plane.
    Low,
    /// Its upper plane.
    High,
    /// The rim of its lower plane, as it moves.
    LowRim,
    /// The rim of its upper plane.
    HighRim,
}

/// An end of an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntervalEnd {
    /// Its coordinate along the line, in units from the root's corner.
    pub at: f64,
    /// How far the tool has moved where it is bounded, 0 to 1.
    pub step: f64,
    /// What bounds it.
    pub feature: Feature,
}

/// Where a line meets a convex solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Its lower end.
    pub low: IntervalEnd,
    /// Its upper end.
    pub high: IntervalEnd,
}

/// The hull of ends, as they are found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hull {
    low: IntervalEnd,
    high: IntervalEnd,
}

impl Default for Hull {
    fn default() -> Hull {
        let end = |at| IntervalEnd { at, step: 0.0, feature: Feature::LowFace };
        Hull { low: end(f64::INFINITY), high: end(f64::NEG_INFINITY) }
    }
}

impl Hull {
    #[inline]
    pub fn add(&mut self, at: f64, step: f64, feature: Feature) {
        let end = IntervalEnd { at, step, feature };
        if at < self.low.at {
            self.low = end;
        }
        if at > self.high.at {
            self.high = end;
        }
    }

    /// The interval, unless it is empty.
    #[inline]
    pub fn interval(self) -> Option<Interval> {
        let Hull { low, high } = self;
        (low.at < high.at).then_some(Interval { low, high })
    }
}
