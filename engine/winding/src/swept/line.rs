//! The interval in which a lattice line meets a solid, and what of the solid bounds it.

/// What of a solid bounds an interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// A face across an axis of space, on its lower side or not.
    Face(usize, bool),
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
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Hull(Option<(IntervalEnd, IntervalEnd)>);

impl Hull {
    pub fn add(&mut self, at: f64, step: f64, feature: Feature) {
        let end = IntervalEnd { at, step, feature };
        self.0 = Some(match self.0 {
            None => (end, end),
            Some((low, high)) => (if at < low.at { end } else { low }, if at > high.at { end } else { high }),
        });
    }

    /// The interval, unless it is empty.
    pub fn interval(self) -> Option<Interval> {
        let (low, high) = self.0?;
        (low.at < high.at).then_some(Interval { low, high })
    }
}
