//! Binary little-endian PLY with shared vertices.

use super::super::polygons::Facet;
use super::{Encoded, Encoding, MeshSink};
use crate::error::Result;
use crate::part::PartFile;

/// Bytes of a face: the number of corners and their indices.
const FACE_BYTES: usize = 13;

pub(super) struct PlySink {
    file: PartFile,
    vertices: u64,
    faces: u64,
}

impl PlySink {
    pub(super) fn new(mut file: PartFile) -> Result<PlySink> {
        file.append(header(0, 0).as_bytes())?;
        Ok(PlySink { file, vertices: 0, faces: 0 })
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

fn write_vertices(positions: &[[f32; 3]], bytes: &mut Vec<u8>) {
    bytes.extend(positions.as_flattened().iter().flat_map(|c| c.to_le_bytes()));
}

fn write_facets(facets: &[Facet], _normals: &[[f32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(facets.len() * FACE_BYTES);
    for facet in facets {
        let mut record = [3; FACE_BYTES];
        for (to, id) in record[1..].chunks_exact_mut(4).zip(facet.ids) {
            to.copy_from_slice(&id.to_le_bytes());
        }
        bytes.extend_from_slice(&record);
    }
}

impl MeshSink for PlySink {
    fn encoding(&self) -> Option<Encoding> {
        Some(Encoding { vertices: write_vertices, facets: write_facets })
    }

    fn encoded(&mut self, part: Encoded<'_>) -> Result<()> {
        let bytes = match part {
            Encoded::Vertices(count, bytes) => {
                self.vertices += count as u64;
                bytes
            }
            Encoded::Triangles(count, bytes) => {
                self.faces += count as u64;
                bytes
            }
        };
        self.file.append(bytes)
    }

    fn finish(&mut self) -> Result<()> {
        self.file.overwrite(0, header(self.vertices, self.faces).as_bytes())?;
        self.file.finish()
    }
}
