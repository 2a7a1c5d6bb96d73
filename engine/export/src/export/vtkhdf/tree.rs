//! The tree that finds the chunks of an array: a B-tree of version 1, built from below.

use super::hdf5::NOWHERE;
use crate::error::Result;
use crate::part::PartFile;

/// A chunk of an array.
pub(super) struct Chunk {
    /// Its number among all, those that are left out included.
    pub(super) number: u64,
    pub(super) at: u64,
    pub(super) bytes: u32,
}

/// Children of a node at most, as libraries expect it.
const CHILDREN_MAX: usize = 64;
const KEY_BYTES: usize = 24;
const NODE_BYTES: usize = 24 + (CHILDREN_MAX + 1) * KEY_BYTES + CHILDREN_MAX * 8;

/// A child with the key of its first chunk.
struct Child {
    bytes: u32,
    first: u64,
    at: u64,
}

/// Writes the tree of chunks of `block` numbers each, in ascending order. Returns its address.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn write(chunks: &[Chunk], block: u64, file: &mut PartFile) -> Result<u64> {
    let Some(last) = chunks.last() else { return Ok(NOWHERE) };
    let end = (last.number + 1) * block;
    let child = |chunk: &Chunk| Child { bytes: chunk.bytes, first: chunk.number * block, at: chunk.at };
    let mut children = chunks.iter().map(child).collect::<Vec<_>>();
    for level in 0u8.. {
        children = write_level(level, &children, end, file)?;
        if children.len() == 1 {
            break;
        }
    }
    Ok(children[0].at)
}

/// Writes the nodes above some children.
fn write_level(level: u8, children: &[Child], end: u64, file: &mut PartFile) -> Result<Vec<Child>> {
    let (first_at, count) = (file.appended(), children.len().div_ceil(CHILDREN_MAX));
    let at = |n: usize| first_at + (n * NODE_BYTES) as u64;
    let mut above = Vec::new();
    for (n, group) in children.chunks(CHILDREN_MAX).enumerate() {
        let mut node = b"TREE\x01".to_vec();
        node.push(level);
        node.extend((group.len() as u16).to_le_bytes());
        node.extend((if n == 0 { NOWHERE } else { at(n - 1) }).to_le_bytes());
        node.extend((if n + 1 == count { NOWHERE } else { at(n + 1) }).to_le_bytes());
        for child in group {
            put_key(&mut node, child.bytes, child.first);
            node.extend(child.at.to_le_bytes());
        }
        // What bounds the last child from above.
        let next = children.get((n + 1) * CHILDREN_MAX).map_or(end, |child| child.first);
        put_key(&mut node, 0, next);
        node.resize(NODE_BYTES, 0);
        above.push(Child { bytes: group[0].bytes, first: group[0].first, at: at(n) });
        file.append(&node)?;
    }
    Ok(above)
}

fn put_key(node: &mut Vec<u8>, bytes: u32, first: u64) {
    node.extend(bytes.to_le_bytes());
    node.extend(0u32.to_le_bytes());
    node.extend(first.to_le_bytes());
    node.extend(0u64.to_le_bytes());
}
