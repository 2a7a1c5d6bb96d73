//! What is learnt while units are coded.

use super::mixing::{ContextMixer, Logistic};
use crate::range::{Bit, NumberModel};

/// Distances of a plane from the middle of a cell fall into so many classes.
pub const BINS: usize = 48;
/// A class of its own where there is no plane.
pub const NO_BIN: usize = BINS;
/// Classes of distances where they are few.
pub const COARSE_BINS: usize = 17;
/// Contexts whose opinions on whether a cell has splats are mixed.
pub const OPINIONS: usize = 6;
/// Normals that may be taken over as they are.
pub const CANDIDATES_MAX: usize = 6;
/// Classes of how far the neighbours' normals are apart.
pub const SPREADS: usize = 6;

/// The state of coding. Each unit begins with the one at the end of the head.
#[derive(Clone)]
pub struct Model {
    pub(super) logistic: Logistic,
    pub(super) occupied: ContextMixer<OPINIONS>,
    pub(super) divided: [Bit; 4],
    pub(super) more: [[Bit; 4]; 3],
    pub(super) third: [Bit; 4],
    pub(super) same: Vec<Bit>,
    pub(super) residuals: [[NumberModel; SPREADS]; 3],
    pub(super) below: [Bit; SPREADS],
    pub(super) offsets: [NumberModel; 6],
    pub(super) clipped: [Bit; 2],
    pub(super) convex: [Bit; 3],
}

impl Model {
    /// Nothing is known yet.
    pub fn new() -> Model {
        let sizes = [
            (BINS + 1) * 32,
            (BINS + 1) * 4 * 2,
            64 * 8,
            128 * 8,
            COARSE_BINS * COARSE_BINS * 8,
            (BINS + 1) * 8,
        ];
        Model {
            logistic: Logistic::new(),
            occupied: ContextMixer::new(sizes, 16),
            divided: [Bit::NEW; 4],
            more: [[Bit::NEW; 4]; 3],
            third: [Bit::NEW; 4],
            same: vec![Bit::NEW; CANDIDATES_MAX * 2 * 5 * 3],
            residuals: [0; 3].map(|_| [0; SPREADS].map(|_| NumberModel::NEW)),
            below: [Bit::NEW; SPREADS],
            offsets: [0; 6].map(|_| NumberModel::NEW),
            clipped: [Bit::NEW; 2],
            convex: [Bit::NEW; 3],
        }
    }

    /// For the beginning of a unit elsewhere.
    pub fn elsewhere(&self) -> Model {
        let mut model = self.clone();
        model.occupied.forget();
        model
    }
}

impl Default for Model {
    fn default() -> Model {
        Model::new()
    }
}
