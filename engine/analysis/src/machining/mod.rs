//! Machining: what the tools of a program take off a part, and which of its voids that opens.
//!
//! | file | owns |
//! |---|---|
//! | `cut` | moves of tools as convex solids |
//! | `removed` | which move takes off what, and what rapid moves run into |
//! | `volume` | volume of a chain, by its mesh |
//! | `opened` | what becomes of each void |

mod cut;
mod opened;
mod removed;
mod volume;

pub use cut::Cut;
pub use opened::{OpenedVoid, VoidState, opened};
pub use removed::{MoveShare, RemovedVolume, removed};
pub use volume::{BoundedVolume, measured_volume};
