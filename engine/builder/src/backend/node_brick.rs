//! What a device made of a node.

use crate::brick::{Brick, Hermite, Samples};

/// What a device made of a node.
#[derive(Clone, Debug)]
pub struct NodeBrick {
    /// The node's samples.
    pub samples: Samples,
    /// Its Hermite edges; `None` if all samples are equal.
    pub hermite: Option<Hermite>,
    /// Crossings of triangles with its lattice edges.
    pub crossings: u32,
}

impl NodeBrick {
    pub(super) fn new(brick: Brick, crossings: u32) -> NodeBrick {
        match brick {
            Brick::Uniform(w) => NodeBrick { samples: Samples::filled(w), hermite: None, crossings },
            Brick::Counts { samples, hermite } => NodeBrick { samples, hermite: Some(hermite), crossings },
        }
    }

    /// Whether an edge holds crossings where the winding number rises and some where it falls. The samples at its ends
    /// differ by the sum of the jumps of 1 at its crossings: by as many as there are if all go one way, and by fewer if not.
    pub fn has_hidden_crossings(&self) -> bool {
        self.samples.variation() != u64::from(self.crossings)
    }

    /// Whether something may lie between its samples: crossings that cancel, or, where all samples are equal, something that
    /// has no crossing.
    pub fn may_hide(&self) -> bool {
        self.hermite.is_none() || self.has_hidden_crossings()
    }

    /// Whether the node as a leaf would be this brick.
    pub(super) fn is_brick(&self, brick: &Brick) -> bool {
        match (brick, &self.hermite) {
            (Brick::Uniform(w), None) => self.samples.0[0] == *w,
            (Brick::Counts { samples, hermite }, Some(found)) => *samples == self.samples && hermite == found,
            _ => false,
        }
    }

    /// The node as a leaf.
    pub fn into_leaf(self) -> Brick {
        match self.hermite {
            Some(hermite) => Brick::Counts { samples: self.samples, hermite },
            None => Brick::Uniform(self.samples.0[0]),
        }
    }
}
