//! Open soups: the winding number as crossings of a closed soup less the solid angles of what closed it.
//!
//! Let S be the soup, ∂S the directed edges that do not cancel ([`Boundary`]) and C any surface with ∂C = −∂S (the
//! *caps*). S ∪ C is closed, so its winding number is an exact count of crossings, and w_S = crossings(S ∪ C) − w_C.
//!
//! The caps are few, and w_C, a harmonic function away from them, comes from a tree of multipole expansions with a
//! proven bound on its error ([`ClusterTree`]); near the caps from their solid angles one by one.
//!
//! Where a sample lies on a cap, the integer predicate and the tie rule that decide the crossing decide the
//! side for the solid angle too, so that the difference does not jump there.

mod angle;
mod atan;
mod blocks;
mod boundary;
mod brick;
mod caps;
mod cell;
mod cells;
mod concurrent_cache;
mod high_moments;
mod local;
mod loops;
mod moments;
mod points;
mod region;
mod regions;
mod sample_blocks;
mod smooth;
mod translation;
mod tree;
mod wide;

pub use blocks::{BlockSample, ClusterParts, SumBlock, SumBlocks};
pub use boundary::{Boundary, OpenEdge};
pub use brick::{OpenBrick, OpenEvaluator, OpenField, RoundedShares};
pub(super) use brick::{Shares, are_near, binary_places, fixed_point, least_bits};
pub use cell::FAR_FIELD_BYTES;
pub(super) use concurrent_cache::{ConcurrentCache, MemorySize};
pub(super) use local::{LocalExpansion, local_bound};
pub(super) use moments::Expansion;
pub use moments::{GROUP, Moments, Reach, SurfaceElement};
pub use points::open_winding_at;
pub(super) use points::shares_at;
pub(super) use translation::Translation;
pub(super) use tree::Cluster;
pub use tree::ClusterTree;

use crate::error::Result;
use crate::lattice::{RootCube, Triangle, Units, normal};
use crate::progress::Progress;
use crate::soup::Facets;
use angle::Cap;
use loops::Loops;

/// What so many caps take for good: themselves twice, and the clusters over them.
pub fn bytes_of_caps(caps: u64) -> u64 {
    caps * (2 * size_of::<Triangle>() + size_of::<Cap>()) as u64 + tree::cluster_bytes::<Cap>(caps)
}

/// What is known of a soup's openness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OpenSummary {
    /// Directed edges that no reverse cancels, with multiplicity.
    pub open_edges: u64,
    /// Simple loops into which they fall.
    pub loops: u64,
    /// Connected sets of edges at which facets run the same way twice or more: the borders of patches that
    /// face the wrong way. Doubled sheets have such a border too.
    pub flipped_patches: u64,
    /// Triangles that close the loops.
    pub caps: u64,
}

/// The caps of an open soup, and the expansion of their solid angles.
#[derive(Debug)]
pub struct OpenPart {
    /// The caps: with the soup, and triangles without area, they are closed.
    pub caps: Vec<Triangle>,
    /// Their solid angles.
    pub tree: ClusterTree<Cap>,
    /// Figures.
    pub summary: OpenSummary,
}

impl OpenPart {
    /// Finds the boundary of the soup of all sources and closes it. Memory goes with the open edges, and
    /// while they are found with at most ten million edges at 40 bytes.
    ///
    /// # Errors
    /// If the user interrupts.
    pub fn of(sources: &[&dyn Facets], root: RootCube, progress: &dyn Progress) -> Result<OpenPart> {
        OpenPart::within(u64::MAX, sources, root, progress)
    }

    /// As [`OpenPart::of`], with edges of at most `memory` bytes at a time while open ones are found.
    ///
    /// # Errors
    /// If the user interrupts.
    pub fn within(
        memory: u64,
        sources: &[&dyn Facets],
        root: RootCube,
        progress: &dyn Progress,
    ) -> Result<OpenPart> {
        progress.phase("finding open edges", None, "facets");
        Ok(OpenPart::from_boundary(&Boundary::within(memory, sources, root, progress)?))
    }

    /// Closes a boundary.
    pub fn from_boundary(boundary: &Boundary) -> OpenPart {
        let loops = Loops::trace(&boundary.edges);
        // A triangle without area crosses nothing and covers nothing.
        let mut caps = caps::close(&loops);
        caps.retain(|cap| normal(cap) != [0; 3]);
        let summary = OpenSummary {
            open_edges: boundary.edges.len() as u64,
            loops: loops.len() as u64,
            flipped_patches: boundary.flipped_patches(),
            caps: caps.len() as u64,
        };
        let tree = ClusterTree::new(caps.iter().map(Cap::new).collect());
        OpenPart { caps, tree, summary }
    }

    /// True if there is nothing to close.
    pub fn is_closed(&self) -> bool {
        self.summary.open_edges == 0
    }

    /// w_C at a lattice position, from all caps one by one: exact but for rounding (below 1e-8 a cap).
    pub fn exact_caps_at(&self, p: Units) -> f64 {
        self.tree.exact_at(p)
    }
}

#[cfg(test)]
mod tests;
