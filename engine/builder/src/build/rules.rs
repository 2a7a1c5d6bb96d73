//! When a node of the tree is kept as a leaf.

use super::field::{BrickEvaluation, Fractions, PieceField};
use super::fit::MeshTolerance;
use crate::brick::{Samples, SignChanges, ThinFeatures, ThinLines};
use crate::error::{Error, Result};
use crate::lattice::{BRICK_CELLS, MAX_LEVEL, RootCube};
use crate::store::{Compression, Meta, Refine};

/// How deep and where the tree is refined, as asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TreeOptions {
    /// Level of the deepest bricks: 32·2^depth cells along the root's edge.
    pub depth: u8,
    /// The criterion above the depth limit. One of thin walls has no deviation and no tolerance beside it.
    pub refine: Refine,
    /// A node whose samples deviate no more than this may be kept as a leaf; 0 keeps uniform ones only.
    pub stddev: f64,
    /// A node may be kept as a leaf, too, if the boundary below it is no farther than this from the mesh made of it, in the
    /// unit of the input; 0 asks nothing. Of closed soups, with [`Refine::Hidden`] and without a deviation only.
    pub tolerance: f64,
}

/// [`TreeOptions`], checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rules {
    /// Level to which nodes are divided by the criterion.
    pub depth: u8,
    /// Level to which nodes are divided where walls or gaps hide; [`Rules::depth`] if that makes no difference.
    pub deepest: u8,
    /// The criterion down to [`Rules::depth`].
    pub refine: Refine,
    pub stddev: f64,
    /// How far the boundary may be from the mesh of a leaf above the depth limit.
    pub tolerance: Option<MeshTolerance>,
    /// How payloads are stored; `None` for a tree in memory.
    pub compression: Option<Compression>,
    /// Evaluate every node from its pieces even where its children would give its samples: for fields that
    /// change where no piece is, and for tests.
    pub evaluate_interior: bool,
}

/// What has no tolerance.
pub(super) const OPEN: &str = "of open ones";
pub(super) const POINTS: &str = "points of clouds";
pub(super) const SOLIDS: &str = "beads as solids";

/// Fails if there is a tolerance, of a field whose Hermite data are not all that is known of its boundary.
pub(super) fn require_no_tolerance(tolerance: f64, of: &str) -> Result<()> {
    if tolerance == 0.0 {
        return Ok(());
    }
    Err(Error::setting(
        format!("a tolerance is measured against the facets of closed meshes, and not {of}"),
        "leave `boundary_error` out; `contour::tolerance` merges triangles where the surface is flat",
    ))
}

impl Rules {
    /// For the tree in `root`.
    pub fn new(options: TreeOptions, root: RootCube) -> Result<Rules> {
        let TreeOptions { depth, refine, stddev, tolerance } = options;
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
        if !(tolerance >= 0.0 && tolerance.is_finite()) {
            return Err(Error::setting(
                format!("no surface can be within {tolerance}"),
                "choose a length, or 0",
            ));
        }
        if let Refine::Thin { base } = refine {
            if base > depth {
                return Err(Error::setting(
                    format!("a depth of {depth} for thin walls is less than that of all else, {base}"),
                    "choose a larger one, or leave it out",
                ));
            }
            if stddev != 0.0 || tolerance > 0.0 {
                return Err(Error::setting(
                    "a greater depth for thin walls goes together neither with a standard deviation nor with a tolerance",
                    "leave one of them out",
                ));
            }
        }
        if tolerance > 0.0 && (refine != Refine::Hidden || stddev != 0.0) {
            return Err(Error::setting(
                "a tolerance holds only where nothing else keeps bricks undivided",
                "leave it out, or the standard deviation and another criterion than hidden",
            ));
        }
        let tolerance = (tolerance > 0.0).then(|| MeshTolerance::new(tolerance, root));
        let (base, refine) = match refine {
            Refine::Thin { base } => (base, Refine::Hidden),
            refine => (depth, refine),
        };
        Ok(Rules {
            depth: base,
            deepest: depth,
            refine,
            stddev,
            tolerance,
            compression: Some(Compression::Lz4),
            evaluate_interior: false,
        })
    }

    /// Those of the store that `meta` tells of.
    pub fn of(meta: &Meta) -> Result<Rules> {
        let Meta { depth, refine, stddev, tolerance, root, .. } = *meta;
        Rules::new(TreeOptions { depth, refine, stddev, tolerance: tolerance.unwrap_or(0.0) }, root)
    }

    /// True if every node that a piece touches is refined down to [`Rules::depth`], whatever its samples.
    pub fn refines_all_touched(&self) -> bool {
        self.refine == Refine::Hidden
            && self.stddev == 0.0
            && self.tolerance.is_none()
            && !self.evaluate_interior
    }

    /// What hides in a leaf of a level, or in a node that is to be one, where that matters.
    pub fn thin_of<F: PieceField>(
        &self,
        field: &F,
        level: u8,
        evaluation: &mut impl BrickEvaluation,
    ) -> Result<ThinFeatures> {
        if (self.depth..self.deepest).contains(&level) {
            evaluation.thin(ThinLines::All)
        } else if self.deepest > self.depth || field.may_hide_walls(level) {
            evaluation.thin(ThinLines::Sixteenth)
        } else {
            Ok(ThinFeatures::default())
        }
    }

    /// Whether a node at [`Rules::depth`] or below is divided for what is thin in it: what hides, and what has samples that
    /// meet at corners only.
    pub fn divides_thin(&self, level: u8, thin: &ThinFeatures, evaluation: &impl BrickEvaluation) -> bool {
        level < self.deepest && (!thin.is_empty() || evaluation.has_ambiguous_face())
    }

    /// The level of the lattice on which triangles must show, or may be left out; `None` where what they are measured
    /// against may be any of them.
    pub fn sieved(&self) -> Option<u8> {
        self.tolerance.is_none().then_some(self.deepest)
    }

    /// Whether a touched node above the depth limit is kept as a leaf.
    pub fn keeps(&self, evaluation: &mut impl BrickEvaluation) -> bool {
        if let Some(fractions) = evaluation.fractions() {
            return self.keeps_fractions(evaluation, fractions);
        }
        match self.refine {
            Refine::Stddev => self.varies_little(scaled_variance(evaluation.samples())),
            Refine::Hidden | Refine::Thin { .. } => {
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
    fn keeps_fractions(&self, evaluation: &mut impl BrickEvaluation, fractions: Fractions) -> bool {
        // Samples are counted in quanta.
        let quanta = Rules { stddev: self.stddev * f64::from(1u32 << fractions.bits), ..*self };
        let varies_little = quanta.varies_little(scaled_variance(evaluation.samples()));
        match self.refine {
            Refine::Stddev => varies_little,
            Refine::Hidden | Refine::Thin { .. } => {
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
