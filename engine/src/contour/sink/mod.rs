//! Where a mesh goes: arrays in memory, or files by format, written under a temporary name.

mod arrays;
mod obj;
mod ply;
mod stl;

use super::cut::{Cuts, encoded};
use super::polygons::Facet;
use crate::error::{Error, Result};
use crate::part::PartFile;
use std::path::Path;

pub use arrays::MeshArrays;

/// Receives a mesh: all vertices, then all triangles, then [`MeshSink::finish`]. One that keeps a mesh has its own
/// `vertices` and `triangles`, one that writes a file its own `encoding` and `encoded`.
pub trait MeshSink: Send {
    /// Whether triangles name vertices by number. If not, no vertices are handed over, and the numbers in
    /// [`Facet::ids`] mean nothing.
    fn shares_vertices(&self) -> bool {
        true
    }
    /// The next vertices, world positions; the first one ever has number 0.
    fn vertices(&mut self, positions: &[[f32; 3]]) -> Result<()> {
        let Some(encoding) = self.encoding() else { return Ok(()) };
        let mut bytes = Vec::new();
        (encoding.vertices)(positions, &mut bytes);
        self.encoded(Encoded::Vertices(positions.len(), &bytes))
    }
    /// The next triangles. Their numbers are those of vertices received before.
    fn triangles(&mut self, facets: &[Facet]) -> Result<()> {
        let Some(encoding) = self.encoding() else { return Ok(()) };
        self.encoded(Encoded::Triangles(facets.len(), &encoded(facets, encoding)))
    }
    /// How a file takes the mesh, so that any thread can make its bytes. Where there is an encoding, they are handed
    /// over by [`MeshSink::encoded`] in place of vertices and triangles, in the same order.
    fn encoding(&self) -> Option<Encoding> {
        None
    }
    /// The next vertices or triangles as [`MeshSink::encoding`] makes them.
    fn encoded(&mut self, _part: Encoded<'_>) -> Result<()> {
        Ok(())
    }
    /// The mesh is complete. A file gets its final name here; one that is dropped before leaves nothing.
    fn finish(&mut self) -> Result<()>;
}

/// How a mesh becomes bytes of a file.
#[derive(Clone, Copy)]
pub struct Encoding {
    /// Appends the bytes of vertices at world positions.
    pub vertices: fn(&[[f32; 3]], &mut Vec<u8>),
    /// Appends the bytes of triangles.
    pub facets: fn(&Cuts, &mut Vec<u8>),
}

