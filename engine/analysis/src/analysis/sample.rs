//! The field at arbitrary points, and its range, from the octree.

use crate::brick::Brick;
use crate::error::{Error, Result};
use crate::lattice::{BRICK_CELLS, MAX_LEVEL, NodeKey};
use crate::store::{BrickTree, Walk};
use rayon::prelude::*;
use std::sync::Arc;

/// Points that a thread takes at once.
const POINTS_AT_ONCE: usize = 1024;
/// Points that are sorted together: that takes 16 to 24 bytes a point.
const SORTED_POINTS: usize = 1 << 22;

/// w at each point of `points` (world coordinates): trilinear between the eight samples around it in the
/// finest brick there. 0 outside the root cube, and for points that are not numbers. Continuous within a
/// leaf; where a leaf meets finer ones the two sides may differ by what the coarser one does not resolve.
///
/// Of an unfinished store each leaf that is there answers as it will in the finished one.
///
/// # Errors
/// What reading the tree gives; [`Error::Setting`] if the tree of an unfinished store has no leaf yet at one of the
/// points.
pub fn sample_at(tree: &dyn BrickTree, points: &[[f64; 3]]) -> Result<Vec<f64>> {
    let mut values = vec![0.0; points.len()];
    for (points, values) in points.chunks(SORTED_POINTS).zip(values.chunks_mut(SORTED_POINTS)) {
        sample_sorted(tree, points, values)?;
    }
    Ok(values)
}

/// Asks points in Morton order, so that each brick is read about once: scattered ones would read one each.
fn sample_sorted(tree: &dyn BrickTree, points: &[[f64; 3]], values: &mut [f64]) -> Result<()> {
    let root = tree.root();
    let place = |(number, point): (usize, &[f64; 3])| {
        (NodeKey::deepest_holding(root.from_first_sample(*point)), number as u32)
    };
    let mut order: Vec<(Option<NodeKey>, u32)> = points.par_iter().enumerate().map(place).collect();
    order.par_sort_unstable();
    let of_part = |part: &[(Option<NodeKey>, u32)]| -> Result<Vec<f64>> {
        let asked: Vec<[f64; 3]> = part.iter().map(|&(_, number)| points[number as usize]).collect();
        sample_chunk(tree, &asked)
    };
    let parts: Vec<Vec<f64>> = order.par_chunks(POINTS_AT_ONCE).map(of_part).collect::<Result<_>>()?;
    for (&(_, number), w) in order.iter().zip(parts.into_iter().flatten()) {
        values[number as usize] = w;
    }
    Ok(())
}

/// One thread's share: neighbours in the list are often neighbours in space, so the last brick is kept.
fn sample_chunk(tree: &dyn BrickTree, points: &[[f64; 3]]) -> Result<Vec<f64>> {
    let root = tree.root();
    let mut last: Option<(NodeKey, Arc<Brick>)> = None;
    // Of a tree elsewhere, the bricks of many points come at once.
    let key_at = |number: usize| leaf_at(tree, root.from_first_sample(points[number]));
    let walk = tree.is_elsewhere().then(|| Walk::new(tree, points.len(), key_at));
    let mut sample = |(number, point): (usize, &[f64; 3])| {
        walk.iter().for_each(|walk| walk.at(number));
        let from_first = root.from_first_sample(*point);
        let leaf = match leaf_at(tree, from_first) {
            Some(leaf) => leaf,
            None if NodeKey::deepest_holding(from_first).is_some() => return Err(not_yet(*point)),
            None => return Ok(0.0),
        };
        let brick = match &last {
            Some((key, brick)) if *key == leaf => Arc::clone(brick),
            _ => tree.brick(leaf)?,
        };
        last = Some((leaf, Arc::clone(&brick)));
        let spacing = f64::from(1u32 << leaf.spacing_bits());
        let base = leaf.base();
        Ok(trilinear(&brick, std::array::from_fn(|a| (from_first[a] - f64::from(base[a])) / spacing)))
    };
    points.iter().enumerate().map(&mut sample).collect()
}

fn not_yet([x, y, z]: [f64; 3]) -> Error {
    let remedy = "give the command that builds it again: it goes on";
    Error::setting(
        format!("there is no leaf yet at the point {x}, {y}, {z} of this unfinished store"),
        remedy,
    )
}

/// The leaf whose cells hold the position, given in units from the root's first sample; `None` outside, and
/// where an unfinished store has none yet.
pub(crate) fn leaf_at(tree: &dyn BrickTree, from_first: [f64; 3]) -> Option<NodeKey> {
    let deepest = NodeKey::deepest_holding(from_first)?;
    // An unfinished store may lack the nodes above.
    let mut keys = (0..=MAX_LEVEL).filter_map(|level| deepest.ancestor(level));
    keys.find(|key| tree.node(*key).is_some_and(|node| node.leaf))
}

/// Interpolates between the samples around `at`, which counts samples from the brick's first one and lies in
/// 0..=32 along each axis.
pub(super) fn trilinear(brick: &Brick, at: [f64; 3]) -> f64 {
    if let Brick::Uniform(w) = brick {
        return f64::from(*w);
    }
    let low: [usize; 3] = at.map(|a| (a as usize).min(BRICK_CELLS - 1));
    let part: [f64; 3] = std::array::from_fn(|a| at[a] - low[a] as f64);
    let corner = |dx: usize, dy: usize, dz: usize| brick.value([low[0] + dx, low[1] + dy, low[2] + dz]);
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |dy, dz| mix(corner(0, dy, dz), corner(1, dy, dz), part[0]);
    let face = |dz| mix(row(0, dz), row(1, dz), part[1]);
    mix(face(0), face(1), part[2])
}

/// Smallest and largest sample of all nodes, rounded to whole numbers; `None` without nodes, as in an empty share of a
/// store. Reads no brick.
pub fn winding_range(tree: &dyn BrickTree) -> Option<(i16, i16)> {
    let nodes = tree.keys().into_iter().filter_map(|key| tree.node(key));
    let ranges = nodes.map(|node| (node.min, node.max));
    ranges.reduce(|(low, high), (min, max)| (low.min(min), high.max(max)))
}
