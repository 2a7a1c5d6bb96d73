//! Binary little-endian PLY with shared vertices, with or without normals.

use super::{MeshChunk, MeshEncoding, MeshSink, TriangleBytes, VertexBytes, folder_of};
use crate::error::Result;
use crate::part::PartFile;
use std::path::Path;

/// Bytes of a face: the number of corners and their indices.
const FACE_BYTES: usize = 13;

pub(super) struct PlySink {
    file: PartFile,
    vertices: u64,
    faces: u64,
    normals: bool,
}

impl PlySink {
    /// Vertices have normals if `normals` says so.
    pub(super) fn new(mut file: PartFile, normals: bool) -> Result<PlySink> {
        file.append(header(0, 0, normals).as_bytes())?;
        Ok(PlySink { file, vertices: 0, faces: 0, normals })
    }
}

/// A header of the same length for all counts: a comment takes up what the digits leave.
fn header(vertices: u64, faces: u64, normals: bool) -> String {
    let normals = if normals { "property float nx\nproperty float ny\nproperty float nz\n" } else { "" };
    let (vertices, faces) = (vertices.to_string(), faces.to_string());
    let fill = "-".repeat(40 - vertices.len() - faces.len());
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment written by Brickfield {fill}\n\
         element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         {normals}element face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
    )
}

fn write_vertices(positions: &[[f32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(size_of_val(positions));
    for position in positions {
        bytes.extend_from_slice(position.map(f32::to_le_bytes).as_flattened());
    }
}

/// Positions and normals by turns.
fn write_vertices_with_normals(positions: &[[f32; 3]], normals: &[[f32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(2 * size_of_val(positions));
    for (position, normal) in positions.iter().zip(normals) {
        bytes.extend_from_slice(position.map(f32::to_le_bytes).as_flattened());
        bytes.extend_from_slice(normal.map(f32::to_le_bytes).as_flattened());
    }
}

/// Numbers of 32 bits, little-endian: positions, each with its normal behind it if `normals` says so.
pub(super) fn vertex_bytes(normals: bool) -> VertexBytes {
    match normals {
        false => VertexBytes::Positions(write_vertices),
        true => VertexBytes::WithNormals(write_vertices_with_normals),
    }
}

/// Appends the faces of a binary PLY: three and the numbers of the corners.
pub fn ply_faces(triangles: &[[u32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(triangles.len() * FACE_BYTES);
    for ids in triangles {
        let mut record = [3; FACE_BYTES];
        record[1..].copy_from_slice(ids.map(u32::to_le_bytes).as_flattened());
        bytes.extend_from_slice(&record);
    }
}

/// The same with numbers behind the corners, as many of each face.
pub(super) fn ply_faces_with_numbers(triangles: &[[u32; 3]], numbers: &[i32], bytes: &mut Vec<u8>) {
    let Some(columns) = numbers.len().checked_div(triangles.len()).filter(|columns| *columns > 0) else {
        return ply_faces(triangles, bytes);
    };
    for (triangle, numbers) in triangles.iter().zip(numbers.chunks_exact(columns)) {
        ply_faces(std::slice::from_ref(triangle), bytes);
        numbers.iter().for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
    }
}

impl MeshSink for PlySink {
    fn encoding(&self) -> Option<MeshEncoding> {
        let vertices = vertex_bytes(self.normals);
        Some(MeshEncoding { vertices, triangles: TriangleBytes::Numbered(ply_faces) })
    }

    fn folder(&self) -> Option<&Path> {
        folder_of(self.file.path())
    }

    fn encoded(&mut self, part: MeshChunk<'_>) -> Result<()> {
        let bytes = match part {
            MeshChunk::Vertices(count, bytes) => {
                self.vertices += count as u64;
                bytes
            }
            MeshChunk::Triangles(count, bytes) => {
                self.faces += count as u64;
                bytes
            }
        };
        self.file.append(bytes)
    }

    fn finish(&mut self) -> Result<()> {
        self.file.overwrite(0, header(self.vertices, self.faces, self.normals).as_bytes())?;
        self.file.finish()
    }
}
