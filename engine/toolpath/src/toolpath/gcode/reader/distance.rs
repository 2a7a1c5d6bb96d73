//! How far points are apart.

use crate::lattice::{length, minus};

/// The distance of two points.
pub(super) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    length(minus(b, a))
}
