//! The mesh of a store as a PLY file whose vertices have a number.

use super::numbers::{NumberRows, PointNumbers, numbers};
use crate::contour::{MeshChunk, MeshEncoding, MeshSink, TriangleBytes, VertexBytes, ply_faces};
use crate::error::Result;
use crate::part::PartFile;
use crate::progress::Progress;
use std::path::{Path, PathBuf};

/// Bytes of a vertex: position and number.
const VERTEX_BYTES: usize = 16;

/// Binary little-endian PLY with shared vertices and one property of 32 bits more. Positions wait, in memory or in a file, until
/// [`ScalarPly::fill`] has their numbers.
pub struct ScalarPly {
    file: PartFile,
    property: &'static str,
    positions: NumberRows<3>,
    memory: u64,
    folder: PathBuf,
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
    /// A file whose vertices get this property, in so many bytes of memory, with a file in `folder` for what does not fit.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn new(
        mut file: PartFile,
        property: &'static str,
        (memory, folder): (u64, &Path),
    ) -> Result<ScalarPly> {
        file.append(header(0, 0, property).as_bytes())?;
        let positions = NumberRows::new(memory / 2, folder);
        Ok(ScalarPly { file, property, positions, memory, folder: folder.to_owned(), faces: 0 })
    }

    /// Positions of every so manieth vertex, so that these are at most so many.
    ///
    /// # Errors
    /// What reading the file gives.
    pub fn some_positions(&self, most: usize) -> Result<Vec<[f32; 3]>> {
        let step = self.positions.len().div_ceil(most).max(1);
        let (mut some, mut number) = (Vec::new(), 0usize);
        self.positions.each(|positions| {
            for position in positions {
                if number.is_multiple_of(step) {
                    some.push(*position);
                }
                number += 1;
            }
            Ok(())
        })?;
        Ok(some)
    }

    /// How many vertices and triangles it has.
    pub fn counts(&self) -> (u64, u64) {
        (self.positions.len() as u64, self.faces)
    }

    /// Asks for the number of every vertex, on all threads, and finishes the file. The numbers in the order of
    /// vertices.
    ///
    /// # Errors
    /// What `number` and writing give.
    pub fn fill<L: Default>(
        mut self,
        progress: &dyn Progress,
        number: impl Fn(&mut L, [f64; 3]) -> Result<f32> + Sync,
    ) -> Result<PointNumbers> {
        let positions = std::mem::replace(&mut self.positions, NumberRows::new(0, &self.folder));
        let mut found = PointNumbers::new(self.memory / 2, &self.folder);
        progress.phase(self.property, Some(positions.len() as u64), "vertices");
        let mut at = header(0, 0, self.property).len() as u64;
        let mut bytes = Vec::new();
        let file = &mut self.file;
        positions.each(|positions| {
            numbers(
                positions,
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
                    found.extend(numbers)
                },
            )
        })?;
        let head = header(positions.len() as u64, self.faces, self.property);
        self.file.overwrite(0, head.as_bytes())?;
        self.file.finish()?;
        Ok(found)
    }
}

impl MeshSink for ScalarPly {
    fn encoding(&self) -> Option<MeshEncoding> {
        let vertices = VertexBytes::Positions(append_vertices);
        Some(MeshEncoding { vertices, triangles: TriangleBytes::Numbered(ply_faces) })
    }

    fn folder(&self) -> Option<&Path> {
        Some(&self.folder)
    }

    fn encoded(&mut self, part: MeshChunk<'_>) -> Result<()> {
        match part {
            MeshChunk::Vertices(_, bytes) => {
                let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
                let position = |b: &[u8; VERTEX_BYTES]| [number(b), number(&b[4..]), number(&b[8..])];
                self.positions.extend(bytes.as_chunks::<VERTEX_BYTES>().0.iter().map(position))?;
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
