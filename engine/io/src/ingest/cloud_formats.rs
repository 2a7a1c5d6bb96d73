//! The formats of point clouds. A new one is a file with its reader and a line here.

use super::columns::CloudColumns;
use super::{cloud_text, e57, las, pcd, ply};
use crate::error::Result;
use crate::large_array::ArrayRoom;
use crate::progress::Progress;
use crate::soup::PointCloud;
use std::path::Path;

/// What reads a file.
pub(super) type ReadCloud = fn(&Path, &[u8], &ArrayRoom, &dyn Progress) -> Result<(PointCloud, CloudColumns)>;

/// A format of point clouds.
pub(super) struct CloudFormat {
    /// Its name where a file is one.
    pub name: &'static str,
    /// The name of what is in it.
    pub described: &'static str,
    /// Whether it says its unit, so that positions are in millimetres.
    pub in_millimetres: bool,
    tell: fn(&Path, &[u8]) -> bool,
    pub read: ReadCloud,
}

/// Formats that are told by their content.
#[rustfmt::skip]
static FORMATS: [CloudFormat; 4] = [
    CloudFormat { name: "PLY", described: "PLY points", in_millimetres: false, tell: is_ply_cloud, read: ply::read_cloud },
    CloudFormat { name: "PCD", described: "PCD points", in_millimetres: false, tell: |_, bytes| pcd::is_pcd(bytes), read: pcd::read },
    CloudFormat { name: "LAS", described: "LAS points", in_millimetres: false, tell: |_, bytes| las::is_las(bytes), read: las::read },
    CloudFormat { name: "E57", described: "E57 points", in_millimetres: true, tell: |_, bytes| e57::is_e57(bytes), read: e57::read },
];

/// Points as text, if a file is nothing else.
pub(super) static TEXT: CloudFormat = CloudFormat {
    name: "XYZ",
    described: "XYZ points",
    in_millimetres: false,
    tell: |_, _| true,
    read: cloud_text::read,
};

fn is_ply_cloud(path: &Path, bytes: &[u8]) -> bool {
    ply::is_ply(bytes) && ply::has_faces(path, bytes).is_ok_and(|has_faces| !has_faces)
}

impl CloudFormat {
    /// That of a file, if its content tells it.
    pub(super) fn of(path: &Path, bytes: &[u8]) -> Option<&'static CloudFormat> {
        FORMATS.iter().find(|format| (format.tell)(path, bytes))
    }
}
