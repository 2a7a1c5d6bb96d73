//! What is known of a sum in a cell: see [`super::regions`].

use super::kept::Weighed;
use super::local::Local;
use std::sync::Arc;

/// What is known of the sum in a cell.
#[derive(Debug)]
pub(super) enum Region {
    /// It counts for nothing.
    Quiet,
    /// A polynomial about this centre gives it.
    Smooth([f64; 3], Box<Local>),
    /// Nothing.
    Rough,
}

impl Weighed for Arc<Region> {
    /// With its key, its counts and its place in a table.
    fn bytes(&self) -> usize {
        size_of::<Local>() * usize::from(matches!(**self, Region::Smooth(..))) + 160
    }
}
