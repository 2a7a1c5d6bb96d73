//! What all crates of the engine share: the fixed-point lattice, exact predicates on triangles, the view of a triangle
//! soup, vectors of the processor, ordered tasks, maps, and files that get their name only when they are complete.
#![deny(unsafe_code)]
#![warn(missing_docs)]

pub mod disk;
pub mod error;
pub mod large_array;
pub mod lattice;
#[allow(unsafe_code)] // maps
pub mod mmap;
pub mod part;
pub mod predicates;
pub mod progress;
pub mod schedule;
pub mod sets;
pub mod soup;
#[cfg(any(test, feature = "testing"))]
pub mod sweep;
pub mod wide;

pub use error::{Error, ErrorKind, Result};
pub use progress::{Progress, Silent};
