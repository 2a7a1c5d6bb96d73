//! Splats of all levels: those of the leaves as these come, and of every node above as soon as its eight children are there.

use super::brick::{CellClusters, cell_of, cells, centre_of};
use super::cluster::{CrossingCluster, of_clusters};
use crate::bsp::{NodeCells, SplatInput};
use crate::error::Result;
use crate::lattice::{NodeKey, RootCube};
use crate::progress::Progress;
use crate::store::{BrickTree, Leaf, LeafOrder, visit};
use std::collections::BTreeMap;

/// What splats are wanted.
#[derive(Clone, Copy, Debug, Default)]
pub struct LevelsOptions {
    /// Cells whose splats are within this distance of all crossings are not divided, in the store's unit.
    pub error: Option<f64>,
    /// Deepest level; `None` for all.
    pub level: Option<u8>,
}

/// The splats of a tree, level by level, in memory: about 30 bytes a splat.
pub struct SplatLevels {
    root: RootCube,
    deepest: u8,
    nodes: BTreeMap<NodeKey, NodeCells<SplatInput>>,
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
    pub fn new(tree: &dyn BrickTree, options: LevelsOptions, progress: &dyn Progress) -> Result<SplatLevels> {
        let order = LeafOrder::new(tree)?;
        progress.phase("making splats", Some(order.keys().len() as u64), "bricks");
        let deepest = tree.deepest_level().min(options.level.unwrap_or(u8::MAX));
        let mut levels = SplatLevels { root: tree.root(), deepest, nodes: BTreeMap::new() };
        let parts = super::cluster::PARTS as f64 / tree.root().unit();
        let tolerance = options.error.map_or(-1.0, |error| error * parts);
        let make = |leaf: &Leaf<'_>| Ok(cells(leaf.key, leaf.brick));
        let mut open = Vec::new();
        visit(tree, order.keys(), progress, make, |number, faces| {
            open.push(OpenNode { key: order.keys()[number], faces });
            levels.close(&mut open, tolerance);
            Ok(())
        })?;
        if let Some(root) = open.pop() {
            levels.keep(root.key, &root.faces);
        }
        Ok(levels)
    }

    /// Merges the last eight nodes as long as they are one node's children.
    fn close(&mut self, open: &mut Vec<OpenNode>, tolerance: f64) {
        while let Some(last) = open.last()
            && last.key.octant().index() == 7
            && let Some(key) = last.key.parent()
        {
            let children = open.split_off(open.len() - 8);
            let faces = parents(key, &children, tolerance, key.level() < self.deepest);
            if key.level() < self.deepest {
                for child in &children {
                    self.keep(child.key, &child.faces);
                }
            }
            open.push(OpenNode { key, faces });
        }
    }

    fn keep(&mut self, key: NodeKey, faces: &[CellClusters]) {
        if faces.is_empty() {
            return;
        }
        let (mut piece, mut wanted) = (NodeCells::new(), Vec::new());
        for face in faces {
            let centre = centre_of(key, face.at);
            wanted.clear();
            wanted.extend(face.clusters.iter().map(|cluster| cluster.wanted(centre, cell_of(key))));
            piece.add(face.at, &wanted, face.clips, face.divided);
        }
        self.nodes.insert(key, piece);
    }

    /// Where the cells lie in the world.
    pub fn root(&self) -> RootCube {
        self.root
    }

    /// The deepest level.
    pub fn deepest(&self) -> u8 {
        self.deepest
    }

    /// The nodes that have splats, level by level, along the Morton curve within a level.
    pub fn nodes(&self) -> &BTreeMap<NodeKey, NodeCells<SplatInput>> {
        &self.nodes
    }
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
