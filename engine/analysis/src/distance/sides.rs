//! On which side of the surface a place lies that is not near it: as the nearest sample does.
//!
//! At corners that no cell resolves, the nearest patch may be turned away. Samples are exact.

use crate::brick::Brick;
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey};
use crate::store::{BrickTree, LeafOrder};
use std::sync::Arc;

/// Within so many cells of the surface a sample beside a place tells nothing of it.
pub(super) const FAR: f64 = 1.8;

/// The samples of a tree by place.
pub struct Sides<'a> {
    tree: &'a dyn BrickTree,
    order: LeafOrder,
    level: u8,
}

/// What is known of a brick of the deepest level.
pub(super) enum DeepBrick {
    /// All of it is inside, or outside.
    All(bool),
    Samples(Arc<Brick>),
    /// A coarser leaf that the surface passes.
    Unknown,
}

impl<'a> Sides<'a> {
    /// Of a tree.
    ///
    /// # Errors
    /// If its leaves do not cover the root.
    pub fn new(tree: &'a dyn BrickTree) -> Result<Sides<'a>> {
        Ok(Sides { tree, order: LeafOrder::new(tree)?, level: tree.deepest_level() })
    }

    /// Of the brick of the deepest level whose first sample is this one.
    pub(super) fn part(&self, first: [i64; 3]) -> Result<DeepBrick> {
        let cells = (BRICK_CELLS as i64) << self.level;
        if first.iter().any(|&c| c < 0 || c >= cells) {
            return Ok(DeepBrick::All(false));
        }
        let key = NodeKey::new(self.level, first.map(|c| (c / BRICK_CELLS as i64) as u32));
        let Some(key) = key else { return Ok(DeepBrick::All(false)) };
        let leaf = self.order.keys()[self.order.covering(key)];
        match self.tree.node(leaf).and_then(|node| node.uniform()) {
            Some(w) => Ok(DeepBrick::All(w >= 1)),
            _ if leaf.level() == self.level => Ok(DeepBrick::Samples(self.tree.brick(leaf)?)),
            _ => Ok(DeepBrick::Unknown),
        }
    }

    /// Whether a sample of the deepest lattice is inside; `None` where there is none.
    pub(super) fn sample(&self, sample: [i64; 3]) -> Result<Option<bool>> {
        let size = BRICK_CELLS as i64;
        let within = sample.map(|c| c.rem_euclid(size) as usize);
        let first = std::array::from_fn(|a| sample[a] - within[a] as i64);
        Ok(match self.part(first)? {
            DeepBrick::All(inside) => Some(inside),
            DeepBrick::Samples(brick) => Some(brick.sample(within) >= 1),
            DeepBrick::Unknown => None,
        })
    }

    /// Whether a place, in cells, is inside, as its nearest foot says, or as the nearest sample does where that is far.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub fn inside(&self, at: [f64; 3], distance: f64, says: bool) -> Result<bool> {
        if distance <= FAR {
            return Ok(says);
        }
        Ok(self.sample(at.map(|c| c.round() as i64))?.unwrap_or(says))
    }
}
