//! Where a mesh goes: arrays in memory, or files by format, written under a temporary name.

mod arrays;
mod glb;
mod glb_faces;
mod obj;
mod placed;
mod ply;
mod stl;
#[cfg(test)]
mod tests;
mod three_mf;
mod three_mf_parts;
mod vtp;

use super::cut::MeshTriangle;
use super::cut::{Cuts, encoded};
use crate::error::{Error, Result};
use crate::part::PartFile;
use std::path::Path;

pub(super) use arrays::triples;
pub use arrays::write_triangles;
pub use arrays::{DiscardSink, MeshArrays, PositionsSink};
pub use glb::GlbSink;
pub(super) use glb::{ASSET, CHUNK_BYTES, HEAD_BYTES, glb_head};
pub use glb_faces::GlbFacesSink;
pub use placed::{
    Coordinates, DOUBLE_ENDINGS, FaceAttributes, FaceColumns, NUMBER_ENDINGS, PlacedSink, placed,
};
pub use ply::ply_faces;
pub use three_mf_parts::ThreeMfParts;
pub use vtp::{NumbersOf, VtpFile, vtp_corners};

/// Receives a mesh: all vertices, then all triangles, or both by turns if it likes, then [`MeshSink::finish`]. One that
/// keeps a mesh has its own `vertices_with_normals` and `triangles`, and `wants_normals` if it does; one that writes a file its
/// own `encoding` and `encoded`.
pub trait MeshSink: Send {
    /// Whether triangles name vertices by number. If not, no vertices are handed over, and the numbers in
    /// [`MeshTriangle::ids`] mean nothing.
    fn shares_vertices(&self) -> bool {
        !matches!(self.encoding(), Some(MeshEncoding { triangles: TriangleBytes::Lone(_), .. }))
    }
    /// Whether vertices come with their normals.
    fn wants_normals(&self) -> bool {
        matches!(self.encoding(), Some(MeshEncoding { vertices: VertexBytes::WithNormals(_), .. }))
    }
    /// Whether triangles may come between vertices, as soon as all that they name have come; else all vertices come first.
    fn takes_triangles_between(&self) -> bool {
        false
    }
    /// Where triangles may wait for the numbers of their vertices, in a file without a name; `None` if they are to
    /// wait in memory.
    fn folder(&self) -> Option<&Path> {
        None
    }
    /// The next vertices, world positions; the first one ever has number 0. Nobody has one of its own: all go the way of those
    /// with normals.
    fn vertices(&mut self, positions: &[[f32; 3]]) -> Result<()> {
        self.vertices_with_normals(positions, &[])
    }
    /// The same with normals, outward and of length one: as many of them for a sink that wants some, none for others.
    fn vertices_with_normals(&mut self, positions: &[[f32; 3]], normals: &[[f32; 3]]) -> Result<()> {
        let Some(encoding) = self.encoding() else { return Ok(()) };
        if self.wants_normals() && normals.len() != positions.len() {
            let what = format!("{} normals for {} vertices", normals.len(), positions.len());
            return Err(Error::setting(what, "hand over one for each"));
        }
        let mut bytes = Vec::new();
        encoding.vertices.append(positions, normals, &mut bytes);
        self.encoded(MeshChunk::Vertices(positions.len(), &bytes))
    }
    /// The next triangles. Their numbers are those of vertices received before.
    fn triangles(&mut self, facets: &[MeshTriangle]) -> Result<()> {
        let Some(encoding) = self.encoding() else { return Ok(()) };
        let bytes = match encoding.triangles {
            TriangleBytes::Lone(encode) => encoded(facets, encode),
            TriangleBytes::Numbered(encode) => {
                let ids: Vec<[u32; 3]> = facets.iter().map(|facet| facet.ids).collect();
                let mut bytes = Vec::new();
                encode(&ids, &mut bytes);
                bytes
            }
        };
        self.encoded(MeshChunk::Triangles(facets.len(), &bytes))
    }
    /// How a file takes the mesh, so that any thread can make its bytes. Where there is an encoding, they are handed
    /// over by [`MeshSink::encoded`] in place of vertices and triangles, in the same order.
    fn encoding(&self) -> Option<MeshEncoding> {
        None
    }
    /// The next vertices or triangles as [`MeshSink::encoding`] makes them.
    fn encoded(&mut self, _part: MeshChunk<'_>) -> Result<()> {
        Ok(())
    }
    /// The mesh is complete. A file gets its final name here; one that is dropped before leaves nothing.
    fn finish(&mut self) -> Result<()>;
}

/// How a mesh becomes bytes of a file.
#[derive(Clone, Copy)]
pub struct MeshEncoding {
    /// The bytes of vertices.
    pub vertices: VertexBytes,
    /// The bytes of triangles.
    pub triangles: TriangleBytes,
}

/// How vertices become bytes of a file.
#[derive(Clone, Copy)]
pub enum VertexBytes {
    /// Appends those of world positions.
    Positions(fn(&[[f32; 3]], &mut Vec<u8>)),
    /// Appends those of world positions, each with its unit normal.
    WithNormals(AppendBoth),
}

/// Appends the bytes of vertices at world positions with these unit normals.
type AppendBoth = fn(&[[f32; 3]], &[[f32; 3]], &mut Vec<u8>);

impl VertexBytes {
    /// Appends those of vertices; normals that are not wanted may be missing.
    pub(super) fn append(self, positions: &[[f32; 3]], normals: &[[f32; 3]], bytes: &mut Vec<u8>) {
        match self {
            VertexBytes::Positions(append) => append(positions, bytes),
            VertexBytes::WithNormals(append) => append(positions, normals, bytes),
        }
    }
}

