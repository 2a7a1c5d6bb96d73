//! The readers of meshes and point clouds, fed with any bytes.

use super::cloud_formats::ReadCloud;
use super::detect::{self, ReaderKind};
use super::polygons::Polygons;
use super::three_mf::ThreeMf;
use super::{cloud, cloud_text, obj, ply, stl, stl_text};
use crate::error::{Error, Result};
use crate::large_array::ArrayRoom;
use crate::progress::Silent;
use std::path::Path;

fn refused(error: &Error) {
    assert!(!error.to_string().contains('\n'), "{error}");
}

fn check(polygons: Result<Polygons>) {
    match polygons {
        Ok(polygons) => {
            let vertices = polygons.vertices.len();
            assert!(polygons.triangles.as_flattened().iter().all(|&n| (n as usize) < vertices));
        }
        Err(error) => refused(&error),
    }
}

/// Binary or text, as the bytes say.
pub fn stl(bytes: &[u8]) {
    let path = Path::new("a.stl");
    match detect::family(path, bytes) {
        Ok(ReaderKind::BinaryStl) => match stl::facets(path, bytes) {
            Ok(facets) => {
                let records = stl::records(bytes, 0, facets as usize);
                assert_eq!(records.len() as u64, facets);
                stl::extent(records);
                assert!(records.iter().map(stl::corners).count() * 50 <= bytes.len());
            }
            Err(error) => refused(&error),
        },
        Ok(ReaderKind::AsciiStl) => match stl_text::read(path, bytes, &Silent) {
            Ok(facets) => assert!(facets.all.len() <= bytes.len()),
            Err(error) => refused(&error),
        },
        Ok(_) => {}
        Err(error) => refused(&error),
    }
}

/// Any bytes as OBJ.
pub fn obj(bytes: &[u8]) {
    check(obj::read(Path::new("a.obj"), bytes, &Silent));
}

/// A mesh or a point cloud, as the header says.
pub fn ply(bytes: &[u8]) {
    let path = Path::new("a.ply");
    match ply::has_faces(path, bytes) {
        Ok(true) => check(ply::read(path, bytes, &Silent).map(|(polygons, _)| polygons)),
        Ok(false) => points(ply::read_cloud, path, bytes),
        Err(error) => refused(&error),
    }
}

/// Points as text.
pub fn xyz(bytes: &[u8]) {
    let path = Path::new("a.xyz");
    points(cloud_text::read, path, bytes);
    points(super::pcd::read, Path::new("a.pcd"), bytes);
    detect::is_cloud(Path::new("a"), bytes);
    detect::what_is(path, bytes);
}

/// Any bytes as LAS, packed or not.
pub fn las(bytes: &[u8]) {
    let path = Path::new("a.las");
    points(super::las::read, path, bytes);
}

/// Any bytes as E57.
pub fn e57(bytes: &[u8]) {
    let path = Path::new("a.e57");
    points(super::e57::read, path, bytes);
}

/// Any bytes as the archive of a 3MF file.
pub fn three_mf(bytes: &[u8]) {
    match ThreeMf::of_bytes(Path::new("a.3mf"), bytes, &Silent) {
        Ok(found) => assert!(found.objects.len() as u64 <= found.bytes * 1024),
        Err(error) => refused(&error),
    }
    check(super::three_mf::read(Path::new("a.3mf"), bytes, &Silent));
}

/// Any bytes as OFF.
pub fn off(bytes: &[u8]) {
    check(super::off::read(Path::new("a.off"), bytes, &Silent));
}

/// Any bytes as AMF, the XML or an archive of it.
pub fn amf(bytes: &[u8]) {
    check(super::amf::read(Path::new("a.amf"), bytes, &Silent));
}

/// Any bytes as binary glTF.
pub fn glb(bytes: &[u8]) {
    check(super::gltf::read(Path::new("a.glb"), bytes, &Silent));
}

fn points(read: ReadCloud, path: &Path, bytes: &[u8]) {
    let cloud = read(path, bytes, &ArrayRoom::unbounded(), &Silent).map(|(cloud, _)| cloud);
    match cloud.and_then(|cloud| cloud::check(&cloud, path).map(|()| cloud)) {
        Ok(cloud) => {
            assert!(cloud.normals.is_empty() || cloud.normals.len() == cloud.points.len());
            assert!(cloud.points.as_flattened().iter().all(|c| c.is_finite()));
        }
        Err(error) => refused(&error),
    }
}
