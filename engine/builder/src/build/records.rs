//! What a subtree leaves behind: its nodes in post-order, encoded for the store or kept as they are.

use crate::brick::Brick;
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::store::{Compression, PayloadHead, Scratch, StoreWriter, encode_with};

/// Receives the nodes of a subtree.
pub(super) trait Recorder: Sized + Send {
    /// Without nodes, for those of a store with this compression.
    fn new(compression: Compression) -> Self;
    /// What there is, and goes on without it.
    fn take(&mut self) -> Self;
    /// Adds a node.
    fn push(&mut self, key: NodeKey, leaf: bool, brick: &Brick);
    /// Whether there are none.
    fn is_empty(&self) -> bool;
    /// Memory taken.
    fn heap_bytes(&self) -> u64;
}

/// Bricks as they are, for trees in memory.
#[derive(Default)]
pub(super) struct KeptBricks(pub Vec<(NodeKey, bool, Brick)>);

impl Recorder for KeptBricks {
    fn new(_: Compression) -> Self {
        Self::default()
    }

    fn take(&mut self) -> Self {
        std::mem::take(self)
    }

    fn push(&mut self, key: NodeKey, leaf: bool, brick: &Brick) {
        self.0.push((key, leaf, brick.clone()));
    }

    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn heap_bytes(&self) -> u64 {
        self.0
            .iter()
            .map(|(.., brick)| (size_of::<(NodeKey, bool, Brick)>() + brick.heap_bytes()) as u64)
            .sum()
    }
}

/// What encoding takes beside the records.
const SCRATCH_BYTES: u64 = 256 << 10;

/// Bricks encoded for a store.
#[derive(Default)]
pub(super) struct EncodedBricks {
    /// Key, leaf or not, head and end of the payload in `bytes`.
    nodes: Vec<(NodeKey, bool, PayloadHead, usize)>,
    bytes: Vec<u8>,
    compression: Compression,
    scratch: Scratch,
}

impl Recorder for EncodedBricks {
    fn new(compression: Compression) -> Self {
        EncodedBricks { compression, ..EncodedBricks::default() }
    }

    fn take(&mut self) -> Self {
        let next = EncodedBricks::new(self.compression);
        std::mem::replace(self, next)
    }

    fn push(&mut self, key: NodeKey, leaf: bool, brick: &Brick) {
        let head = encode_with(brick, self.compression, &mut self.scratch, &mut self.bytes);
        self.nodes.push((key, leaf, head, self.bytes.len()));
    }

    fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    fn heap_bytes(&self) -> u64 {
        SCRATCH_BYTES
            + (self.bytes.capacity()
                + self.nodes.capacity() * size_of::<(NodeKey, bool, PayloadHead, usize)>())
                as u64
    }
}

impl EncodedBricks {
    /// Appends all of them to the store; returns how much memory its index takes by now.
    pub fn write(&self, writer: &mut StoreWriter) -> Result<u64> {
        let mut start = 0;
        for &(key, leaf, head, end) in &self.nodes {
            writer.append(key, leaf, head, &self.bytes[start..end])?;
            start = end;
        }
        Ok(writer.index_bytes())
    }
}
