//! One cell of the far field, how its points are answered, and what of these is kept.

use super::concurrent_cache::{ConcurrentCache, MemorySize};
use super::local::CellExpansion;
use super::region::CellSum;
use std::sync::Arc;

/// Cells, and as many bytes of plans, that are kept: some thousands of each.
const KEPT_BYTES: usize = 32 << 20;
/// The same for the regions of cells: some thousands of polynomials.
const REGION_BYTES: usize = 16 << 20;
/// What a hierarchy of clusters takes at most, besides the clusters, of what it keeps of the far field.
pub const FAR_FIELD_BYTES: u64 = (2 * KEPT_BYTES + REGION_BYTES) as u64;

/// One cell: the polynomial of what is far from it, and what is not.
#[derive(Clone, Debug)]
pub(super) struct FarCell {
    pub center: [f64; 3],
    pub local: CellExpansion,
    /// Bound on the polynomial's error.
    pub spent: f64,
    /// Clusters that the polynomial leaves out.
    pub near: Vec<u32>,
}

/// How the points of a cell are answered beyond the polynomial.
#[derive(Debug)]
pub(super) enum CellPlan {
    /// By a polynomial, clusters, and elements one by one.
    Here(Box<ExpansionSum>),
    /// In each eighth of the cell on its own.
    Divide,
}

/// What adds up to the answer.
#[derive(Debug)]
pub(super) struct ExpansionSum {
    pub center: [f64; 3],
    pub local: CellExpansion,
    pub clusters: Vec<u32>,
    pub elements: Vec<u32>,
}

/// log₂ of a cell's edge, and its number along each axis.
pub(super) type CellId = (u32, [u32; 3]);

/// Cells and plans of a tree, by the bits of the error for which they hold.
#[derive(Debug)]
pub(super) struct ExpansionCache {
    pub cells: ConcurrentCache<(u64, CellId), FarCell>,
    pub plans: ConcurrentCache<(u64, CellId, u32), CellPlan>,
    /// By the bits of the limit below which a sum counts for nothing, and those of the least cells.
    pub regions: ConcurrentCache<(u64, u32, CellId), Arc<CellSum>>,
}

impl Default for ExpansionCache {
    fn default() -> Self {
        ExpansionCache {
            cells: ConcurrentCache::new(KEPT_BYTES),
            plans: ConcurrentCache::new(KEPT_BYTES),
            regions: ConcurrentCache::new(REGION_BYTES),
        }
    }
}

impl MemorySize for FarCell {
    fn bytes(&self) -> usize {
        size_of::<FarCell>() + 4 * self.near.len()
    }
}

impl MemorySize for CellPlan {
    fn bytes(&self) -> usize {
        match self {
            CellPlan::Here(sum) => size_of::<ExpansionSum>() + 4 * (sum.clusters.len() + sum.elements.len()),
            CellPlan::Divide => size_of::<CellPlan>(),
        }
    }
}
