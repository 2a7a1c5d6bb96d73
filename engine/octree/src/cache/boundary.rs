//! Signs and Hermite edges of nodes that become leaves.

use crate::brick::{Brick, Hermite, SignChanges};
use crate::error::{Error, Result};
use crate::lattice::{NodeKey, Octant};
use crate::store::{BrickTree, NodeInfo, Store};

/// Signs and Hermite edges of a node, those of an interior one from its children's; `None` if no sample, or every one, is
/// inside. At most eight nodes of each level are held.
pub(super) fn boundary(tree: &Store, key: NodeKey) -> Option<Result<(SignChanges, Hermite)>> {
    let info = tree.node(key)?;
    (info.min < 1 && info.max >= 1).then(|| boundary_of(tree, key, info))
}

fn boundary_of(tree: &Store, key: NodeKey, info: NodeInfo) -> Result<(SignChanges, Hermite)> {
    let brick = tree.brick(key)?;
    let Brick::Counts { samples, hermite } = &*brick else { return Err(broken(tree, key)) };
    let signs = SignChanges::of(samples);
    let hermite = if info.leaf {
        let is_complete = hermite.edges.each_ref().map(Vec::len) == signs.counts();
        is_complete.then(|| hermite.clone())
    } else {
        let mut children = [const { None }; 8];
        for (octant, child) in Octant::all().zip(&mut children) {
            *child = boundary(tree, key.child(octant)).transpose()?;
        }
        Hermite::from_children(&signs, &children)
    };
    let hermite = hermite.ok_or_else(|| broken(tree, key))?;
    Ok((signs, hermite))
}

/// The error of a record that cannot be.
pub(super) fn broken(tree: &Store, key: NodeKey) -> Error {
    let what = "it contradicts the nodes around it";
    let remedy = "check the store with `brickfield verify`; restore it from a copy or build it again";
    Error::store(tree.path(), format!("record {key}"), what, remedy)
}
