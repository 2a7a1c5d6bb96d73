//! The mesh of a store as a file whose vertices have a number: PLY, VTK's PolyData, or binary glTF.

use super::numbers::{PointNumbers, numbers};
use crate::contour::{
    Coordinates, GlbSink, MeshChunk, MeshEncoding, MeshSink, NumbersOf, TriangleBytes, VertexBytes, VtpFile,
    placed, ply_faces, vtp_corners, write_triangles,
};
use crate::error::Result;
use crate::large_array::{ArrayRoom, LargeArray};
use crate::part::PartFile;
use crate::progress::Progress;
use std::path::{Path, PathBuf};

/// Endings of the names of such files, in lower case.
pub const SCALAR_ENDINGS: [&str; 3] = ["ply", "vtp", "glb"];

/// The file, by the end of its name.
enum ScalarFile {
    /// Positions stand beside their numbers, and are written a second time with those.
    Ply(PartFile),
    Vtp(VtpFile),
    Glb(GlbSink),
}

/// A mesh with shared vertices and a number of 32 bits for each. Positions wait, in memory or in a mapped file, until
/// [`ScalarMesh::fill`] has their numbers.
pub struct ScalarMesh {
    file: ScalarFile,
    property: &'static str,
    positions: LargeArray<[f32; 3]>,
    /// Where positions count from.
    base: [f64; 3],
    /// Whether the file has their places in the world, with 64 bits.
    is_double: bool,
    memory: u64,
    folder: PathBuf,
    faces: u64,
}

fn append_positions(positions: &[[f32; 3]], bytes: &mut Vec<u8>) {
    bytes.extend(positions.as_flattened().iter().flat_map(|c| c.to_le_bytes()));
}

/// A header of the same length for all counts: a comment takes up what the digits leave.
fn ply_header(vertices: u64, faces: u64, (kind, property): (&str, &str)) -> String {
    let (vertices, faces) = (vertices.to_string(), faces.to_string());
    let fill = "-".repeat(40 - vertices.len() - faces.len());
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment written by Brickfield {fill}\n\
         element vertex {vertices}\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\n\
         property float {property}\nelement face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
    )
}

impl ScalarMesh {
    /// A file in the format of its name, PLY if that ends in none of [`SCALAR_ENDINGS`], whose vertices get this property. `metres`
    /// is the length of the unit of positions, for glTF. Positions count from `base`; with 64 bits the file has their places in the
    /// world, in PLY and PolyData. What waits takes so many bytes of memory, with a file in `folder`
    /// for what does not fit.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn new(
        file: PartFile,
        property: &'static str,
        metres: Option<f64>,
        (base, coordinates): ([f64; 3], Coordinates),
        (memory, folder): (u64, &Path),
    ) -> Result<ScalarMesh> {
        let is_double = coordinates != Coordinates::Single;
        let ending = file.path().extension().unwrap_or_default().to_ascii_lowercase();
        let file = match ending.to_str() {
            Some("vtp") => {
                ScalarFile::Vtp(VtpFile::new(file, is_double, (NumbersOf::Vertices, &[property]), &[])?)
            }
            Some("glb") => ScalarFile::Glb(GlbSink::with_numbers(file, metres, property)?),
            _ => ScalarFile::Ply(file),
        };
        let positions = LargeArray::new(&ArrayRoom::new(memory / 2, folder));
        let folder = folder.to_owned();
        let mut mesh = ScalarMesh { file, property, positions, base, is_double, memory, folder, faces: 0 };
        let head = mesh.ply_head();
        if let ScalarFile::Ply(file) = &mut mesh.file {
            file.append(head.as_bytes())?;
        }
        Ok(mesh)
    }

    fn ply_head(&self) -> String {
        let kind = if self.is_double { "double" } else { "float" };
        ply_header(self.positions.len() as u64, self.faces, (kind, self.property))
    }

    /// Positions of every so manieth vertex, so that these are at most so many.
    pub fn some_positions(&self, most: usize) -> Vec<[f64; 3]> {
        let step = self.positions.len().div_ceil(most).max(1);
        self.positions.iter().step_by(step).map(|position| placed(self.base, *position)).collect()
    }

    /// How many vertices and triangles it has.
    pub fn counts(&self) -> (u64, u64) {
        (self.positions.len() as u64, self.faces)
    }

    /// Asks for the number of every vertex, on all threads. The numbers in the order of vertices.
    ///
    /// # Errors
    /// What `number` and writing give.
    pub fn fill<L: Default>(
        &mut self,
        progress: &dyn Progress,
        number: impl Fn(&mut L, [f64; 3]) -> Result<f32> + Sync,
    ) -> Result<PointNumbers> {
        let head = self.ply_head();
        let positions = std::mem::take(&mut self.positions);
        let mut found = PointNumbers::new(self.memory / 2, &self.folder);
        progress.phase(self.property, Some(positions.len() as u64), "vertices");
        let mut at = head.len() as u64;
        let mut bytes = Vec::new();
        let (file, base, is_double) = (&mut self.file, self.base, self.is_double);
        numbers(
            &positions,
            progress,
            |last, p| number(last, placed(base, p)),
            |positions, numbers| {
                bytes.clear();
                match file {
                    ScalarFile::Ply(file) => {
                        rows((positions, numbers), is_double.then_some(base), &mut bytes);
                        file.overwrite(at, &bytes)?;
                        at += bytes.len() as u64;
                    }
                    ScalarFile::Vtp(file) => {
                        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
                        file.numbers(0, &bytes)?;
                    }
                    ScalarFile::Glb(file) => file.numbers(numbers)?,
                }
                found.extend(numbers)
            },
        )?;
        if let ScalarFile::Ply(file) = &mut self.file {
            file.overwrite(0, head.as_bytes())?;
        }
        Ok(found)
    }

    /// Gives the file its name. It has its numbers; what else is told of them is known, so that nothing ends halfway.
    ///
    /// # Errors
    /// What writing gives.
    pub fn complete(&mut self) -> Result<()> {
        match &mut self.file {
            ScalarFile::Ply(file) => file.finish().map(|_| ()),
            ScalarFile::Vtp(file) => file.finish(),
            ScalarFile::Glb(file) => file.finish(),
        }
    }
}

