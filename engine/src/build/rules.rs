//! When a node of the tree is kept as a leaf.

use super::field::{Evaluated, Fractions};
use crate::brick::{Samples, SignChanges};
use crate::error::{Error, Result};
use crate::lattice::{BRICK_CELLS, MAX_LEVEL};
use crate::store::{Compression, Refine};

/// How deep and where the tree is refined, as asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TreeOptions {
    /// Level of the deepest bricks: 32·2^depth cells along the root's edge.
    pub depth: u8,
    /// The criterion above the depth limit.
    pub refine: Refine,
    /// A node whose samples deviate no more than this may be kept as a leaf; 0 keeps uniform ones only.
    pub stddev: f64,
}

/// [`TreeOptions`], checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rules {
    pub depth: u8,
    pub refine: Refine,
    pub stddev: f64,
    /// How payloads are stored.
    pub compression: Compression,
    /// Evaluate every node from its pieces even where its children would give its samples: for fields that
    /// change where no piece is, and for tests.
    pub evaluate_interior: bool,
}

impl Rules {
    pub fn new(options: TreeOptions) -> Result<Rules> {
        let TreeOptions { depth, refine, stddev } = options;
        if depth > MAX_LEVEL {
            return Err(Error::setting(
                format!("depth {depth} is beyond the lattice"),
                format!("use a depth of at most {MAX_LEVEL}"),
            ));
        }
        if !(stddev >= 0.0 && stddev.is_finite()) {
            return Err(Error::setting(
                format!("{stddev} is no standard deviation"),
                "use a threshold of 0 or more",
            ));
        }
        Ok(Rules { depth, refine, stddev, compression: Compression::Lz4, evaluate_interior: false })
    }

    /// True if every node that a piece touches is refined down to the depth limit, whatever its samples.
    pub fn refines_all_touched(&self) -> bool {
        self.refine == Refine::Hidden && self.stddev == 0.0 && !self.evaluate_interior
    }

    /// Whether a touched node above the depth limit is kept as a leaf.
    pub fn keeps(&self, evaluation: &mut impl Evaluated) -> bool {
        if let Some(fractions) = evaluation.fractions() {
            return self.keeps_fractions(evaluation, fractions);
        }
        match self.refine {
            Refine::Stddev => self.varies_little(scaled_variance(evaluation.samples())),
            Refine::Hidden => {
                let variance = scaled_variance(evaluation.samples());
                // A variance of 0 says that what touches the node is hidden.
                variance > 0 && self.varies_little(variance) && !evaluation.has_hidden_crossings()
            }
            Refine::Surface => {
                let inside = i128::from(inside_samples(evaluation.samples()));
                self.varies_little(N * inside - inside * inside) && !evaluation.has_hidden_boundary()
            }
        }
    }

    /// Whether a node of a field that changes everywhere is kept.
    fn keeps_fractions(&self, evaluation: &mut impl Evaluated, fractions: Fractions) -> bool {
        // Samples are counted in quanta.
        let quanta = Rules { stddev: self.stddev * f64::from(1u32 << fractions.bits), ..*self };
        let varies_little = quanta.varies_little(scaled_variance(evaluation.samples()));
        match self.refine {
            Refine::Stddev => varies_little,
            Refine::Hidden => {
                !evaluation.has_hidden_crossings()
                    && (fractions.straight || (self.stddev > 0.0 && varies_little))
            }
            Refine::Surface => {
                let changes = SignChanges::of(evaluation.samples()).counts() != [0; 3];
                !changes && !evaluation.has_hidden_boundary()
            }
        }
    }

    /// Compares a variance times N² with the threshold; it is an exact integer, so every backend decides
    /// alike.
    fn varies_little(&self, scaled_variance: i128) -> bool {
        let scaled_threshold = self.stddev * N as f64;
        scaled_variance as f64 <= scaled_threshold * scaled_threshold
    }
}

/// Number of owned samples.
const N: i128 = (BRICK_CELLS * BRICK_CELLS * BRICK_CELLS) as i128;

/// The variance of the owned samples times N².
fn scaled_variance(samples: &Samples) -> i128 {
    let (sum, squares) = samples.moments();
    N * i128::from(squares) - i128::from(sum) * i128::from(sum)
}

fn inside_samples(samples: &Samples) -> u64 {
    let mut inside = 0;
    samples.for_owned_rows(|row| inside += row.iter().filter(|&&w| w >= 1).count() as u64);
    inside
}
