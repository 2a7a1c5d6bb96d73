//! What the metadata say of the source's volumes.

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
    /// So many times the quantity.
    pub fn scaled(self, by: f64) -> Estimate {
        Estimate { value: self.value * by, standard_error: self.standard_error * by }
    }

    /// The same with another error, of which `bound` is the most.
    pub fn widened(self, bound: f64) -> Estimate {
        Estimate { standard_error: self.standard_error + bound / 3.0, ..self }
    }

    /// What is printed behind ±: three standard errors, which an error exceeds once in 370 times.
    pub fn bound(self) -> f64 {
        3.0 * self.standard_error
    }
}

/// Volumes of the source of a store, in the cube of its unit, by integrals over the source itself.
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
    /// Of beads as solids, what is known of them without the union.
    pub swept: Option<SweptVolumes>,
    /// The same by layer, from the lowest; empty where there are no layers that lie one above the other.
    pub layers: Vec<LayerVolumes>,
}

/// Volumes of beads, each segment for itself, in mm³; exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SweptVolumes {
    /// Sections times lengths.
    pub sections: f64,
    /// The round ends of the segments, two halves each.
    pub ends: f64,
    /// Material fed, if the toolpath tells for all beads.
    pub fed: Option<f64>,
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

impl SourceVolumes {
    /// Of beads: what the turns and joints within passes cover more than once, round ends included.
    pub fn within_corners(&self) -> Option<Estimate> {
        let SweptVolumes { sections, ends, .. } = self.swept?;
        let (union, overlap) = (self.union, self.overlap);
        // The errors of union and overlap are opposite for the most part, which is left out of account.
        let standard_error = union.standard_error.hypot(overlap.standard_error);
        Some(Estimate { value: sections + ends - union.value - overlap.value, standard_error })
    }

    /// Whether all values are numbers.
    pub(super) fn is_sound(&self) -> bool {
        let of_layers = self.layers.iter().flat_map(|layer| [layer.union, layer.overlap]);
        let estimates = [self.union, self.overlap, self.negative].into_iter().chain(of_layers);
        let mut values = estimates.flat_map(|e| [e.value, e.standard_error]);
        values.all(f64::is_finite) && self.layers.iter().all(|layer| layer.top.is_finite())
    }
}
