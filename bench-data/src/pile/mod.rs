//! Many pieces together.

mod beads;
mod part;
mod random;

pub use beads::{BeadPile, FACETS_PER_BEAD, SEGMENTS_PER_BEAD, bead_pile};
pub use part::sharp_part;
pub use random::{lattice_pile, random_pile};
