//! The nodes of a tree down to one level whose bricks are made when they are asked for, as of distances.

use crate::brick::{Brick, Hermite, Samples};
use crate::error::Result;
use crate::lattice::{NodeKey, Octant};
use crate::progress::Progress;
use crate::store::{BrickTree, NodeInfo, require_level};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The nodes of such a tree.
pub(super) struct LevelNodes {
    level: u8,
    nodes: BTreeMap<NodeKey, NodeInfo>,
}

impl LevelNodes {
    /// None yet, of a tree down to a level of another one.
    ///
    /// # Errors
    /// If that has no such level.
    pub fn new(tree: &dyn BrickTree, level: u8) -> Result<LevelNodes> {
        require_level(tree, level)?;
        Ok(LevelNodes { level, nodes: BTreeMap::new() })
    }

    /// Divides the root, and what `range` knows no single value of: the least and the greatest sample of a node.
    pub fn divided(
        &self,
        progress: &dyn Progress,
        range: &impl Fn(NodeKey) -> Result<(i16, i16)>,
    ) -> Result<LevelNodes> {
        let mut nodes = BTreeMap::new();
        let mut waiting = vec![NodeKey::ROOT];
        while let Some(key) = waiting.pop() {
            progress.check()?;
            let (min, max) = range(key)?;
            let leaf = min == max || key.level() == self.level;
            nodes.insert(key, NodeInfo { leaf, min, max, fractions: min != max });
            if !leaf {
                waiting.extend(Octant::all().map(|octant| key.child(octant)));
            }
        }
        Ok(LevelNodes { level: self.level, nodes })
    }

    /// See [`BrickTree::node`].
    pub fn node(&self, key: NodeKey) -> Option<NodeInfo> {
        self.nodes.get(&key).copied()
    }

    /// See [`BrickTree::keys`].
    pub fn keys(&self) -> Vec<NodeKey> {
        self.nodes.keys().copied().collect()
    }

    /// All nodes.
    pub fn each(&self) -> impl Iterator<Item = (NodeKey, NodeInfo)> {
        self.nodes.iter().map(|(key, node)| (*key, *node))
    }

    /// A brick whose samples have so many binary places, which `make` makes on the level. Of an interior node all samples are
    /// 0: nothing is drawn of it.
    pub fn brick(
        &self,
        key: NodeKey,
        places: u8,
        make: impl FnOnce() -> Result<Samples>,
    ) -> Result<Arc<Brick>> {
        if let Some(value) = self.node(key).and_then(|node| node.uniform()) {
            return Ok(Arc::new(Brick::Uniform(value)));
        }
        let samples = if key.level() == self.level { make()? } else { Samples::fractions(places) };
        Ok(Arc::new(Brick::Counts { samples, hermite: Hermite::default() }))
    }
}
