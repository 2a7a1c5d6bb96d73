//! PLY, OBJ and VTP with coordinates of 64 bits, and PLY and VTP whose faces have numbers. Positions are a base and what is added to it.

use super::vtp::{NumbersOf, VtpFile, WaitingNumbers, vtp_corners};
use super::{MeshSink, folder_of, ply};
use crate::contour::cut::MeshTriangle;
use crate::error::Result;
use crate::part::PartFile;
use std::io::Write;
use std::path::Path;

/// Numbers of the faces of a mesh.
pub trait FaceAttributes: Send {
    /// What is to be said of them in the file, a line each.
    fn comments(&self) -> Vec<String>;
    /// Their names.
    fn names(&self) -> Vec<&'static str>;
    /// The numbers of some faces, those of a face one behind the other.
    ///
    /// # Errors
    /// What finding the numbers gives.
    fn numbers(&mut self, facets: &[MeshTriangle]) -> Result<Vec<i32>>;
}

/// How coordinates are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coordinates {
    /// As they come, with 32 bits.
    Single,
    /// Added to a position of the world, with 64 bits.
    DoubleFrom([f64; 3]),
}

/// The file, by the end of its name.
enum PlacedFile {
    Ply(PartFile),
    Obj(PartFile),
    Vtp(VtpFile, WaitingNumbers),
}

/// Endings of formats with coordinates of 64 bits.
pub const DOUBLE_ENDINGS: [&str; 3] = ["ply", "obj", "vtp"];
/// Endings of those whose triangles have numbers; a GLB has them in a sink of its own, [`super::GlbFacesSink`].
pub const NUMBER_ENDINGS: [&str; 3] = ["ply", "vtp", "glb"];

/// Numbers that faces have in a file.
#[derive(Clone, Debug, Default)]
pub struct FaceColumns {
    /// Their names.
    pub names: Vec<&'static str>,
    /// What is to be said of them in the file, a line each.
    pub comments: Vec<String>,
}

/// A mesh in a file, one vertex and one triangle after the other.
pub struct PlacedSink<'a> {
    file: PlacedFile,
    coordinates: Coordinates,
    columns: FaceColumns,
    faces: Option<Box<dyn FaceAttributes + 'a>>,
    counts: [u64; 2],
    /// The number of the last face, which tells the groups of an OBJ apart.
    group: Option<i32>,
    bytes: Vec<u8>,
}

impl<'a> PlacedSink<'a> {
    /// Of a name that ends in .obj, .vtp, or else of a PLY, with what finds the numbers of faces.
    ///
    /// # Errors
    /// If the file cannot be made.
    pub fn create(
        path: &Path,
        coordinates: Coordinates,
        faces: Option<Box<dyn FaceAttributes + 'a>>,
    ) -> Result<PlacedSink<'a>> {
        let columns =
            faces.as_ref().map(|faces| FaceColumns { names: faces.names(), comments: faces.comments() });
        let sink = PlacedSink::with_columns(path, coordinates, columns.unwrap_or_default())?;
        Ok(PlacedSink { faces, ..sink })
    }

    /// The same for faces whose numbers come with them, by [`PlacedSink::numbered_triangles`]. Faces of an OBJ are in groups
    /// by the first of these numbers.
    ///
    /// # Errors
    /// If the file cannot be made.
    pub fn with_columns(
        path: &Path,
        coordinates: Coordinates,
        columns: FaceColumns,
    ) -> Result<PlacedSink<'a>> {
        let ends = |wanted: &str| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(wanted));
        let mut file = PartFile::create(path)?;
        let file = if ends("obj") {
            file.append(b"# written by Brickfield\n")?;
            PlacedFile::Obj(file)
        } else if ends("vtp") {
            let FaceColumns { names, comments } = &columns;
            let waiting = WaitingNumbers::new(names.len(), folder_of(path));
            let is_double = coordinates != Coordinates::Single;
            PlacedFile::Vtp(VtpFile::new(file, is_double, (NumbersOf::Triangles, names), comments)?, waiting)
        } else {
            PlacedFile::Ply(file)
        };
        let (counts, bytes) = ([0; 2], Vec::new());
        let mut sink = PlacedSink { file, coordinates, columns, faces: None, counts, group: None, bytes };
        let head = sink.ply_header();
        if let PlacedFile::Ply(file) = &mut sink.file {
            file.append(head.as_bytes())?;
        }
        Ok(sink)
    }

    /// A header of the same length for all counts: a comment takes up what the digits leave.
    fn ply_header(&self) -> String {
        let [vertices, faces] = self.counts.map(|count| count.to_string());
        let fill = "-".repeat(40 - vertices.len() - faces.len());
        let kind = if self.coordinates == Coordinates::Single { "float" } else { "double" };
        let FaceColumns { names, comments } = &self.columns;
        let comments: String = comments.iter().map(|line| format!("comment {line}\n")).collect();
        let properties: String = names.iter().map(|name| format!("property int {name}\n")).collect();
        format!(
            "ply\nformat binary_little_endian 1.0\ncomment written by Brickfield {fill}\n{comments}\
             element vertex {vertices}\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\n\
             element face {faces}\nproperty list uchar uint vertex_indices\n{properties}end_header\n"
        )
    }

    /// The next triangles, by the numbers of their corners, with the numbers that they have in the file: those of a triangle one
    /// behind the other.
    ///
    /// # Errors
    /// What writing gives.
    pub fn numbered_triangles(&mut self, ids: &[[u32; 3]], numbers: &[i32]) -> Result<()> {
        self.bytes.clear();
        self.counts[1] += ids.len() as u64;
        match &mut self.file {
            PlacedFile::Obj(file) => {
                let columns = self.columns.names.len().max(1);
                for (n, [a, b, c]) in ids.iter().map(|ids| ids.map(|id| u64::from(id) + 1)).enumerate() {
                    let group = numbers.get(n * columns).copied();
                    if group != self.group
                        && let (Some(number), Some(name)) = (group, self.columns.names.first())
                    {
                        let _ = writeln!(self.bytes, "g {name}_{number}");
                    }
                    self.group = group;
                    let _ = writeln!(self.bytes, "f {a} {b} {c}");
                }
                file.append(&self.bytes)
            }
            PlacedFile::Ply(file) => {
                ply::ply_faces_with_numbers(ids, numbers, &mut self.bytes);
                file.append(&self.bytes)
            }
            PlacedFile::Vtp(file, waiting) => {
                vtp_corners(ids, &mut self.bytes);
                file.triangles(ids.len(), &self.bytes)?;
                waiting.push(numbers)
            }
        }
    }

    /// A position in the world.
    fn placed(&self, position: [f32; 3]) -> [f64; 3] {
        let base = match self.coordinates {
            Coordinates::Single => [0.0; 3],
            Coordinates::DoubleFrom(base) => base,
        };
        placed(base, position)
    }
}

