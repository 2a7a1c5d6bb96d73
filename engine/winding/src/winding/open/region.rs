//! What is known of a sum in a cell: see [`super::regions`].

use super::concurrent_cache::MemorySize;
use super::local::CellExpansion;
use std::sync::Arc;

/// What is known of the sum in a cell.
#[derive(Debug)]
pub(super) enum CellSum {
    /// It counts for nothing.
    Quiet,
    /// A polynomial about this centre gives it.
    Smooth([f64; 3], Box<CellExpansion>),
    /// Nothing.
    Rough,
}

impl MemorySize for Arc<CellSum> {
    /// With its key, its counts and its place in a table.
    fn bytes(&self) -> usize {
        size_of::<CellExpansion>() * usize::from(matches!(**self, CellSum::Smooth(..))) + 160
    }
}
