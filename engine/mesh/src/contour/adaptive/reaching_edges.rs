//! Which edges of a leaf have triangles that reach into the cube of another leaf.

use super::super::field::LevelSet;
use super::bounds::Bounds;
use super::cross_leaf::CrossLeafMerges;
use super::edge_box::{EdgeBox, common};
use super::edge_filter::EdgesNear;
use crate::lattice::{BRICK_CELLS, NodeKey};

/// Edges of a leaf about which are all its triangles that reach into the cube of another one that it touches: those in some
/// boxes, and those with an end in another box.
pub(super) fn edges_beside(
    field: &LevelSet,
    across: &CrossLeafMerges,
    (leaf, cube): (u32, &Bounds),
    other: u32,
) -> Option<(Vec<EdgeBox>, Option<EdgeBox>)> {
    // About an edge on its border, or next to one where a vertex has strayed.
    let beside = EdgesNear::of(field, other).within(cube, 1)?;
    let [own, there] = [leaf, other].map(|leaf| field.leaves.get(leaf).key);
    if own.level() != there.level() || field.levels_up(other) > 0 {
        return Some((vec![beside], None));
    }
    let near = across.strays().of(other).iter().filter_map(|edges| common(edges, &beside));
    Some((near.collect(), shared(own, there)))
}

/// The samples of a leaf that another one of its level has, too.
fn shared(own: NodeKey, other: NodeKey) -> Option<EdgeBox> {
    let (own, other) = (own.first_sample(), other.first_sample());
    let low = [0, 1, 2].map(|a| own[a] as i32 - other[a] as i32);
    common(&[low, low.map(|c| c + BRICK_CELLS as i32)], &[[0; 3], [BRICK_CELLS as i32; 3]])
}
