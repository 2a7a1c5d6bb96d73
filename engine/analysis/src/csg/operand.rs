//! Operands: stores, and solids that need no file.

use super::chain::OperandState;
use crate::brick::Brick;
use crate::error::{Error, Result};
use crate::lattice::NodeKey;
use crate::store::{BrickTree, Refine, Store};
use crate::swept::{SweptEvaluator, SweptSolid, WantedSamples};
use std::sync::Arc;

/// An operand of a chain.
pub enum Operand<'a> {
    /// A store, whose samples are clamped to 0 and 1.
    Store(&'a Store),
    /// The union of solids.
    Solids(&'a [SweptSolid]),
}

/// What an operand is within a node, and what is needed to look further down.
#[derive(Clone)]
pub(super) enum OperandInNode {
    /// All of it is inside, or nothing.
    All {
        /// Of stores the sample itself.
        w: i16,
        certain: bool,
    },
    /// A node of a store: a leaf with a boundary, or an interior node.
    Leaf,
    Divided,
    /// Solids that touch it.
    Solids(Arc<[u32]>),
    /// Whatever it is, it decides nothing.
    Ignored,
}

impl OperandInNode {
    pub fn known(&self) -> OperandState {
        match self {
            OperandInNode::All { w, certain } => OperandState::All { inside: *w >= 1, certain: *certain },
            OperandInNode::Ignored => OperandState::All { inside: false, certain: true },
            _ => OperandState::Mixed,
        }
    }
}

impl<'a> Operand<'a> {
    /// What it is within the root, before that is looked at.
    pub(super) fn beginning(&self) -> OperandInNode {
        match self {
            Operand::Store(_) => OperandInNode::Divided,
            Operand::Solids(solids) => OperandInNode::Solids((0..solids.len() as u32).collect()),
        }
    }

    /// What it is within a node, of whose parent, or of itself, this is known.
    /// With `counts` samples that differ are told apart, even where all are inside.
    pub(super) fn look(&self, key: NodeKey, above: &OperandInNode, counts: bool) -> Result<OperandInNode> {
        match (self, above) {
            (_, OperandInNode::All { .. } | OperandInNode::Ignored) => Ok(above.clone()),
            (Operand::Store(store), _) => {
                let node = store.entry(key).ok_or_else(|| broken(store, key))?;
                if !node.leaf {
                    return Ok(OperandInNode::Divided);
                }
                if (node.head.min < 1 && node.head.max >= 1) || (counts && node.head.min < node.head.max) {
                    return Ok(OperandInNode::Leaf);
                }
                // Above the depth of a build that divides all that facets touch, nothing hides.
                let is_followed = matches!(store.meta().refine, Refine::Hidden | Refine::Surface);
                let certain = is_followed && key.level() < store.meta().depth;
                Ok(OperandInNode::All { w: node.head.max, certain })
            }
            (Operand::Solids(solids), OperandInNode::Solids(list)) => {
                // Whether a short solid meets the node is asked of one alone: which of them are listed changes no brick.
                let may_meet = |&&number: &&u32| solids[number as usize].may_meet(key);
                let near: Vec<u32> = list.iter().filter(may_meet).copied().collect();
                let all = |w| Ok(OperandInNode::All { w, certain: true });
                if near.iter().all(|&number| solids[number as usize].misses(key)) {
                    return all(0);
                }
                match near.iter().any(|&number| solids[number as usize].covers(key)) {
                    true => all(1),
                    false => Ok(OperandInNode::Solids(near.into())),
                }
            }
            (Operand::Solids(_), _) => Ok(above.clone()),
        }
    }

    /// The brick of a leaf, or of solids within any node; of these the wanted samples.
    pub(super) fn brick(
        &self,
        key: NodeKey,
        within: &OperandInNode,
        (evaluator, wanted): (&mut SweptEvaluator, &WantedSamples),
    ) -> Result<Brick> {
        Ok(match (self, within) {
            (_, OperandInNode::All { w, .. }) => Brick::Uniform(*w),
            (Operand::Store(store), OperandInNode::Leaf) => {
                let brick = store.brick_once(key)?;
                Arc::try_unwrap(brick).unwrap_or_else(|shared| Brick::clone(&shared))
            }
            (Operand::Solids(solids), OperandInNode::Solids(list)) => {
                evaluator.brick(key, solids, list, wanted)
            }
            _ => Brick::Uniform(0),
        })
    }
}

fn broken(store: &Store, key: NodeKey) -> Error {
    let what = "the tree lacks this node";
    Error::store(store.path(), format!("record {key}"), what, "check the store with `brickfield verify`")
}
