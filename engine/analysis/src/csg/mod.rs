//! Booleans of octrees: chains of stores and solids on one lattice, as exact as their operands.
//!
//! Samples are combined as bits. Every crossing of the result is one of an operand's, bit by bit; those of what is taken off
//! have the opposite normal. `chain` decides nodes of which the index tells enough, `combine` makes the others.

mod chain;
mod combine;
mod meta;
mod operand;
mod primitive;
mod run;
mod swept_bricks;
mod walk;

pub use chain::Operation;
pub use combine::HiddenCrossings;
pub use meta::meta_of;
pub use operand::Operand;
pub use primitive::Primitive;
pub use run::{CsgSummary, Writing};
pub use swept_bricks::SweptBricks;
pub use walk::Chain;
