//! Canned cycles of drilling: G81, G82, G83, G73, G85, G89.

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
        matches!(code, 810 | 820 | 830 | 730 | 850 | 890)
    }
}
