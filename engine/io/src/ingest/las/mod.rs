//! Point clouds of surveyors, `.las` and, packed, `.laz`: LAS 1.0 to 1.4 of ASPRS. COPC is LAZ in an order of its own, and
//! read as that.

mod header;
#[cfg(feature = "las")]
mod packed;
#[cfg(test)]
mod tests;

use super::columns::CloudColumns;
use crate::error::Result;
use crate::progress::Progress;
use crate::soup::PointCloud;
use header::{ExtraField, LasHeader, array};
use std::path::Path;

const REMEDY: &str = "copy or export the file again";
/// Points between two looks at whether the user interrupts.
const POINTS_AT_ONCE: usize = 1 << 16;

/// True of the beginning of a LAS file, packed or not.
pub(super) fn is_las(bytes: &[u8]) -> bool {
    bytes.starts_with(b"LASF")
}

/// How the bytes of a point become one.
struct PointLayout<'a> {
    scale: [f64; 3],
    offset: [f64; 3],
    normals: Option<[&'a ExtraField; 3]>,
    /// The byte, and its bit, that says that a point is withheld.
    withheld: (usize, u8),
}

/// Points with their normals, and how many were left out.
#[derive(Default)]
struct Decoded {
    cloud: PointCloud,
    withheld: u64,
}

impl<'a> PointLayout<'a> {
    fn of(header: &'a LasHeader<'_>) -> PointLayout<'a> {
        let withheld = if header.format < 6 { (15, 1 << 7) } else { (15, 1 << 2) };
        PointLayout { scale: header.scale, offset: header.offset, normals: header.normals(), withheld }
    }

    /// Takes the next point, unless it counts as deleted.
    fn take(&self, point: &[u8], decoded: &mut Decoded) {
        let (byte, bit) = self.withheld;
        if point[byte] & bit != 0 {
            decoded.withheld += 1;
            return;
        }
        let place = |axis: usize| {
            let counted = i32::from_le_bytes(array(point, 4 * axis).unwrap_or_default());
            f64::from(counted) * self.scale[axis] + self.offset[axis]
        };
        decoded.cloud.points.push([0, 1, 2].map(place));
        // A normal that is unknown counts for nothing.
        let known = |field: &ExtraField| Some(field.value(point)).filter(|c| c.is_finite()).unwrap_or(0.0);
        decoded.cloud.normals.extend(self.normals.map(|fields| fields.map(known)));
    }
}

/// Reads all points but those withheld, in the file's own unit; and their normals if the file has numbers `NormalX`,
/// `NormalY` and `NormalZ` beside those of the standard. What is allocated is a small multiple of the points that are there.
///
/// # Errors
/// If the file does not follow the format or ends early; if it is packed and the program cannot unpack.
pub(super) fn read(path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<(PointCloud, CloudColumns)> {
    let header = LasHeader::of(path, bytes)?;
    let decoded = match header.is_packed {
        false => records(&header, bytes, progress)?,
        true => unpacked(&header, bytes, progress)?,
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
fn records(header: &LasHeader<'_>, bytes: &[u8], progress: &dyn Progress) -> Result<Decoded> {
    let there = bytes.get(header.points_at..).unwrap_or_default();
    let needed = header.points.checked_mul(header.stride as u64);
    if needed.is_none_or(|needed| needed > there.len() as u64) {
        let (points, stride, there) = (header.points, header.stride, there.len());
        return Err(
            header.error(format!("counts {points} points of {stride} bytes, but {there} bytes are there"))
        );
    }
    let (layout, mut decoded) = (PointLayout::of(header), Decoded::default());
    let points = there.chunks_exact(header.stride).take(header.points as usize);
    for (number, point) in points.enumerate() {
        if number % POINTS_AT_ONCE == 0 {
            progress.check()?;
        }
        layout.take(point, &mut decoded);
    }
    Ok(decoded)
}

#[cfg(feature = "las")]
use packed::unpacked;

#[cfg(not(feature = "las"))]
fn unpacked(header: &LasHeader<'_>, _: &[u8], _: &dyn Progress) -> Result<Decoded> {
    let what = "is packed (LAZ), and this program was built without the feature `las`";
    let remedy = "build it with --features las, or unpack the file to .las";
    Err(crate::error::Error::input(header.path, "header", what, remedy))
}
