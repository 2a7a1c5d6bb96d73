//! Tables of beads for picks, `.picks`: which bead of a toolpath passes nearest to a point, without the toolpath.
//!
//! The bytes are in `PICKS.md` beside this crate. Blocks of segments can be read each by itself: a [`PickTable`] says which ones a
//! point needs.

mod block;
mod header;
mod nearest;
mod segment;
mod table;
#[cfg(test)]
mod tests;
mod wide;

pub use block::{block, SEGMENTS_MAX};
pub use header::{PickBlock, PickHeader, PICK_BLOCK_BYTES, PICK_HEADER_BYTES, PICK_MAGIC, PICK_VERSION};
pub use segment::{Beside, PickBead, PickOutline, PickSegment, Steps, AXIS_ONE};
pub use table::{pick_table_bytes, CodedPickBlock, PickTable, PickedBead};
