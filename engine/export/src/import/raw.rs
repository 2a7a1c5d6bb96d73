//! Samples without a header, which a description beside them tells of.

use super::description::{raw_layout, require_same};
use super::grid::Grid;
use super::meta_image::layout_beside;
use crate::error::Result;
use crate::mmap::MappedFile;
use std::path::Path;

/// Opens samples.
pub(super) fn open(path: &Path, file: MappedFile, _: Option<&str>) -> Result<Grid> {
    let layout = raw_layout(path)?;
    require_same(path, &layout, layout_beside(path))?;
    Grid::in_place(path, file, 0, layout)
}
