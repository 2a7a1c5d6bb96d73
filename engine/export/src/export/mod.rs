//! Volumes in the files of other tools.
//!
//! A [`Volume`] says what is written: some levels of a tree, and the type of the values. A [`Format`] writes it. To add a
//! format, implement the trait in one file and add a line to [`FORMATS`].
//!
//! Formats are of two kinds. Dense ones (`dense`) hold all samples of one level; their memory is that of some rows of bricks.
//! Sparse ones leave out what is empty: `vdb` writes the tree of OpenVDB, `vtkhdf` and `zarr` a chunk a brick.

mod blocks;
mod dense;
mod vdb;
mod volume;
mod vtkhdf;
mod zarr;
mod zlib;

pub use dense::npy_header;
pub use volume::{LevelSupport, Quantity, Volume};

use crate::analysis::Element;
use crate::error::Result;
use crate::part::PartFile;
use crate::progress::Progress;
use std::path::Path;

/// Room for the texts of a dense file.
const TEXT_BYTES: u128 = 4096;

/// A format of files that hold volumes.
pub trait Format: Sync {
    /// Ending of the files' names, without the dot, in lower case.
    fn ending(&self) -> &'static str;

    /// What the format is, for people.
    fn name(&self) -> &'static str;

    /// Whether a file holds one level, all levels in one volume, or any number of levels side by side.
    fn levels(&self) -> LevelSupport {
        LevelSupport::One
    }

    /// The type of the values of whole samples, where the user chooses none.
    fn element(&self) -> Element {
        Element::I16
    }

    /// Whether it holds distances, whose background is not 0.
    fn takes_distances(&self) -> bool {
        true
    }

    /// Ending of a second file beside it, if there is one.
    fn beside(&self) -> Option<&'static str> {
        None
    }

    /// About how many bytes the file will take; of compressed formats what they usually do. To be compared with the room on
    /// the disk.
    fn bytes_about(&self, volume: &Volume<'_>) -> u128 {
        volume.dense_bytes() + TEXT_BYTES
    }

    /// Refuses a name that cannot be written, before the work.
    ///
    /// # Errors
    /// If the file cannot be made, or would replace what is not its own.
    fn require_writable(&self, path: &Path) -> Result<()> {
        PartFile::create(path).map(drop)
    }

    /// Writes the file. It gets its name when it is complete.
    ///
    /// # Errors
    /// What reading the tree and writing the file give; [`crate::error::Error::Interrupted`].
    fn write(&self, volume: &Volume<'_>, path: &Path, progress: &dyn Progress) -> Result<()>;
}

/// All formats.
pub static FORMATS: &[&dyn Format] = &[
    &dense::Npy,
    &vdb::Vdb,
    &vtkhdf::VtkHdf,
    &zarr::Zarr,
    &dense::Vti,
    &dense::Mhd,
    &dense::Mha,
    &dense::Tiff,
    &dense::Raw,
];

/// The endings of all formats, for people.
pub fn listed_endings() -> String {
    let endings: Vec<String> = FORMATS.iter().map(|format| format!(".{}", format.ending())).collect();
    endings.join(", ")
}

/// The format of a file's name.
pub fn format_of(path: &Path) -> Option<&'static dyn Format> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    let ending = if ending == "tiff" { "tif".to_owned() } else { ending };
    FORMATS.iter().copied().find(|format| format.ending() == ending)
}
