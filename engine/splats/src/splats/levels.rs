//! Splats of all levels: those of the leaves as these come, and of every node above as soon as its eight children are there.

use super::brick::{CellClusters, cell_of, cells, centre_of};
use super::cluster::{CrossingCluster, of_clusters};
use super::spilled::SpilledNodes;
use crate::bsp::{NodeCells, SplatInput};
use crate::error::Result;
use crate::lattice::{NodeKey, RootCube};
use crate::progress::Progress;
use crate::store::{BrickTree, Leaf, LeafOrder, visit_siblings};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

/// What splats are wanted.
#[derive(Clone, Copy, Debug, Default)]
pub struct LevelsOptions<'a> {
    /// Cells whose splats are within this distance of all crossings are not divided, in the store's unit.
    pub error: Option<f64>,
    /// Deepest level; `None` for all.
    pub level: Option<u8>,
    /// Whether splats of no level but the deepest are wanted, and of leaves above it.
    pub finest_only: bool,
    /// Bytes for splats, beyond which those of the deepest level go to a temporary file in a folder; `None` for any number.
    pub memory: Option<(u64, &'a Path)>,
}

/// The splats of a tree, level by level: about 30 bytes a splat, in memory but for what [`LevelsOptions::memory`] says.
pub struct SplatLevels {
    root: RootCube,
    deepest: u8,
    /// Whether cells may lie below others that are not divided.
    is_pruned: bool,
    nodes: BTreeMap<NodeKey, NodeCells<SplatInput>>,
    /// Nodes of the deepest level that did not fit. They come behind the others of that level.
    spilled: Option<SpilledNodes>,
    /// Bytes of nodes in memory.
    bytes: u64,
}

/// A node whose parent is still to be made.
struct OpenNode {
    key: NodeKey,
    faces: Vec<CellClusters>,
}

impl SplatLevels {
    /// Makes the splats of a tree. Leaves are read once, in Morton order.
    ///
    /// # Errors
    /// What reading the tree gives; [`crate::error::Error::Interrupted`].
    pub fn new(
        tree: &dyn BrickTree,
        options: LevelsOptions<'_>,
        progress: &dyn Progress,
    ) -> Result<SplatLevels> {
        let order = LeafOrder::new(tree)?;
        progress.phase("making splats", Some(order.keys().len() as u64), "bricks");
        let deepest = tree.deepest_level().min(options.level.unwrap_or(u8::MAX));
        let mut levels = SplatLevels {
            root: tree.root(),
            deepest,
            is_pruned: options.error.is_some(),
            nodes: BTreeMap::new(),
            spilled: options.memory.map(|(most, folder)| SpilledNodes::new(most, folder)),
            bytes: 0,
        };
        let parts = super::cluster::PARTS as f64 / tree.root().unit();
        let tolerance = options.error.map_or(-1.0, |error| error * parts);
        let merging = LevelMerging { tolerance, deepest, finest_only: options.finest_only };
        let make = |leaf: &Leaf<'_>| Ok(cells(leaf.key, leaf.brick));
        // Leaves are merged on all threads, what lies above them as it comes.
        let join = |keys: &[NodeKey], faces: Vec<Vec<CellClusters>>| {
            let mut nodes: Vec<OpenNode> =
                keys.iter().zip(faces).map(|(&key, faces)| OpenNode { key, faces }).collect();
            Ok(match nodes[0].key.parent() {
                Some(key) if nodes.len() == 8 => merging.merged(key, &nodes),
                _ => (nodes.swap_remove(0), Vec::new()),
            })
        };
        let mut open = Vec::new();
        let take = |_, (node, kept): (OpenNode, Vec<(NodeKey, NodeCells<SplatInput>)>)| {
            kept.into_iter().try_for_each(|(key, cells)| levels.keep(key, cells))?;
            open.push(node);
            levels.close(&mut open, merging)
        };
        visit_siblings(tree, &order, progress, make, join, take)?;
        if let Some(root) = open.pop() {
            levels.keep(root.key, as_written(&root))?;
        }
        Ok(levels)
    }

    /// Merges the last eight nodes as long as they are one node's children.
    fn close(&mut self, open: &mut Vec<OpenNode>, merging: LevelMerging) -> Result<()> {
        while let Some(last) = open.last()
            && last.key.octant().index() == 7
            && let Some(key) = last.key.parent()
        {
            let children = open.split_off(open.len() - 8);
            let (node, kept) = merging.merged(key, &children);
            kept.into_iter().try_for_each(|(key, cells)| self.keep(key, cells))?;
            open.push(node);
        }
        Ok(())
    }

    fn keep(&mut self, key: NodeKey, piece: NodeCells<SplatInput>) -> Result<()> {
        if piece.cells.is_empty() {
            return Ok(());
        }
        if let Some(spilled) = &mut self.spilled
            && key.level() == self.deepest
            && spilled.takes(self.bytes)
        {
            return spilled.add(key, &piece);
        }
        self.bytes += (size_of_val(&*piece.cells) + size_of_val(&*piece.splats)) as u64;
        self.nodes.insert(key, piece);
        Ok(())
    }

