//! What lies on one line.

/// Lengths on one line, in units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LineLengths {
    /// Where w ≥ 1.
    pub union: f64,
    /// ∫ (w − 1) where w ≥ 1.
    pub overlap: f64,
    /// −∫ w where w < 0.
    pub negative: f64,
    /// Of all pieces, each for itself: what is known exactly of the whole source.
    pub control: f64,
}

impl LineLengths {
    /// As a vector.
    pub fn values(self) -> [f64; 4] {
        [self.union, self.overlap, self.negative, self.control]
    }

    /// Adds a stretch on which w is the same; empty ones, which rounding may have turned over, add nothing.
    #[inline]
    pub fn add(&mut self, w: i32, from: f64, to: f64) {
        let length = if to > from { to - from } else { 0.0 };
        if w >= 1 {
            self.union += length;
            self.overlap += f64::from(w - 1) * length;
        } else {
            self.negative -= f64::from(w) * length;
        }
    }
}

/// Where a line enters a piece (+1) or leaves it (−1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LineCrossing {
    pub at: f64,
    pub jump: i32,
}

/// Walks along sorted crossings: `each` gets w and both ends of every stretch on which w is not 0.
pub(super) fn walk(crossings: &[LineCrossing], mut each: impl FnMut(i32, f64, f64)) {
    let mut w = 0;
    for (crossing, next) in crossings.iter().zip(&crossings[1.min(crossings.len())..]) {
        w += crossing.jump;
        if w != 0 {
            each(w, crossing.at, next.at);
        }
    }
}
