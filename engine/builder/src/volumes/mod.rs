//! Volumes straight from the source, by line integrals: no lattice of samples has a part in them.
//!
//! Lines stand at two random positions in each cell of a grid, its *strata* (stratified sampling: Cochran 1977,
//! *Sampling Techniques*, ch. 5): for triangles parallel to z, over the part's plan; for beads level, across most of
//! them. Beads lie beside each other and in stacks: a line along z meets their common parts in all layers or in none,
//! so for as many intervals ± of the overlap was 1.5 to 4 times as large.
//!
//! Random numbers are hashes of a stratum's number, so the same input gives the same lines, and no layer height or cell
//! size can be in step with them.
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
