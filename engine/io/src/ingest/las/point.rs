//! Points from their bytes.

use super::header::{ExtraField, LasHeader, array};
use crate::soup::PointCloud;

/// How the bytes of a point become one.
pub(super) struct PointLayout<'a> {
    scale: [f64; 3],
    offset: [f64; 3],
    normals: Option<[&'a ExtraField; 3]>,
    /// The byte, and its bit, that says that a point is withheld.
    withheld: (usize, u8),
}

/// Points with their normals, and how many were left out.
#[derive(Default)]
pub(super) struct Decoded {
    pub cloud: PointCloud,
    pub withheld: u64,
}

impl<'a> PointLayout<'a> {
    pub fn of(header: &'a LasHeader<'_>) -> PointLayout<'a> {
        let withheld = if header.format < 6 { (15, 1 << 7) } else { (15, 1 << 2) };
        PointLayout { scale: header.scale, offset: header.offset, normals: header.normals(), withheld }
    }

    /// Takes the next point, unless it counts as deleted.
    pub fn take(&self, point: &[u8], decoded: &mut Decoded) {
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