/// How triangles become bytes of a file.
#[derive(Clone, Copy)]
pub enum TriangleBytes {
    /// Appends those of triangles with the positions of their corners.
    Lone(fn(&Cuts, &mut Vec<u8>)),
    /// Appends those of triangles by the numbers of their corners.
    Numbered(fn(&[[u32; 3]], &mut Vec<u8>)),
}

/// The folder that a file lies in.
fn folder_of(file: &Path) -> Option<&Path> {
    file.parent().map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder })
}

/// A part of a mesh as bytes of a file.
#[derive(Clone, Copy, Debug)]
pub enum MeshChunk<'a> {
    /// So many vertices.
    Vertices(usize, &'a [u8]),
    /// So many triangles.
    Triangles(usize, &'a [u8]),
}

/// Begins a mesh in a file, in units of so many metres, whose vertices have normals or not.
type Begin = fn(PartFile, Option<f64>, bool) -> Result<Box<dyn MeshSink>>;

/// A format of mesh files.
struct MeshFormat {
    /// Ending of their names, in lower case.
    ending: &'static str,
    /// What is to be said beside it.
    note: &'static str,
    begin: Begin,
    /// Whether vertices can have normals.
    has_normals: bool,
}

/// All formats: a new one is a file with its sink and a line here.
#[rustfmt::skip]
const FORMATS: [MeshFormat; 6] = [
    MeshFormat { ending: "stl", note: " (binary)", begin: |file, _, _| Ok(Box::new(stl::StlSink::new(file)?)), has_normals: false },
    MeshFormat { ending: "ply", note: " (binary)", begin: |file, _, normals| Ok(Box::new(ply::PlySink::new(file, normals)?)), has_normals: true },
    MeshFormat { ending: "obj", note: "", begin: |file, _, normals| Ok(Box::new(obj::ObjSink::new(file, normals)?)), has_normals: true },
    MeshFormat { ending: "3mf", note: "", begin: |file, metres, _| Ok(Box::new(three_mf::ThreeMfSink::new(file, metres)?)), has_normals: false },
    MeshFormat { ending: "glb", note: "", begin: |file, metres, normals| Ok(Box::new(glb::GlbSink::new(file, metres, normals)?)), has_normals: true },
    MeshFormat { ending: "vtp", note: "", begin: |file, _, _| Ok(Box::new(vtp::VtpSink::new(file)?)), has_normals: false },
];

/// Endings of the mesh files that are written, in lower case.
pub fn written_mesh_endings() -> impl Iterator<Item = &'static str> {
    FORMATS.iter().map(|format| format.ending)
}

/// They as a list with dots and notes, as in ".stl (binary), .ply (binary), .obj"; `last` stands before the last one.
pub fn listed_mesh_endings(last: &str) -> String {
    listed(FORMATS.iter().map(|MeshFormat { ending, note, .. }| format!(".{ending}{note}")), last)
}

/// Endings of those whose vertices may have normals, as such a list.
fn listed_endings_with_normals(last: &str) -> String {
    let with_normals = FORMATS.iter().filter(|format| format.has_normals);
    listed(with_normals.map(|format| format!(".{}", format.ending)), last)
}

fn listed(all: impl Iterator<Item = String>, last: &str) -> String {
    let mut all: Vec<String> = all.collect();
    let end = all.pop().unwrap_or_default();
    format!("{}{last}{end}", all.join(", "))
}

/// A sink for a mesh file by the ending of its name: binary STL, binary little-endian PLY with shared
/// vertices, OBJ, 3MF, binary glTF (GLB), or VTK PolyData. The file is written as `<name>.part` beside `path`, and made durable and
/// renamed when it is finished.
///
/// `metres` is the length of the unit of positions, for the two formats that know lengths; without it positions count
/// as millimetres in a 3MF, as metres in a GLB.
///
/// # Errors
///
/// [`Error::Setting`] for an unknown ending, [`Error::Io`] if the file cannot be made.
pub fn create_sink(path: &Path, metres: Option<f64>) -> Result<Box<dyn MeshSink>> {
    let MeshFormat { begin, .. } = format_of(path)?;
    begin(PartFile::create(path)?, metres, false)
}

/// As [`create_sink`], for a file whose vertices have normals: PLY with `nx`, `ny` and `nz`, OBJ with a `vn` for each
/// vertex, or GLB with the attribute `NORMAL`. Readers of these shade smoothly then, by one normal a vertex, also across
/// sharp edges; a GLB without normals is shaded flat (Khronos glTF 2.0, §3.7.2.1).
///
/// # Errors
///
/// [`Error::Setting`] for an unknown ending and for STL, 3MF and VTP, whose vertices have no normals, [`Error::Io`] if the file
/// cannot be made.
pub fn create_sink_with_normals(path: &Path, metres: Option<f64>) -> Result<Box<dyn MeshSink>> {
    let MeshFormat { begin, has_normals, .. } = format_of(path)?;
    if !has_normals {
        return Err(Error::setting(
            format!("{}: the vertices of this format have no normals", path.display()),
            format!(
                "leave them out, or choose a name that ends in one of {}",
                listed_endings_with_normals(", ")
            ),
        ));
    }
    begin(PartFile::create(path)?, metres, true)
}

fn format_of(path: &Path) -> Result<&'static MeshFormat> {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    FORMATS.iter().find(|format| format.ending == ending).ok_or_else(|| {
        Error::setting(
            format!("{}: unknown mesh format", path.display()),
            format!("choose a name that ends in one of {}", listed_mesh_endings(", ")),
        )
    })
}
