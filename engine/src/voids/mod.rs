//! Voids of a part: the regions that it encloses, their sizes and what lies around them.
//!
//! | file | owns |
//! |---|---|
//! | `components` | connected components of one brick |
//! | `measure` | what is summed of a component |
//! | `labelling` | components of the tree, joined across leaves |

mod components;
mod labelling;
mod measure;

pub use components::Connectivity;
pub use labelling::{Component, Labelling, label};
pub use measure::Sums;

#[cfg(test)]
mod tests;
