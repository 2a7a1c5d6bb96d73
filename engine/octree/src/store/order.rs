//! The order in which a build appends records.

use super::layout::IndexEntry;

/// The level whose subtrees stand one after the other in a store that is divided everywhere to this depth.
pub fn subtree_level(depth: u8) -> u8 {
    match depth {
        0..=3 => depth,
        4 | 5 => 3,
        _ => 4,
    }
}

/// The entries in the order in which a build appends them: subtrees of a level along the Morton curve, each in
/// post-order, then the nodes above them in post-order.
pub fn build_order<'a>(entries: impl Iterator<Item = &'a IndexEntry>, level: u8) -> Vec<&'a IndexEntry> {
    let mut ordered: Vec<&IndexEntry> = entries.collect();
    ordered.sort_unstable_by_key(|entry| (entry.key.level() < level, entry.key.post_order()));
    ordered
}
