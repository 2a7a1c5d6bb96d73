//! Volumes straight from the source, by line integrals: no lattice of samples has a part in them.
//!
//! Lines parallel to z stand at two random positions in each cell of a grid over the part's plan, its *strata*
//! (stratified sampling: Cochran 1977, *Sampling Techniques*, ch. 5). Random numbers are hashes of a stratum's number,
//! so the same input gives the same lines, and no layer height or cell size can be in step with them.
//!
//! What lies on a line is integrated exactly, from the crossings of triangles or the intervals of segments. The two
//! lines of a stratum tell the standard error, without bias. A quantity whose integral is known exactly, the volume of
//! all pieces, is measured beside the others and takes away what they have in common with it (a control variate).
//!
//! The numbers depend on the source alone: not on depth, cell, threads, or memory.

mod beads;
mod estimate;
mod facets;
mod strata;
mod tally;
#[cfg(test)]
mod tests;

pub use beads::bead_volumes;
pub use facets::facet_volumes;