/// A position in the world of one that counts from `base`.
pub fn placed(base: [f64; 3], position: [f32; 3]) -> [f64; 3] {
    std::array::from_fn(|a| base[a] + f64::from(position[a]))
}

impl MeshSink for PlacedSink<'_> {
    fn shares_vertices(&self) -> bool {
        true
    }

    fn folder(&self) -> Option<&Path> {
        match &self.file {
            PlacedFile::Ply(file) | PlacedFile::Obj(file) => folder_of(file.path()),
            PlacedFile::Vtp(file, _) => folder_of(file.path()),
        }
    }

    fn vertices_with_normals(&mut self, positions: &[[f32; 3]], _: &[[f32; 3]]) -> Result<()> {
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.clear();
        let is_obj = matches!(self.file, PlacedFile::Obj(_));
        for position in positions {
            if is_obj {
                let [x, y, z] = self.placed(*position);
                // The shortest digits that read back as the same f64. Writing to memory cannot fail.
                let _ = writeln!(bytes, "v {x} {y} {z}");
            } else if self.coordinates == Coordinates::Single {
                bytes.extend_from_slice(position.map(f32::to_le_bytes).as_flattened());
            } else {
                bytes.extend_from_slice(self.placed(*position).map(f64::to_le_bytes).as_flattened());
            }
        }
        self.bytes = bytes;
        self.counts[0] += positions.len() as u64;
        match &mut self.file {
            PlacedFile::Ply(file) | PlacedFile::Obj(file) => file.append(&self.bytes),
            PlacedFile::Vtp(file, _) => file.points(positions.len(), &self.bytes),
        }
    }

    fn triangles(&mut self, facets: &[MeshTriangle]) -> Result<()> {
        let ids: Vec<[u32; 3]> = facets.iter().map(|facet| facet.ids).collect();
        let numbers = match &mut self.faces {
            Some(faces) => faces.numbers(facets)?,
            None => Vec::new(),
        };
        self.numbered_triangles(&ids, &numbers)
    }

    fn finish(&mut self) -> Result<()> {
        let head = self.ply_header();
        match &mut self.file {
            PlacedFile::Ply(file) => {
                file.overwrite(0, head.as_bytes())?;
                file.finish()
            }
            PlacedFile::Obj(file) => file.finish(),
            PlacedFile::Vtp(file, waiting) => {
                waiting.each(|n, bytes| file.numbers(n, bytes))?;
                file.finish()
            }
        }
    }
}
