//! PLY ("polygon file format"), ASCII and both binary byte orders.
//!
//! A text header names tables ("elements") with typed columns ("properties"), some of them lists; the tables
//! follow row by row. Read are `x y z` of the element `vertex` and the list `vertex_indices` (or
//! `vertex_index`) of the element `face`; everything else is stepped over, in any order.
//! Counts are believed only as far as bytes are there to back them.

mod ascii;
mod binary;
mod cloud;
mod header;

pub(super) use cloud::{has_faces, read_cloud};
pub(super) use header::is_ply;

use super::polygons::Polygons;
use crate::error::{Error, Result};
use crate::progress::Progress;
use header::{PlyEncoding, PlyHeader, Scalar};
use std::path::Path;

/// What to read of the body.
struct Plan {
    header: PlyHeader,
    /// Columns of x, y, z in the element `vertex`.
    coordinates: [(usize, Scalar); 3],
    /// Column of the list of corners in the element `face`.
    corners: (usize, Scalar),
    /// Rows of the element `vertex`, which bound the corners.
    vertices: u32,
}

/// Reads all faces; also tells how the body was written, as in "binary little-endian". What is allocated is a
/// small multiple of the size of `bytes`.
///
/// # Errors
/// If the file does not follow the format, ends early, goes on after its last element, has vertices but no faces, or has
/// a face that names a vertex that is not there.
pub(super) fn read(path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<(Polygons, &'static str)> {
    let plan = plan(path, header::parse(path, bytes)?)?;
    let (mut polygons, name) = match plan.header.encoding {
        PlyEncoding::Ascii => (ascii::read(path, bytes, &plan, progress)?, "PLY ASCII"),
        PlyEncoding::LittleEndian => {
            (binary::read::<false>(path, bytes, &plan, progress)?, "PLY binary little-endian")
        }
        PlyEncoding::BigEndian => {
            (binary::read::<true>(path, bytes, &plan, progress)?, "PLY binary big-endian")
        }
    };
    polygons.finish();
    Ok((polygons, name))
}

fn plan(path: &Path, header: PlyHeader) -> Result<Plan> {
    let error = |what: String, remedy| Error::input(path, "header", what, remedy);
    let vertex = header
        .element("vertex")
        .ok_or_else(|| error("there is no element \"vertex\"".into(), "export it as a triangle mesh"))?;
    let coordinates = header::coordinates(vertex).ok_or_else(|| {
        error(
            "the element \"vertex\" lacks a plain property x, y or z".into(),
            "export it as a triangle mesh",
        )
    })?;
    if header.element("tristrips").is_some() && header.element("face").is_none() {
        let what = "the surface is stored as triangle strips, which this version does not read";
        return Err(error(what.into(), "export it with faces"));
    }
    let Some(face) = header.element("face").filter(|face| face.count > 0 || vertex.count == 0) else {
        let what = format!(
            "is a point cloud ({} vertices, no faces), which this command does not take",
            vertex.count
        );
        return Err(error(what, "export it as a triangle mesh; `build` and `winding` take point clouds"));
    };
    let corners = header::corner_list(face).ok_or_else(|| {
        let what = "the element \"face\" lacks a list of integers \"vertex_indices\" (or \"vertex_index\")";
        error(what.into(), "export it as a triangle mesh")
    })?;
    let vertices = u32::try_from(vertex.count).map_err(|_| {
        error(format!("claims {} vertices, more than 4,294,967,295", vertex.count), "split the mesh")
    })?;
    Ok(Plan { coordinates, corners, vertices, header })
}
