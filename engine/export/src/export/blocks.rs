//! Bricks of one level, whatever leaf covers them.

use super::Volume;
use crate::analysis::BrickBlock;
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::store::BrickTree;

/// Nodes of a volume's levels that are not uniform.
pub(super) fn mixed(volume: &Volume<'_>) -> u128 {
    let keys = volume.tree.keys().into_iter().filter(|key| volume.levels.contains(&key.level()));
    keys.filter_map(|key| volume.tree.node(key)).filter(|node| node.uniform().is_none()).count() as u128
}

/// Calls `with` with the samples at a place of a level, which are not all the same.
pub(super) fn with_block<T>(
    tree: &dyn BrickTree,
    key: NodeKey,
    level: u8,
    position: [u32; 3],
    with: impl FnOnce(&BrickBlock<'_>) -> T,
) -> Result<T> {
    let brick = tree.brick_once(key)?;
    Ok(with(&BrickBlock::new(&brick, key, level, position)))
}
