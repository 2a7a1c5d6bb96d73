//! Canned cycles of drilling, tapping and boring: G73, G74, G76, G81 to G86, G88, G89.

/// The words of a cycle that hold from hole to hole.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cycle {
    /// Whether one is on.
    pub on: bool,
    /// Height down to which it drills, as programmed.
    pub depth: Option<f64>,
    /// Height from which it feeds.
    pub retract: Option<f64>,
    /// Whether the tool goes back to where it began (G98), or to `retract` (G99).
    pub back_to_start: bool,
}

impl Cycle {
    /// Whether a code begins a cycle that ends where it retracts.
    pub fn begins(code: i64) -> bool {
        matches!(code, 730 | 740 | 760 | 810 | 820 | 830 | 840 | 850 | 860 | 880 | 890)
    }
}
