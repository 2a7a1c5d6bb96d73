//! Where nodes lie in the world.

use crate::lattice::{BRICK_CELLS, MAX_LEVEL, NodeKey, RootCube};
use crate::store::BrickTree;

/// World positions of a node's first sample and of its last, the apron's; its cells lie between.
pub fn corners(key: NodeKey, root: &RootCube) -> [[f64; 3]; 2] {
    cells_in_units(key).map(|corner| root.to_world(corner))
}

/// Whether a cell of a node and a closed box of the world, given by its least and greatest coordinates, share a point.
pub fn meets_box(key: NodeKey, root: &RootCube, corners: [[f64; 3]; 2]) -> bool {
    let ([low, high], [min, max]) = (cells_in_units(key), corners.map(|corner| root.to_units(corner)));
    (0..3).all(|a| low[a] <= max[a] && high[a] >= min[a])
}

/// The leaf whose cells hold a point of the world, the one that `sample_at` of the crate for analyses takes, or the node there
/// of level `deepest`; `None` outside the root, and where a shard or an unfinished store has none.
pub fn node_at(tree: &dyn BrickTree, point: [f64; 3], deepest: Option<u8>) -> Option<NodeKey> {
    let finest = NodeKey::deepest_holding(tree.root().from_first_sample(point))?;
    let keys = (0..=deepest.unwrap_or(MAX_LEVEL)).filter_map(|level| finest.ancestor(level));
    keys.filter(|key| tree.node(*key).is_some()).last()
}

/// From a node's first sample, one unit above its base, to its last.
fn cells_in_units(key: NodeKey) -> [[f64; 3]; 2] {
    let side = f64::from(1u32 << key.spacing_bits()) * BRICK_CELLS as f64;
    let low = key.base().map(|b| f64::from(b) + 1.0);
    [low, low.map(|c| c + side)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::Brick;
    use crate::lattice::Octant;
    use crate::store::MemoryTree;

    #[test]
    fn points_are_in_the_cells_of_their_node() {
        let root = RootCube { origin: [-3.0, 10.0, 0.0], edge: 7.0 };
        let mut tree = MemoryTree::new(root);
        tree.insert(NodeKey::ROOT, false, Brick::Uniform(0));
        Octant::all().for_each(|o| tree.insert(NodeKey::ROOT.child(o), true, Brick::Uniform(0)));
        for octant in Octant::all() {
            let key = NodeKey::ROOT.child(octant);
            let [low, high] = corners(key, &root);
            let middle = [0, 1, 2].map(|a| (low[a] + high[a]) / 2.0);
            assert_eq!(node_at(&tree, middle, None), Some(key));
            assert_eq!(node_at(&tree, middle, Some(0)), Some(NodeKey::ROOT));
            assert!(meets_box(key, &root, [middle; 2]));
            for other in Octant::all().filter(|other| *other != octant) {
                assert!(!meets_box(NodeKey::ROOT.child(other), &root, [middle; 2]));
            }
        }
        // The first sample of the upper half, having gone through the world and decimal places.
        let key = NodeKey::ROOT.child(Octant::all().last().unwrap());
        let [low, _] = corners(key, &root);
        for digits in 10..17 {
            let point = low.map(|c| format!("{c:.digits$}").parse().unwrap());
            assert_eq!(node_at(&tree, point, None), Some(key), "{digits}");
        }
        for outside in [[-3.1, 11.0, 1.0], [0.0, 17.1, 1.0], [f64::NAN; 3]] {
            assert_eq!(node_at(&tree, outside, None), None);
        }
    }
}
