//! How large a mesh will be, from a few of its bricks.

use crate::brick::{Brick, SignChanges, point_position};
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::store::{BrickTree, IndexEntry, Store, tell_ahead};

/// Bricks that are looked at, evenly along the file: sums over 64 of them are within a tenth of the truth for piles of beads.
const LOOKED_AT: usize = 64;

/// Number of triangles that a mesh without a tolerance will have, estimated. It is two for each lattice edge whose
/// ends are on both sides of `iso`, in some of the bricks in which there may be any, times how many such bricks there
/// are.
///
/// # Errors
/// If a brick cannot be read.
pub fn foresee_triangles(store: &Store, iso: f64, level: Option<u8>) -> Result<u64> {
    let is_drawn = |entry: &&IndexEntry| match level {
        Some(level) => entry.key.level() == level || (entry.leaf && entry.key.level() < level),
        None => entry.leaf,
    };
    let mut crossed: Vec<&IndexEntry> =
        store.entries().iter().filter(is_drawn).filter(|entry| !entry.head.kind.is_uniform()).collect();
    crossed.sort_unstable_by_key(|entry| entry.offset);
    let looked_at = crossed.len().min(LOOKED_AT);
    let keys: Vec<NodeKey> = (0..looked_at).map(|n| crossed[n * crossed.len() / looked_at].key).collect();
    tell_ahead(store, &keys);
    let mut edges = 0;
    for key in keys {
        if let Brick::Counts { samples, .. } = &*store.brick(key)? {
            let changes = SignChanges::from_fn(|index| samples.value(point_position(index)) >= iso);
            edges += changes.counts().iter().map(|&count| count as u64).sum::<u64>();
        }
    }
    let of_all = edges as f64 * crossed.len() as f64 / looked_at.max(1) as f64;
    Ok((2.0 * of_all) as u64)
}
