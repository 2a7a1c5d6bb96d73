//! The brick store: one file that holds the octree.
//!
//! [`StoreWriter`] makes one, [`Store`] answers from it, through the view that [`BrickTree`] gives of any
//! octree. The file's layout is described in `FORMAT.md` beside this crate's manifest.

mod begin;
mod cache;
mod commit;
mod divide;
mod fault;
mod identity;
mod index;
mod join;
mod journal;
mod layout;
mod meta;
mod moved;
mod order;
mod pieces;
mod prefetch;
mod ranges;
mod reader;
mod records;
mod resume_state;
mod shard;
mod source;
mod summary;
mod tree;
mod verify;
mod visit;
mod volumes;
mod writer;

pub use cache::BrickCache;
pub use cache::CacheStats;
pub use divide::{Divided, write_divided};
#[doc(hidden)]
pub use identity::Fields;
pub use identity::{
    BeadRow, BeadSegment, BeadTables, IdentityEntry, IdentityPlace, SectionRow, encode_segments,
};
pub use join::{CoarseSamples, JoinedNode, common_empty, interior, join, joined, record_empty};
pub use journal::{SettingPairs, decode_settings, encode_settings};
pub use layout::{FORMAT_VERSION, IndexEntry};
pub use meta::{BeadsMeta, BuildCounts, Meta, Refine, Source};
pub use moved::MovedTree;
pub use order::{build_order, subtree_level};
pub use prefetch::{Walk, tell_ahead, tell_below};
pub use ranges::{ByteRanges, RangeFault};
pub use reader::hash_of;
pub use reader::{AcceptedStores, Store, StoreOptions, is_store};
pub use records::{EncodedBricks, Records};
pub use resume_state::ResumeState;
pub use shard::{Shard, ShardId, ShardNumbers, cell_key, cells_of};
pub use source::Io;
pub use summary::{LevelSummary, NodeNumbers, StoreSummary};
pub use tree::{BrickTree, MemoryTree, NodeInfo, require_level};
pub use verify::{Damage, VerifyReport};
pub use visit::{LEAVES_AHEAD, Leaf, LeafOrder, visit, visit_siblings};
pub use volumes::{Estimate, LayerVolumes, SourceVolumes, SweptVolumes};
pub use writer::{Stats, StoreWriter, check_target};

pub use crate::brick::codec::{
    Compression, Payload, PayloadHead, PayloadKind, Scratch, encode, encode_into, encode_with, parts,
};

#[cfg(test)]
mod faults;
#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzz;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
