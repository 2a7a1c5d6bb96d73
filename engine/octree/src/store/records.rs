//! What a subtree leaves behind: its nodes in post-order, encoded for the store or kept as they are.

use super::{MemoryTree, StoreWriter};
use crate::brick::Brick;
use crate::brick::codec::{Compression, PayloadHead, Scratch, encode_with};
use crate::error::Result;
use crate::lattice::NodeKey;

/// The nodes of a subtree in the order in which they were pushed.
pub enum Records {
    /// Bricks as they are, for trees in memory.
    Kept(Vec<(NodeKey, bool, Brick)>),
    /// Bricks encoded for a store.
    Encoded(Box<EncodedBricks>),
}

impl Records {
    /// Without nodes, for those of a store with this compression, or of a tree in memory.
    pub fn new(compression: Option<Compression>) -> Records {
        compression.map_or_else(
            || Records::Kept(Vec::new()),
            |compression| Records::Encoded(Box::new(EncodedBricks::new(compression))),
        )
    }

    /// What there is, and goes on without it.
    pub fn take(&mut self) -> Records {
        let next = match self {
            Records::Kept(_) => Records::new(None),
            Records::Encoded(encoded) => Records::new(Some(encoded.compression)),
        };
        std::mem::replace(self, next)
    }

    /// Adds a node.
    pub fn push(&mut self, key: NodeKey, leaf: bool, brick: &Brick) {
        match self {
            Records::Kept(kept) => kept.push((key, leaf, brick.clone())),
            Records::Encoded(encoded) => encoded.push(key, leaf, brick),
        }
    }

    /// Adds a node whose payload is encoded already, as of another store; only to records of a store.
    pub fn push_encoded(&mut self, key: NodeKey, leaf: bool, head: PayloadHead, payload: &[u8]) {
        match self {
            Records::Kept(_) => unreachable!("a tree in memory has its bricks as they are"),
            Records::Encoded(encoded) => {
                encoded.bytes.extend_from_slice(payload);
                encoded.nodes.push((key, leaf, head, encoded.bytes.len()));
            }
        }
    }

    /// Adds those of `others` behind its own, which are kept in the same way.
    pub fn append(&mut self, others: Records) {
        match (self, others) {
            (Records::Kept(kept), Records::Kept(others)) => kept.extend(others),
            (Records::Encoded(encoded), Records::Encoded(others)) => {
                let from = encoded.bytes.len();
                encoded.bytes.extend_from_slice(&others.bytes);
                encoded
                    .nodes
                    .extend(others.nodes.iter().map(|&(key, leaf, head, end)| (key, leaf, head, from + end)));
            }
            _ => unreachable!("both are for the same tree"),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        match self {
            Records::Kept(kept) => kept.is_empty(),
            Records::Encoded(encoded) => encoded.nodes.is_empty(),
        }
    }

    /// Memory taken.
    pub fn heap_bytes(&self) -> u64 {
        match self {
            Records::Kept(kept) => {
                let bytes = |(.., brick): &(NodeKey, bool, Brick)| {
                    size_of::<(NodeKey, bool, Brick)>() + brick.heap_bytes()
                };
                kept.iter().map(|node| bytes(node) as u64).sum()
            }
            Records::Encoded(encoded) => encoded.heap_bytes(),
        }
    }

    /// Appends all of them to the store; returns how much memory its index takes by now.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn write(&self, writer: &mut StoreWriter) -> Result<u64> {
        match self {
            Records::Kept(_) => unreachable!("a store's records are encoded"),
            Records::Encoded(encoded) => encoded.write(writer),
        }
    }

    /// Adds all of them to a tree in memory.
    pub fn insert(self, tree: &mut MemoryTree) {
        match self {
            Records::Kept(kept) => {
                kept.into_iter().for_each(|(key, leaf, brick)| tree.insert(key, leaf, brick))
            }
            Records::Encoded(_) => unreachable!("a tree in memory has its bricks as they are"),
        }
    }
}

/// What encoding takes beside the records.
const SCRATCH_BYTES: u64 = 256 << 10;

/// Bricks encoded for a store.
#[derive(Default)]
pub struct EncodedBricks {
    /// Key, leaf or not, head and end of the payload in `bytes`.
    nodes: Vec<(NodeKey, bool, PayloadHead, usize)>,
    bytes: Vec<u8>,
    compression: Compression,
    scratch: Scratch,
}

impl EncodedBricks {
    fn new(compression: Compression) -> EncodedBricks {
        EncodedBricks { compression, ..EncodedBricks::default() }
    }

    fn push(&mut self, key: NodeKey, leaf: bool, brick: &Brick) {
        let head = encode_with(brick, self.compression, &mut self.scratch, &mut self.bytes);
        self.nodes.push((key, leaf, head, self.bytes.len()));
    }

    fn heap_bytes(&self) -> u64 {
        SCRATCH_BYTES
            + (self.bytes.capacity()
                + self.nodes.capacity() * size_of::<(NodeKey, bool, PayloadHead, usize)>())
                as u64
    }

    fn write(&self, writer: &mut StoreWriter) -> Result<u64> {
        let mut start = 0;
        for &(key, leaf, head, end) in &self.nodes {
            writer.append(key, leaf, head, &self.bytes[start..end])?;
            start = end;
        }
        Ok(writer.index_bytes())
    }
}
