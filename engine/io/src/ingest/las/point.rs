//! Points from their bytes.

use super::header::{ExtraField, LasHeader, array};
use crate::error::Result;
use crate::large_array::ArrayRoom;
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

impl Decoded {
    /// None yet.
    pub fn new(room: &ArrayRoom) -> Decoded {
        Decoded { cloud: PointCloud::new(room), withheld: 0 }
    }
}

impl<'a> PointLayout<'a> {
    pub fn of(header: &'a LasHeader<'_>) -> PointLayout<'a> {
        let withheld = if header.format < 6 { (15, 1 << 7) } else { (15, 1 << 2) };
        PointLayout { scale: header.scale, offset: header.offset, normals: header.normals(), withheld }
    }

    /// Takes the next point, unless it counts as deleted.
    ///
    /// # Errors
    /// As [`PointCloud::push`].
    pub fn take(&self, point: &[u8], decoded: &mut Decoded) -> Result<()> {
        let (byte, bit) = self.withheld;
        if point[byte] & bit != 0 {
            decoded.withheld += 1;
            return Ok(());
        }
        let place = |axis: usize| {
            let counted = i32::from_le_bytes(array(point, 4 * axis).unwrap_or_default());
            f64::from(counted) * self.scale[axis] + self.offset[axis]
        };
        // A normal that is unknown counts for nothing.
        let known = |field: &ExtraField| Some(field.value(point)).filter(|c| c.is_finite()).unwrap_or(0.0);
        decoded.cloud.push([0, 1, 2].map(place), self.normals.map(|fields| fields.map(known)))
    }
}
