//! Volumes of other tools as stores: OpenVDB, VTK images, MetaImage, NumPy arrays, raw samples.
//!
//! A [`Grid`] is a volume in a file, which is mapped and never held in memory; packed samples are unpacked into a temporary
//! file, and the leaves of a tree where they are asked for. [`Reading`] says what of its values is solid. The lattice of the
//! store is that of the grid, so its samples are the grid's; crossings are where straight lines between samples pass the
//! surface, and normals are gradients.
//!
//! To add a format, write a file that opens it, and add a line to `FORMATS`.

mod base64;
mod description;
mod field;
#[cfg(feature = "fuzzing")]
pub mod fuzz;
mod grid;
mod meta_image;
mod npy;
mod packed;
mod raw;
mod tags;
#[cfg(test)]
mod tests;
mod vdb;
mod vti;

pub use field::{Reading, VolumeSummary, build_volume};
pub use grid::Grid;

use crate::error::{Error, Result};
use crate::mmap::MappedFile;
use std::path::Path;

/// Opens a file that is mapped; the text chooses one of the things that it holds.
type Open = fn(&Path, MappedFile, Option<&str>) -> Result<Grid>;

/// Endings of the files that are read, and what opens them.
const FORMATS: [(&[&str], Open); 5] = [
    (&["npy"], npy::open),
    (&["mha", "mhd"], meta_image::open),
    (&["raw"], raw::open),
    (&["vdb"], vdb::open),
    (&["vti"], vti::open),
];

/// Endings of the files that are read.
pub fn endings() -> impl Iterator<Item = &'static str> {
    FORMATS.iter().flat_map(|(endings, _)| endings.iter().copied())
}

fn format_of(path: &Path) -> Option<Open> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    FORMATS.iter().find(|(endings, _)| endings.contains(&&*ending)).map(|(_, open)| *open)
}

/// Whether a file's name is that of a volume.
pub fn is_volume(path: &Path) -> bool {
    format_of(path).is_some()
}

impl Grid {
    /// Opens a volume by its name's ending. Of a file with several, `field` names the one.
    ///
    /// # Errors
    /// [`Error::Input`] if it is none, or of a kind that is not read, with what to do.
    pub fn open(path: &Path, field: Option<&str>) -> Result<Grid> {
        let Some(open) = format_of(path) else {
            let remedy = format!("give one of .{}", endings().collect::<Vec<_>>().join(", ."));
            return Err(Error::input(path, "name", "is no volume", remedy));
        };
        let grid = open(path, MappedFile::open(path)?, field)?;
        match field {
            Some(name) if grid.fields().is_empty() => {
                let remedy = "leave the field's name out";
                Err(Error::input(path, format!("field {name}"), "the file holds one volume", remedy))
            }
            _ => Ok(grid),
        }
    }
}
