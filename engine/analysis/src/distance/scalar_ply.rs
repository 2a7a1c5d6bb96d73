//! The mesh of a store as a PLY file whose vertices have a number.

use super::numbers::numbers;
use crate::contour::{MeshChunk, MeshEncoding, MeshSink, TriangleBytes, VertexBytes, ply_faces};
use crate::error::Result;
use crate::part::{PartFile, directory_of};
use crate::progress::Progress;
use std::path::Path;

/// Bytes of a vertex: position and number.
const VERTEX_BYTES: usize = 16;

/// Binary little-endian PLY with shared vertices and one property of 32 bits more. Positions stay in memory, 12 bytes a
/// vertex, until [`ScalarPly::fill`] has their numbers.
pub struct ScalarPly {
    file: PartFile,
    property: &'static str,
    positions: Vec<[f32; 3]>,
    faces: u64,
}

fn append_vertices(positions: &[[f32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(positions.len() * VERTEX_BYTES);
    for position in positions {
        bytes.extend_from_slice(position.map(f32::to_le_bytes).as_flattened());
        bytes.extend_from_slice(&[0; 4]);
    }
}

/// A header of the same length for all counts: a comment takes up what the digits leave.
fn header(vertices: u64, faces: u64, property: &str) -> String {
    let (vertices, faces) = (vertices.to_string(), faces.to_string());
    let fill = "-".repeat(40 - vertices.len() - faces.len());
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment written by Brickfield {fill}\n\
         element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         property float {property}\nelement face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
    )
}

impl ScalarPly {
    /// A file whose vertices get this property.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn new(mut file: PartFile, property: &'static str) -> Result<ScalarPly> {
        file.append(header(0, 0, property).as_bytes())?;
        Ok(ScalarPly { file, property, positions: Vec::new(), faces: 0 })
    }

    /// Positions of the vertices.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// How many vertices and triangles it has.
    pub fn counts(&self) -> (u64, u64) {
        (self.positions.len() as u64, self.faces)
    }

    /// Asks for the number of every vertex, on all threads, and finishes the file. The numbers in the order of vertices.
    ///
    /// # Errors
    /// What `number` and writing give.
    pub fn fill<L: Default>(
        mut self,
        progress: &dyn Progress,
        number: impl Fn(&mut L, [f64; 3]) -> Result<f32> + Sync,
    ) -> Result<Vec<f32>> {
        let positions = std::mem::take(&mut self.positions);
        progress.phase(self.property, Some(positions.len() as u64), "vertices");
        let mut at = header(0, 0, self.property).len() as u64;
        let mut bytes = Vec::new();
        let file = &mut self.file;
        let numbers = numbers(
            &positions,
            progress,
            |last, p| number(last, p.map(f64::from)),
            |positions, numbers| {
                bytes.clear();
                for (position, number) in positions.iter().zip(numbers) {
                    bytes.extend_from_slice(position.map(f32::to_le_bytes).as_flattened());
                    bytes.extend_from_slice(&number.to_le_bytes());
                }
                file.overwrite(at, &bytes)?;
                at += bytes.len() as u64;
                Ok(())
            },
        )?;
        let head = header(numbers.len() as u64, self.faces, self.property);
        self.file.overwrite(0, head.as_bytes())?;
        self.file.finish()?;
        Ok(numbers)
    }
}

impl MeshSink for ScalarPly {
    fn encoding(&self) -> Option<MeshEncoding> {
        let vertices = VertexBytes::Positions(append_vertices);
        Some(MeshEncoding { vertices, triangles: TriangleBytes::Numbered(ply_faces) })
    }

    fn folder(&self) -> Option<&Path> {
        Some(directory_of(self.file.path()))
    }

    fn encoded(&mut self, part: MeshChunk<'_>) -> Result<()> {
        match part {
            MeshChunk::Vertices(_, bytes) => {
                let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
                let position = |b: &[u8; VERTEX_BYTES]| [number(b), number(&b[4..]), number(&b[8..])];
                self.positions.extend(bytes.as_chunks::<VERTEX_BYTES>().0.iter().map(position));
                self.file.append(bytes)
            }
            MeshChunk::Triangles(count, bytes) => {
                self.faces += count as u64;
                self.file.append(bytes)
            }
        }
    }

    /// The mesh is complete, but not its numbers: the file stays unfinished.
    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}
