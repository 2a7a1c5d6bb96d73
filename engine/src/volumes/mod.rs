//! Volumes straight from the source, by line integrals: no lattice of samples has a part in them.
//!
//! Lines parallel to z stand at two random positions in each cell of a grid over the part's plan, its *strata* (stratified
//! sampling: Cochran 1977, *Sampling Techniques*, ch. 5). Random numbers are hashes of a stratum's number, so the same input
//! gives the same lines, and no layer height or cell size can be in step with them. What lies on a line is integrated
//! exactly, from the crossings of triangles or the intervals of segments. The two lines of a stratum tell the standard
//! error, without bias. A quantity whose integral is known exactly, the volume of all pieces, is measured beside
//! the others and takes away what they have in common with it (a control variate).
//!
//! The numbers depend on the source alone: not on depth, cell, threads, or memory.

mod beads;
mod estimate;
mod facets;
mod strata;
mod tally;

pub use beads::{BeadVolumes, SweptVolumes, bead_volumes};
pub use facets::facet_volumes;

use serde::{Deserialize, Serialize};

/// An estimated quantity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// The standard deviation of its error; 0 if the value is exact.
    pub standard_error: f64,
}

impl Estimate {
    /// A number that is known.
    pub fn exact(value: f64) -> Estimate {
        Estimate { value, standard_error: 0.0 }
    }

    /// What is printed behind ±: three standard errors, which an error exceeds once in 370 times.
    pub fn bound(self) -> f64 {
        3.0 * self.standard_error
    }
}

/// Volumes of a source, in the cube of its unit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SourceVolumes {
    /// Where w ≥ 1: of the union.
    pub union: Estimate,
    /// ∫ (w − 1) where w ≥ 1: where three pieces lie, it counts twice.
    pub overlap: Estimate,
    /// −∫ w where w < 0: of pieces that are inside out.
    pub negative: Estimate,
    /// How many lines were integrated along.
    pub lines: u64,
    /// The same by layer, from the lowest; empty where there are no layers.
    pub layers: Vec<LayerVolumes>,
}

/// Volumes of one layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LayerVolumes {
    /// Upper end of the layer; its lower end is the one before's upper, or the lowest point.
    pub top: f64,
    /// Where w ≥ 1.
    pub union: Estimate,
    /// ∫ (w − 1) where w ≥ 1.
    pub overlap: Estimate,
}