    /// Where the cells lie in the world.
    pub fn root(&self) -> RootCube {
        self.root
    }

    /// The deepest level.
    pub fn deepest(&self) -> u8 {
        self.deepest
    }

    /// How many nodes have splats.
    pub fn len(&self) -> usize {
        self.nodes.len() + self.spilled.as_ref().map_or(0, SpilledNodes::len)
    }

    /// Whether there are no splats.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The splats of a node above the deepest level, which is in memory.
    pub(super) fn above_deepest(&self, key: NodeKey) -> Option<&NodeCells<SplatInput>> {
        self.nodes.get(&key)
    }

    /// Whether cells may lie below others that are not divided.
    pub(super) fn is_pruned(&self) -> bool {
        self.is_pruned
    }

    /// Nodes in memory, level by level, along the Morton curve within a level.
    pub(super) fn in_memory(&self) -> &BTreeMap<NodeKey, NodeCells<SplatInput>> {
        &self.nodes
    }

    /// Calls `each` with the nodes that are not in memory, which come behind the others.
    pub(super) fn each_spilled(
        &self,
        each: impl FnMut(NodeKey, &NodeCells<SplatInput>) -> Result<()>,
    ) -> Result<()> {
        self.spilled.as_ref().map_or(Ok(()), |spilled| spilled.each(each))
    }

    /// The splats of a node, if it has some.
    ///
    /// # Errors
    /// If a temporary file cannot be read.
    pub fn node(&self, key: NodeKey) -> Result<Option<Cow<'_, NodeCells<SplatInput>>>> {
        if let Some(node) = self.nodes.get(&key) {
            return Ok(Some(Cow::Borrowed(node)));
        }
        match &self.spilled {
            Some(spilled) => Ok(spilled.get(key)?.map(Cow::Owned)),
            None => Ok(None),
        }
    }

    /// Calls `each` with the nodes that have splats, level by level, along the Morton curve within a level.
    ///
    /// # Errors
    /// As [`SplatLevels::node`], and what `each` gives.
    pub fn each_node(
        &self,
        mut each: impl FnMut(NodeKey, &NodeCells<SplatInput>) -> Result<()>,
    ) -> Result<()> {
        self.nodes.iter().try_for_each(|(key, node)| each(*key, node))?;
        self.each_spilled(each)
    }
}

/// How nodes are made of their children.
#[derive(Clone, Copy)]
struct LevelMerging {
    tolerance: f64,
    deepest: u8,
    finest_only: bool,
}

impl LevelMerging {
    /// A node from its eight children, and the children as they are written where they are not too deep.
    fn merged(
        self,
        key: NodeKey,
        children: &[OpenNode],
    ) -> (OpenNode, Vec<(NodeKey, NodeCells<SplatInput>)>) {
        let is_above = key.level() < self.deepest;
        let faces = match is_above && self.finest_only {
            true => Vec::new(),
            false => parents(key, children, self.tolerance, is_above),
        };
        let kept = if is_above { children } else { &[] };
        (OpenNode { key, faces }, kept.iter().map(|child| (child.key, as_written(child))).collect())
    }
}

/// The cells of a node as they are written.
fn as_written(node: &OpenNode) -> NodeCells<SplatInput> {
    let (mut piece, mut wanted) = (NodeCells::new(), Vec::new());
    for face in &node.faces {
        let centre = centre_of(node.key, face.at);
        wanted.clear();
        wanted.extend(face.clusters.iter().map(|cluster| cluster.wanted(centre, cell_of(node.key))));
        piece.add(face.at, &wanted, face.clips, face.divided);
    }
    piece
}

/// The cells of a node from those of its children.
fn parents(key: NodeKey, children: &[OpenNode], tolerance: f64, may_divide: bool) -> Vec<CellClusters> {
    // Sorted by the parent's cell, then by octant.
    let mut parts: Vec<(u16, &CellClusters)> = Vec::new();
    for child in children {
        let offset = child.key.octant().offset();
        for faces in &child.faces {
            let at: [u16; 3] = std::array::from_fn(|a| u16::from(faces.at[a] / 2) + 16 * offset[a] as u16);
            parts.push((at[2] << 10 | at[1] << 5 | at[0], faces));
        }
    }
    parts.sort_by_key(|(place, faces)| (*place, faces.at.map(|c| c & 1)));
    let mut found = Vec::new();
    for group in parts.chunk_by(|a, b| a.0 == b.0) {
        let place = group[0].0;
        let clusters: Vec<CrossingCluster> =
            group.iter().flat_map(|(_, faces)| faces.clusters.iter().copied()).collect();
        let (clusters, clips) = of_clusters(&clusters, cell_of(key));
        let is_rough = clusters.iter().any(|cluster| cluster.error() > tolerance);
        let at = [place & 31, place >> 5 & 31, place >> 10].map(|c| c as u8);
        found.push(CellClusters { at, clusters, clips, divided: may_divide && is_rough });
    }
    found
}
