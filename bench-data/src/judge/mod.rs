//! Independent verdicts: is this mesh what it claims to be, how far is it from the truth, and what is w here?

pub mod boundary;
mod creases;
pub mod distance;
pub mod mesh;
pub mod read;
pub(crate) mod tree;
mod weld;
pub mod winding;

pub use weld::weld;
