//! What is in a store, in numbers.

use super::layout::IndexEntry;
use super::reader::Store;
use crate::lattice::BRICK_CELLS;
use serde::Serialize;

/// Numbers of a store, by level and in total. Nothing but the index is read for it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StoreSummary {
    /// One entry a level, the root's first.
    pub levels: Vec<LevelSummary>,
    /// The sums of all levels.
    pub total: NodeNumbers,
    /// Size of the file.
    pub file_bytes: u64,
    /// Bytes of the deepest level as one dense grid of 16-bit samples.
    pub dense_bytes: u128,
    /// `dense_bytes` / `file_bytes`.
    pub dense_ratio: f64,
}

/// Numbers of one level.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LevelSummary {
    /// 0 for the root.
    pub level: u8,
    /// World distance of two samples, in the store's unit.
    pub spacing: f64,
    /// The level's numbers.
    #[serde(flatten)]
    pub numbers: NodeNumbers,
}

/// Numbers of a set of nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct NodeNumbers {
    /// All nodes.
    pub nodes: u64,
    /// Nodes without children.
    pub leaves: u64,
    /// Nodes with eight children.
    pub interior: u64,
    /// Nodes whose samples are all equal; they have no payload.
    pub uniform: u64,
    /// Nodes with counts and no Hermite edges.
    pub counts: u64,
    /// Their payload bytes.
    pub counts_bytes: u64,
    /// Nodes with counts and Hermite edges.
    pub hermite: u64,
    /// Their payload bytes.
    pub hermite_bytes: u64,
}

impl NodeNumbers {
    fn of(entries: &[IndexEntry]) -> NodeNumbers {
        let mut numbers = NodeNumbers { nodes: entries.len() as u64, ..NodeNumbers::default() };
        for entry in entries {
            *if entry.leaf { &mut numbers.leaves } else { &mut numbers.interior } += 1;
            let length = u64::from(entry.length);
            if entry.head.kind.is_uniform() {
                numbers.uniform += 1;
            } else if entry.head.kind.has_hermite() {
                numbers.hermite += 1;
                numbers.hermite_bytes += length;
            } else {
                numbers.counts += 1;
                numbers.counts_bytes += length;
            }
        }
        numbers
    }
}

impl Store {
    /// What is in the store, in numbers.
    pub fn summary(&self) -> StoreSummary {
        let levels = (0..self.index().level_count()).map(|level| LevelSummary {
            level,
            spacing: self.meta().root.spacing(level),
            numbers: NodeNumbers::of(self.index().level(level)),
        });
        let axis = (BRICK_CELLS as u128) << (self.index().level_count() - 1);
        let dense_bytes = axis.pow(3) * size_of::<i16>() as u128;
        StoreSummary {
            levels: levels.collect(),
            total: NodeNumbers::of(self.entries()),
            file_bytes: self.file_bytes(),
            dense_bytes,
            dense_ratio: dense_bytes as f64 / self.file_bytes() as f64,
        }
    }
}
