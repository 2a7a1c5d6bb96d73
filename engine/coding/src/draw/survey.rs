//! Which nodes of a part a picture shows, so that those are refined that are in view.

use super::packed::PackedSplat;
use super::view::DrawView;
use crate::bsp::SplatTree;

/// Bits of a place within a node.
const NODE_BITS: u32 = 5;

/// The nodes of splats that a picture shows, by key, with how many of their splats it shows. Those of a node follow each other, as
/// [`super::packed_splats`] gives them.
pub fn seen_nodes(splats: &[PackedSplat], is_seen: &[bool]) -> Vec<(u64, u32)> {
    let mut nodes: Vec<(u64, u32)> = Vec::new();
    for (splat, _) in splats.iter().zip(is_seen).filter(|(_, is_seen)| **is_seen) {
        let key = node_of(splat);
        match nodes.last_mut() {
            Some((last, count)) if *last == key => *count += 1,
            _ => nodes.push((key, 1)),
        }
    }
    nodes
}

/// The key of the node in which a splat's cell is.
fn node_of(splat: &PackedSplat) -> u64 {
    let level = splat[1] >> 16 & 31;
    let at = [splat[0] & 0xffff, splat[0] >> 16, splat[1] & 0xffff].map(|c| u64::from(c >> NODE_BITS));
    (0..level)
        .rev()
        .fold(1, |key, bit| key << 3 | (at[0] >> bit & 1) | (at[1] >> bit & 1) << 1 | (at[2] >> bit & 1) << 2)
}

/// The units of nodes that are seen whose cells are larger than `limit` pixels, as numbers in the directory as far as it is known:
/// first those of the largest cells, of these those of which most is seen.
pub fn units_to_refine(
    tree: &SplatTree,
    seen: &[(u64, u32)],
    is_loaded: impl Fn(usize) -> bool,
    view: &DrawView,
    limit: f64,
) -> Vec<u32> {
    let mut found = Vec::new();
    for &(key, count) in seen {
        let unit = match tree.unit_of(key) {
            Some(unit) if !is_loaded(unit) => unit,
            _ => continue,
        };
        let pixels = cell_pixels(view, key);
        if pixels > limit {
            // Levels of detail are powers of two: what differs by less is alike.
            let size = ((pixels / limit).to_bits() >> 52) as u32;
            found.push((!size, !count, unit as u32));
        }
    }
    found.sort_unstable();
    found.into_iter().map(|(_, _, unit)| unit).collect()
}

/// Pixels of a cell of a node, where it is nearest to the eye.
fn cell_pixels(view: &DrawView, key: u64) -> f64 {
    let level = (63 - key.leading_zeros()) / 3;
    let edge = view.edge / (1u64 << level) as f64;
    let cell = edge / f64::from(1u32 << NODE_BITS);
    if view.distance == 0.0 {
        return cell / view.pixel;
    }
    let mut near = 0.0;
    for a in 0..3 {
        let place = (0..level).map(|bit| (key >> (3 * bit) >> a & 1) << bit).sum::<u64>();
        let middle = view.origin[a] + (place as f64 + 0.5) * edge - view.centre[a];
        near += middle * view.axes[2][a] + view.axes[2][a].abs() * edge / 2.0;
    }
    cell / view.pixel * view.distance / (view.distance - near).max(view.distance * 1e-3)
}
