//! Binary little-endian PLY with shared vertices.

use super::super::polygons::Facet;
use super::MeshSink;
use super::part::MeshFile;
use crate::error::Result;
use std::io::Write;
use std::path::Path;

/// Bytes of a face: the number of corners and their indices.
const FACE_BYTES: usize = 13;

pub(super) struct PlySink {
    file: MeshFile,
    vertices: u64,
    faces: u64,
    buffer: Vec<u8>,
}

impl PlySink {
    pub(super) fn create(path: &Path) -> Result<PlySink> {
        let mut file = MeshFile::create(path)?;
        file.write(|w| w.write_all(header(0, 0).as_bytes()))?;
        Ok(PlySink { file, vertices: 0, faces: 0, buffer: Vec::new() })
    }
}

/// A header of the same length for all counts: a comment takes up what the digits leave.
fn header(vertices: u64, faces: u64) -> String {
    let (vertices, faces) = (vertices.to_string(), faces.to_string());
    let fill = "-".repeat(40 - vertices.len() - faces.len());
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment written by Brickfield {fill}\n\
         element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
    )
}

impl MeshSink for PlySink {
    fn vertices(&mut self, positions: &[[f32; 3]]) -> Result<()> {
        self.vertices += positions.len() as u64;
        self.buffer.clear();
        self.buffer.extend(positions.as_flattened().iter().flat_map(|c| c.to_le_bytes()));
        let buffer = &self.buffer;
        self.file.write(|w| w.write_all(buffer))
    }

    fn triangles(&mut self, facets: &[Facet]) -> Result<()> {
        self.faces += facets.len() as u64;
        self.buffer.clear();
        self.buffer.reserve(facets.len() * FACE_BYTES);
        for facet in facets {
            let mut record = [3; FACE_BYTES];
            for (to, id) in record[1..].chunks_exact_mut(4).zip(facet.ids) {
                to.copy_from_slice(&id.to_le_bytes());
            }
            self.buffer.extend_from_slice(&record);
        }
        let buffer = &self.buffer;
        self.file.write(|w| w.write_all(buffer))
    }

    fn finish(&mut self) -> Result<()> {
        self.file.patch(0, header(self.vertices, self.faces).as_bytes())?;
        self.file.finish()
    }
}
