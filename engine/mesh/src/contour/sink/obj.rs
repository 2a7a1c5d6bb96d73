//! Wavefront OBJ: text, shared vertices, indices from 1. A normal has its vertex' number and stands in the line below.

use super::{MeshChunk, MeshEncoding, MeshSink, TriangleBytes, VertexBytes, folder_of};
use crate::error::Result;
use crate::part::PartFile;
use std::io::Write;
use std::path::Path;

/// Most bytes of a line of small numbers, to reserve room by.
const LINE_BYTES: usize = 32;

pub(super) struct ObjSink {
    file: PartFile,
    normals: bool,
}

impl ObjSink {
    /// Vertices have normals if `normals` says so.
    pub(super) fn new(mut file: PartFile, normals: bool) -> Result<ObjSink> {
        file.append(b"# written by Brickfield\n")?;
        Ok(ObjSink { file, normals })
    }
}

fn write_vertices(positions: &[[f32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(positions.len() * LINE_BYTES);
    for [x, y, z] in positions {
        // The shortest digits that read back as the same f32. Writing to memory cannot fail.
        let _ = writeln!(bytes, "v {x} {y} {z}");
    }
}

fn write_vertices_with_normals(positions: &[[f32; 3]], normals: &[[f32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(positions.len() * 2 * LINE_BYTES);
    for ([x, y, z], [nx, ny, nz]) in positions.iter().zip(normals) {
        let _ = writeln!(bytes, "v {x} {y} {z}\nvn {nx} {ny} {nz}");
    }
}

fn write_triangles(triangles: &[[u32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(triangles.len() * LINE_BYTES);
    for ids in triangles {
        let [a, b, c] = ids.map(|id| u64::from(id) + 1);
        let _ = writeln!(bytes, "f {a} {b} {c}");
    }
}

fn write_triangles_with_normals(triangles: &[[u32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(triangles.len() * 2 * LINE_BYTES);
    for ids in triangles {
        let [a, b, c] = ids.map(|id| u64::from(id) + 1);
        let _ = writeln!(bytes, "f {a}//{a} {b}//{b} {c}//{c}");
    }
}

impl MeshSink for ObjSink {
    fn encoding(&self) -> Option<MeshEncoding> {
        let (vertices, triangles) = match self.normals {
            false => (VertexBytes::Positions(write_vertices), TriangleBytes::Numbered(write_triangles)),
            true => (
                VertexBytes::WithNormals(write_vertices_with_normals),
                TriangleBytes::Numbered(write_triangles_with_normals),
            ),
        };
        Some(MeshEncoding { vertices, triangles })
    }

    fn folder(&self) -> Option<&Path> {
        folder_of(self.file.path())
    }

    fn encoded(&mut self, part: MeshChunk<'_>) -> Result<()> {
        let (MeshChunk::Vertices(_, bytes) | MeshChunk::Triangles(_, bytes)) = part;
        self.file.append(bytes)
    }

    fn finish(&mut self) -> Result<()> {
        self.file.finish()
    }
}
