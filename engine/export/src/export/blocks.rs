//! Bricks of one level, whatever leaf covers them.

use super::Volume;
use crate::analysis::Block;
use crate::error::{Error, Result};
use crate::lattice::NodeKey;
use crate::store::{BrickTree, NodeInfo};

/// The node at a place of a level: the level's own, or the coarser leaf that covers it. Positions are in bricks of the level.
///
/// # Errors
/// [`Error::Setting`] if the tree has no node there, as an unfinished one may.
pub(super) fn covering(tree: &dyn BrickTree, level: u8, position: [u32; 3]) -> Result<(NodeKey, NodeInfo)> {
    let key = NodeKey::new(level, position);
    let up = (0..=level).rev().filter_map(|level| key?.ancestor(level));
    up.into_iter().find_map(|key| tree.node(key).map(|node| (key, node))).ok_or_else(|| {
        Error::setting(
            "the store has no brick there yet",
            "give the command that builds it again: it goes on",
        )
    })
}

/// The one value of a node's samples, where the index knows it.
pub(super) fn uniform(node: &NodeInfo) -> Option<i16> {
    (node.min == node.max && !node.fractions).then_some(node.min)
}

/// Nodes of a volume's levels that are not uniform.
pub(super) fn mixed(volume: &Volume<'_>) -> u128 {
    let keys = volume.tree.keys().into_iter().filter(|key| volume.levels.contains(&key.level()));
    keys.filter_map(|key| volume.tree.node(key)).filter(|node| uniform(node).is_none()).count() as u128
}

/// Calls `with` with the samples at a place of a level, which are not all the same.
pub(super) fn with_block<T>(
    tree: &dyn BrickTree,
    key: NodeKey,
    level: u8,
    position: [u32; 3],
    with: impl FnOnce(&Block<'_>) -> T,
) -> Result<T> {
    let brick = tree.brick_once(key)?;
    Ok(with(&Block::new(&brick, key, level, position)))
}
