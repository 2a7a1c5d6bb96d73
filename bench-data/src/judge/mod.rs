//! Independent verdicts: is this mesh what it claims to be, and what is w here?

pub mod mesh;
pub mod read;
mod weld;
pub mod winding;

pub use weld::weld;
