//! Units of length, as stores name them.

/// Millimetres in the unit with a symbol, as "in"; `None` if it is unknown.
pub fn millimetres(unit: &str) -> Option<f64> {
    let known = [
        ("um", 1e-3),
        ("mm", 1.0),
        ("cm", 10.0),
        ("m", 1000.0),
        ("mil", 0.0254),
        ("in", 25.4),
        ("ft", 304.8),
    ];
    known.into_iter().find(|(name, _)| *name == unit).map(|(_, length)| length)
}
