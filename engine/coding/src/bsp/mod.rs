//! Files of splats, `.bsp`: a tree of cells of which every level is a picture.
//!
//! The bytes are in `FORMAT.md` beside this crate. [`unit`](unit()) codes the cells of a node given those of the level above,
//! in either direction; [`SplatTree`] reads a file as its bytes arrive.

mod cells;
mod directions;
mod header;
mod mixing;
mod model;
mod planes;
mod tree;
mod unit;

pub use cells::{Cell, Cells, Clip, NodeCells, Splat, SplatInput, NODE_SIDE, PAIRS, SPLATS_MAX};
pub use directions::{Directions, ONE};
pub(crate) use header::array;
pub use header::{crc32, Entry, Fault, Header, Level, ENTRY_BYTES, HEADER_BYTES, LEVELS_MAX, MAGIC, VERSION};
pub use model::Model;
pub use tree::{root, SplatTree};
pub use unit::{unit, CodedUnit, Setting};
