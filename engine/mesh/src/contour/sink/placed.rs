//! PLY and OBJ with coordinates of 64 bits, and PLY whose faces have numbers. Positions are a base and what is added to it.

use super::{MeshSink, folder_of, ply};
use crate::contour::cut::MeshTriangle;
use crate::error::Result;
use crate::part::PartFile;
use std::io::Write;
use std::path::Path;

/// Numbers of the faces of a mesh.
pub trait FaceAttributes: Send {
    /// Lines of a PLY's header that stand before its elements, each with its end.
    fn comments(&self) -> String;
    /// Lines of the header behind the corners of faces, each with its end.
    fn properties(&self) -> String;
    /// Appends the bytes of a face's numbers behind those of its corners.
    ///
    /// # Errors
    /// What finding the numbers gives.
    fn append(&mut self, facets: &[MeshTriangle], corners: &[u8], out: &mut Vec<u8>) -> Result<()>;
}

/// How coordinates are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coordinates {
    /// As they come, with 32 bits.
    Single,
    /// Added to a position of the world, with 64 bits.
    DoubleFrom([f64; 3]),
}

/// The end of a file's name and of what it holds.
#[derive(Clone, Copy, PartialEq)]
enum PlacedFormat {
    Ply,
    Obj,
}

/// Endings of formats with coordinates of 64 bits.
pub const DOUBLE_ENDINGS: [&str; 2] = ["ply", "obj"];

/// A mesh in a file, one vertex and one triangle after the other.
pub struct PlacedSink<'a> {
    file: PartFile,
    format: PlacedFormat,
    coordinates: Coordinates,
    faces: Option<Box<dyn FaceAttributes + 'a>>,
    counts: [u64; 2],
    bytes: Vec<u8>,
}

impl<'a> PlacedSink<'a> {
    /// Of a name that ends in .obj, or else of a PLY, the one whose faces may have numbers.
    ///
    /// # Errors
    /// If the file cannot be made.
    pub fn create(
        path: &Path,
        coordinates: Coordinates,
        faces: Option<Box<dyn FaceAttributes + 'a>>,
    ) -> Result<PlacedSink<'a>> {
        let is_obj = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("obj"));
        let format = if is_obj { PlacedFormat::Obj } else { PlacedFormat::Ply };
        let mut sink = PlacedSink {
            file: PartFile::create(path)?,
            format,
            coordinates,
            faces,
            counts: [0; 2],
            bytes: Vec::new(),
        };
        let head = sink.header();
        sink.file.append(head.as_bytes())?;
        Ok(sink)
    }

    /// A header of the same length for all counts: a comment takes up what the digits leave.
    fn header(&self) -> String {
        if self.format == PlacedFormat::Obj {
            return "# written by Brickfield\n".to_owned();
        }
        let [vertices, faces] = self.counts.map(|count| count.to_string());
        let fill = "-".repeat(40 - vertices.len() - faces.len());
        let kind = if self.coordinates == Coordinates::Single { "float" } else { "double" };
        let (comments, properties) =
            self.faces.as_ref().map_or((String::new(), String::new()), |f| (f.comments(), f.properties()));
        format!(
            "ply\nformat binary_little_endian 1.0\ncomment written by Brickfield {fill}\n{comments}\
             element vertex {vertices}\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\n\
             element face {faces}\nproperty list uchar uint vertex_indices\n{properties}end_header\n"
        )
    }
}

impl MeshSink for PlacedSink<'_> {
    fn shares_vertices(&self) -> bool {
        true
    }

    fn folder(&self) -> Option<&Path> {
        folder_of(self.file.path())
    }

    fn vertices(&mut self, positions: &[[f32; 3]]) -> Result<()> {
        self.bytes.clear();
        for position in positions {
            match (self.coordinates, self.format) {
                (Coordinates::Single, PlacedFormat::Ply) => {
                    self.bytes.extend_from_slice(position.map(f32::to_le_bytes).as_flattened());
                }
                (coordinates, format) => {
                    let base = match coordinates {
                        Coordinates::Single => [0.0; 3],
                        Coordinates::DoubleFrom(base) => base,
                    };
                    let [x, y, z]: [f64; 3] = std::array::from_fn(|a| base[a] + f64::from(position[a]));
                    if format == PlacedFormat::Ply {
                        self.bytes.extend_from_slice([x, y, z].map(f64::to_le_bytes).as_flattened());
                    } else {
                        // The shortest digits that read back as the same f64. Writing to memory cannot fail.
                        let _ = writeln!(self.bytes, "v {x} {y} {z}");
                    }
                }
            }
        }
        self.counts[0] += positions.len() as u64;
        self.file.append(&self.bytes)
    }

    fn triangles(&mut self, facets: &[MeshTriangle]) -> Result<()> {
        self.bytes.clear();
        self.counts[1] += facets.len() as u64;
        if self.format == PlacedFormat::Obj {
            for [a, b, c] in facets.iter().map(|facet| facet.ids.map(|id| u64::from(id) + 1)) {
                let _ = writeln!(self.bytes, "f {a} {b} {c}");
            }
            return self.file.append(&self.bytes);
        }
        let ids: Vec<[u32; 3]> = facets.iter().map(|facet| facet.ids).collect();
        ply::ply_faces(&ids, &mut self.bytes);
        if let Some(faces) = &mut self.faces {
            let mut with_numbers = Vec::new();
            faces.append(facets, &self.bytes, &mut with_numbers)?;
            self.bytes = with_numbers;
        }
        self.file.append(&self.bytes)
    }

    fn finish(&mut self) -> Result<()> {
        self.file.overwrite(0, self.header().as_bytes())?;
        self.file.finish()
    }
}
