//! Point clouds of surveyors, `.las` and, packed, `.laz`: LAS 1.0 to 1.4 of ASPRS. COPC is LAZ in an order of its own, and
//! read as that.

mod header;
#[cfg(feature = "las")]
mod packed;
mod point;
#[cfg(test)]
mod tests;

use super::columns::CloudColumns;
use crate::error::Result;
use crate::large_array::ArrayRoom;
use crate::progress::Progress;
use crate::soup::PointCloud;
use header::LasHeader;
use point::{Decoded, PointLayout};
use std::path::Path;

/// Points between two looks at whether the user interrupts.
const POINTS_AT_ONCE: usize = 1 << 16;

/// True of the beginning of a LAS file, packed or not.
pub(super) fn is_las(bytes: &[u8]) -> bool {
    bytes.starts_with(b"LASF")
}

/// Reads all points but those withheld, in the file's own unit; and their normals if the file has numbers `NormalX`,
/// `NormalY` and `NormalZ` beside those of the standard. What is allocated is a small multiple of the points that are there.
///
/// # Errors
/// If the file does not follow the format or ends early; if it is packed and the program cannot unpack.
pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    room: &ArrayRoom,
    progress: &dyn Progress,
) -> Result<(PointCloud, CloudColumns)> {
    let header = LasHeader::of(path, bytes)?;
    let decoded = match header.is_packed {
        false => records(&header, bytes, room, progress)?,
        true => unpacked(&header, bytes, room, progress)?,
    };
    let names = ["x", "y", "z"].map(str::to_owned).into_iter();
    let names = names.chain(header.extra.iter().map(|field| field.name.clone())).collect();
    let no_normals = header.normals().is_none().then(|| "no numbers NormalX, NormalY and NormalZ".to_owned());
    let notes = match decoded.withheld {
        0 => Vec::new(),
        left_out => vec![format!("{left_out} points are marked as withheld, and are left out")],
    };
    Ok((decoded.cloud, CloudColumns { names, named: true, no_normals, notes, ..CloudColumns::default() }))
}

/// Points one behind the other.
fn records(
    header: &LasHeader<'_>,
    bytes: &[u8],
    room: &ArrayRoom,
    progress: &dyn Progress,
) -> Result<Decoded> {
    let there = bytes.get(header.points_at..).unwrap_or_default();
    let needed = header.points.checked_mul(header.stride as u64);
    if needed.is_none_or(|needed| needed > there.len() as u64) {
        let (points, stride, there) = (header.points, header.stride, there.len());
        return Err(
            header.error(format!("counts {points} points of {stride} bytes, but {there} bytes are there"))
        );
    }
    let (layout, mut decoded) = (PointLayout::of(header), Decoded::new(room));
    let points = there.chunks_exact(header.stride).take(header.points as usize);
    for (number, point) in points.enumerate() {
        if number % POINTS_AT_ONCE == 0 {
            progress.check()?;
        }
        layout.take(point, &mut decoded)?;
    }
    Ok(decoded)
}

#[cfg(feature = "las")]
use packed::unpacked;

#[cfg(not(feature = "las"))]
fn unpacked(header: &LasHeader<'_>, _: &[u8], _: &ArrayRoom, _: &dyn Progress) -> Result<Decoded> {
    let what = "is packed (LAZ), and this program was built without the feature `las`";
    let remedy = "build it with that feature, or unpack the file to .las";
    Err(crate::error::Error::input(header.path, "header", what, remedy))
}
