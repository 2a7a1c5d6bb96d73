//! The points of a PLY without faces.

use super::header::{self, PlyEncoding};
use super::{ascii, binary};
use crate::error::{Error, Result};
use crate::ingest::columns::CloudColumns;
use crate::ingest::text;
use crate::large_array::ArrayRoom;
use crate::progress::Progress;
use crate::soup::PointCloud;
use std::path::Path;

/// Whether the header names faces or triangle strips: otherwise the file is a point cloud. A mesh that is empty names none
/// and has no points either.
///
/// # Errors
/// If the header does not follow the format.
pub(in crate::ingest) fn has_faces(path: &Path, bytes: &[u8]) -> Result<bool> {
    let header = header::parse(path, bytes)?;
    let has_points = header.element("vertex").is_none_or(|vertex| vertex.count > 0);
    let is_named = |name| header.element(name).is_some_and(|e| e.count > 0 || !has_points);
    Ok(["face", "tristrips"].into_iter().any(is_named))
}

/// Reads the points, and their normals if the file has them. What is allocated is a small multiple of the
/// size of `bytes`.
///
/// # Errors
/// If the file does not follow the format or ends early.
pub(in crate::ingest) fn read_cloud(
    path: &Path,
    bytes: &[u8],
    room: &ArrayRoom,
    progress: &dyn Progress,
) -> Result<(PointCloud, CloudColumns)> {
    let header = header::parse(path, bytes)?;
    let vertex = header.element("vertex");
    let positions = vertex.and_then(header::coordinates).ok_or_else(|| {
        let what = "there is no element \"vertex\" with plain properties x, y and z";
        Error::input(path, "header", what, "export it as points with normals")
    })?;
    let normals = vertex.and_then(header::normals);
    let wanted: Vec<_> = positions.into_iter().chain(normals.into_iter().flatten()).collect();
    let (mut cloud, mut kept) = (PointCloud::new(room), Ok(()));
    let row = |values: &[f64]| {
        if let Some((point, rest)) = values.split_first_chunk::<3>()
            && kept.is_ok()
        {
            kept = cloud.push(*point, rest.first_chunk::<3>().copied());
        }
    };
    match header.encoding {
        PlyEncoding::Ascii => ascii::vertex_columns(path, bytes, &header, &wanted, progress, row)?,
        PlyEncoding::LittleEndian => {
            binary::vertex_columns::<false>(path, bytes, &header, &wanted, progress, row)?;
        }
        PlyEncoding::BigEndian => {
            binary::vertex_columns::<true>(path, bytes, &header, &wanted, progress, row)?;
        }
    }
    kept?;
    let names = vertex.map_or(&[][..], |vertex| &vertex.properties);
    let names: Vec<String> = names.iter().map(|property| text::plain(&property.name)).collect();
    let no_normals = normals.is_none().then(|| "no properties nx, ny and nz".to_owned());
    Ok((cloud, CloudColumns { names, named: true, no_normals, ..CloudColumns::default() }))
}
