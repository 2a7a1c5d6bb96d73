//! Point clouds of scanners, `.e57` (ASTM E2807): all scans of a file, each by its pose, in millimetres.

#[cfg(feature = "e57")]
mod scans;
#[cfg(all(test, feature = "e57"))]
mod tests;

#[cfg(feature = "e57")]
pub(super) use scans::read;

#[cfg(not(feature = "e57"))]
use crate::error::{Error, Result};

/// True of the beginning of an E57 file.
pub(super) fn is_e57(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ASTM-E57")
}

/// Says what to do in its place.
#[cfg(not(feature = "e57"))]
pub(super) fn read(
    path: &std::path::Path,
    _: &[u8],
    _: &crate::large_array::ArrayRoom,
    _: &dyn crate::progress::Progress,
) -> Result<(crate::soup::PointCloud, super::columns::CloudColumns)> {
    let what = "is an E57 file, and this program was built without the feature `e57`";
    Err(Error::input(path, "header", what, "build it with that feature, or convert the file to PLY or LAS"))
}