/// The vertices of a PLY, each with its number; with 64 bits where there is a base to add.
fn rows((positions, numbers): (&[[f32; 3]], &[f32]), base: Option<[f64; 3]>, bytes: &mut Vec<u8>) {
    for (position, number) in positions.iter().zip(numbers) {
        match base {
            Some(base) => {
                bytes.extend_from_slice(placed(base, *position).map(f64::to_le_bytes).as_flattened());
            }
            None => bytes.extend_from_slice(position.map(f32::to_le_bytes).as_flattened()),
        }
        bytes.extend_from_slice(&number.to_le_bytes());
    }
}

impl MeshSink for ScalarMesh {
    fn encoding(&self) -> Option<MeshEncoding> {
        let triangles = match self.file {
            ScalarFile::Ply(_) => ply_faces,
            ScalarFile::Vtp(_) => vtp_corners,
            ScalarFile::Glb(_) => write_triangles,
        };
        let vertices = VertexBytes::Positions(append_positions);
        Some(MeshEncoding { vertices, triangles: TriangleBytes::Numbered(triangles) })
    }

    fn folder(&self) -> Option<&Path> {
        Some(&self.folder)
    }

    fn encoded(&mut self, part: MeshChunk<'_>) -> Result<()> {
        match part {
            MeshChunk::Vertices(count, bytes) => {
                let (coordinates, _) = bytes.as_chunks::<4>();
                let position = |p: &[[u8; 4]; 3]| p.map(f32::from_le_bytes);
                let positions: Vec<[f32; 3]> = coordinates.as_chunks::<3>().0.iter().map(position).collect();
                match &mut self.file {
                    ScalarFile::Ply(file) => {
                        let mut room = Vec::new();
                        let base = self.is_double.then_some(self.base);
                        rows((&positions, &vec![0.0; count]), base, &mut room);
                        file.append(&room)?;
                    }
                    ScalarFile::Vtp(file) if self.is_double => {
                        let places = positions.iter().flat_map(|p| placed(self.base, *p));
                        file.points(count, &places.flat_map(f64::to_le_bytes).collect::<Vec<u8>>())?;
                    }
                    ScalarFile::Vtp(file) => file.points(count, bytes)?,
                    ScalarFile::Glb(file) => file.encoded(part)?,
                }
                self.positions.extend_from_slice(&positions)
            }
            MeshChunk::Triangles(count, bytes) => {
                self.faces += count as u64;
                match &mut self.file {
                    ScalarFile::Ply(file) => file.append(bytes),
                    ScalarFile::Vtp(file) => file.triangles(count, bytes),
                    ScalarFile::Glb(file) => file.encoded(part),
                }
            }
        }
    }

    /// The mesh is complete, but not its numbers: the file stays unfinished.
    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}
