//! Volumes of other tools as stores: NumPy arrays, MetaImage, raw samples.
//!
//! A [`Grid`] is a volume in a file, which is mapped and never held in memory. [`Reading`] says what of its values is solid. The
//! lattice of the store is that of the grid, so its samples are the grid's; crossings are where straight lines between samples
//! pass the surface, and normals are gradients.

mod description;
mod field;
mod grid;
mod meta_image;
mod npy;
#[cfg(test)]
mod tests;

pub use field::{Reading, VolumeSummary, build_volume};
pub use grid::Grid;

use crate::error::{Error, Result};
use std::path::Path;

/// Endings of the files that are read.
pub const ENDINGS: [&str; 4] = ["npy", "mha", "mhd", "raw"];

/// Whether a file's name is that of a volume.
pub fn is_volume(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
    ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
}

impl Grid {
    /// Opens a volume by its name's ending.
    ///
    /// # Errors
    /// [`Error::Input`] if it is none, or of a kind that is not read, with what to do.
    pub fn open(path: &Path) -> Result<Grid> {
        let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
        match ending.as_deref() {
            Some("npy") => npy::open(path),
            Some("raw") => description::open_raw(path),
            Some("mha" | "mhd") => meta_image::open(path),
            _ => Err(Error::input(path, "name", "is no volume", "give a .npy, .mha, .mhd or .raw file")),
        }
    }
}
