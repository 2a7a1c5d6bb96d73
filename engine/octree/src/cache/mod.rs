//! Stores as files: written anew, cut down, compared, counted.
//!
//! Everything is read record by record through the checked reader and written through [`StoreWriter`], so memory holds
//! the index and some records, nothing half-written gets a final name, and the bytes do not depend on the number of
//! threads. The output may have the input's name: the input is read to its end before the name changes hands.
//!
//! | file | owns |
//! |---|---|
//! | `rewrite` | the streaming copy of a store: what is kept, what becomes a leaf |
//! | `prune` | which nodes become leaves |
//! | `boundary` | what a leaf that was none has for Hermite edges |
//! | `place` | where nodes lie in the world |
//! | `lists` | lists of beads of a pruned store |
//! | `compare` | the differences of two stores |
//! | `statistics` | bytes by kind of record |
//!
//! [`StoreWriter`]: crate::store::StoreWriter

mod boundary;
mod compare;
mod lists;
mod place;
mod prune;
mod rewrite;
mod statistics;

pub use compare::{BrickDifferences, Comparison, Difference, MetaDifference, compare};
pub use place::{corners, meets_box, node_at};
pub use prune::{PruneOptions, PruneRegion, prune};
pub use rewrite::{RecordOrder, RewriteSummary, compact, reorder, repack};
pub use statistics::{
    FileBytes, KindNumbers, LevelStatistics, PartBytes, RecordNumbers, Statistics, statistics,
};
