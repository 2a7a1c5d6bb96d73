//! The reader of a library that was built without X3D.

use super::extrusion::Sink;
use super::report::X3dReport;
use crate::error::{Error, Result};
use crate::progress::Progress;
use std::path::Path;

/// Refuses the file `path`.
///
/// # Errors
/// Always: the library was built without the feature `x3d`.
pub fn read(path: &Path, _: &[u8], _: &dyn Progress, _: &mut Sink<'_>) -> Result<X3dReport> {
    let what = "is X3D, and this program was built without the feature `x3d`";
    Err(Error::input(path, "file", what, "build it with that feature, or export the part as STL, OBJ or PLY"))
}