/// A part of a mesh as bytes of a file.
#[derive(Clone, Copy, Debug)]
pub enum Encoded<'a> {
    /// So many vertices.
    Vertices(usize, &'a [u8]),
    /// So many triangles.
    Triangles(usize, &'a [u8]),
}

/// Known file endings.
const ENDINGS: &str = ".stl (binary), .ply (binary), .obj";

/// A sink for a mesh file by the ending of its name: binary STL, binary little-endian PLY with shared
/// vertices, or OBJ. The file is written as `<name>.part` beside `path`, and made durable and renamed when it is
/// finished.
///
/// # Errors
///
/// [`Error::Setting`] for an unknown ending, [`Error::Io`] if the file cannot be made.
pub fn create_sink(path: &Path) -> Result<Box<dyn MeshSink>> {
    format_of(path)?(PartFile::create(path)?)
}

/// Begins a mesh in a file.
type Begin = fn(PartFile) -> Result<Box<dyn MeshSink>>;

fn format_of(path: &Path) -> Result<Begin> {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    Ok(match ending.as_str() {
        "stl" => |file| Ok(Box::new(stl::StlSink::new(file)?)),
        "ply" => |file| Ok(Box::new(ply::PlySink::new(file)?)),
        "obj" => |file| Ok(Box::new(obj::ObjSink::new(file)?)),
        _ => {
            return Err(Error::setting(
                format!("{}: unknown mesh format", path.display()),
                format!("choose a name that ends in one of {ENDINGS}"),
            ));
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::outputs::{NAME, cut_everywhere, fail_everywhere};

    const POSITIONS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 2.0, 1e-7], [-3.25, 0.1, 7e8]];
    const TRIANGLES: [[u32; 3]; 2] = [[0, 1, 2], [1, 3, 2]];

    fn facets() -> Vec<Facet> {
        TRIANGLES.iter().map(|&ids| Facet { ids, corners: ids.map(|n| POSITIONS[n as usize]) }).collect()
    }

    fn write(path: &Path) -> Vec<u8> {
        let mut sink = create_sink(path).unwrap();
        sink.vertices(&POSITIONS[..3]).unwrap();
        sink.vertices(&POSITIONS[3..]).unwrap();
        sink.triangles(&facets()[..1]).unwrap();
        sink.triangles(&facets()[1..]).unwrap();
        assert!(!path.exists());
        sink.finish().unwrap();
        drop(sink);
        let bytes = std::fs::read(path).unwrap();
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
        bytes
    }

    fn floats(bytes: &[u8]) -> Vec<f32> {
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    }

    #[test]
    fn stl_round_trips() {
        let dir = tempfile::tempdir().unwrap();
        let bytes = write(&dir.path().join("a.STL"));
        assert_eq!(bytes[80..84], 2u32.to_le_bytes());
        assert_eq!(bytes.len(), 84 + 2 * 50);
        assert!(!bytes.starts_with(b"solid"));
        for (record, facet) in bytes[84..].chunks_exact(50).zip(facets()) {
            let values = floats(&record[..48]);
            assert_eq!(values[3..], facet.corners.concat());
            let length = values[..3].iter().map(|n| n * n).sum::<f32>();
            assert!((length - 1.0).abs() < 1e-5);
            assert_eq!(record[48..], [0, 0]);
        }
        assert!(floats(&bytes[84..96])[2] > 0.99);
    }

    #[test]
    fn ply_round_trips() {
        let dir = tempfile::tempdir().unwrap();
        let bytes = write(&dir.path().join("a.ply"));
        let end = b"end_header\n";
        let at = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
        let header = std::str::from_utf8(&bytes[..at]).unwrap();
        assert!(header.starts_with("ply\nformat binary_little_endian 1.0\n"));
        assert!(header.contains("\nelement vertex 4\n") && header.contains("\nelement face 2\n"));
        assert_eq!(floats(&bytes[at..at + 48]), POSITIONS.concat());
        let faces: Vec<_> = bytes[at + 48..].chunks_exact(13).collect();
        assert_eq!(faces.len(), 2);
        for (face, ids) in faces.iter().zip(TRIANGLES) {
            assert_eq!(face[0], 3);
            assert_eq!(face[1..], ids.map(u32::to_le_bytes).concat());
        }
    }

    #[test]
    fn obj_round_trips() {
        let dir = tempfile::tempdir().unwrap();
        let bytes = write(&dir.path().join("a.obj"));
        let (mut positions, mut faces) = (Vec::new(), Vec::new());
        for line in std::str::from_utf8(&bytes).unwrap().lines() {
            let words: Vec<&str> = line.split(' ').collect();
            match words[0] {
                "v" => positions.push([1, 2, 3].map(|n: usize| words[n].parse::<f32>().unwrap())),
                "f" => faces.push([1, 2, 3].map(|n: usize| words[n].parse::<u32>().unwrap() - 1)),
                _ => assert_eq!(words[0], "#"),
            }
        }
        assert_eq!(positions, POSITIONS);
        assert_eq!(faces, TRIANGLES);
    }

    #[test]
    fn arrays_hold_what_they_are_given() {
        let mut arrays = MeshArrays::default();
        arrays.vertices(&POSITIONS[..3]).unwrap();
        arrays.vertices(&POSITIONS[3..]).unwrap();
        facets().chunks(1).for_each(|part| arrays.triangles(part).unwrap());
        arrays.finish().unwrap();
        assert_eq!(arrays, MeshArrays { positions: POSITIONS.to_vec(), triangles: TRIANGLES.to_vec() });
    }

    #[test]
    fn an_unfinished_mesh_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["a.stl", "a.ply", "a.obj"] {
            std::fs::write(dir.path().join(name), "old").unwrap();
            let mut sink = create_sink(&dir.path().join(name)).unwrap();
            sink.vertices(&POSITIONS).unwrap();
            drop(sink);
            assert_eq!(std::fs::read(dir.path().join(name)).unwrap(), b"old");
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 3);
    }

    #[test]
    fn every_call_may_fail_and_the_power_go() {
        for format in ["a.stl", "a.ply", "a.obj"] {
            let begin = format_of(Path::new(format)).unwrap();
            // Enough for several writes.
            let many = vec![facets(); 1000].concat();
            let write = |disk| {
                let mut sink = begin(PartFile::create_on(disk, Path::new(NAME))?)?;
                sink.vertices(&POSITIONS)?;
                (0..4).try_for_each(|_| sink.triangles(&many))?;
                sink.finish()
            };
            assert!(fail_everywhere(&write) >= 24, "{format}");
            assert!(cut_everywhere(&write, 10) > 100, "{format}");
        }
    }

    #[test]
    fn errors_are_one_line_and_name_the_way_out() {
        let message = |path: &str| create_sink(Path::new(path)).err().unwrap().to_string();
        assert!(message("a.step").contains(".stl (binary), .ply (binary), .obj"));
        let missing = message("/nonexistent/a.stl");
        assert!(missing.contains("/nonexistent/a.stl") && !missing.contains('\n'), "{missing}");
    }
}
