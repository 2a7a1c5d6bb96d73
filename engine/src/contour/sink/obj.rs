//! Wavefront OBJ: text, shared vertices, indices from 1.

use super::{Encoded, Encoding, MeshSink, Triangles, folder_of};
use crate::error::Result;
use crate::part::PartFile;
use std::io::Write;
use std::path::Path;

/// Most bytes of a line of small numbers, to reserve room by.
const LINE_BYTES: usize = 32;

pub(super) struct ObjSink {
    file: PartFile,
}

impl ObjSink {
    pub(super) fn new(mut file: PartFile) -> Result<ObjSink> {
        file.append(b"# written by Brickfield\n")?;
        Ok(ObjSink { file })
    }
}

fn write_vertices(positions: &[[f32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(positions.len() * LINE_BYTES);
    for [x, y, z] in positions {
        // The shortest digits that read back as the same f32. Writing to memory cannot fail.
        let _ = writeln!(bytes, "v {x} {y} {z}");
    }
}

fn write_triangles(triangles: &[[u32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(triangles.len() * LINE_BYTES);
    for ids in triangles {
        let [a, b, c] = ids.map(|id| u64::from(id) + 1);
        let _ = writeln!(bytes, "f {a} {b} {c}");
    }
}

impl MeshSink for ObjSink {
    fn encoding(&self) -> Option<Encoding> {
        Some(Encoding { vertices: write_vertices, triangles: Triangles::Numbered(write_triangles) })
    }

    fn folder(&self) -> Option<&Path> {
        folder_of(self.file.path())
    }

    fn encoded(&mut self, part: Encoded<'_>) -> Result<()> {
        let (Encoded::Vertices(_, bytes) | Encoded::Triangles(_, bytes)) = part;
        self.file.append(bytes)
    }

    fn finish(&mut self) -> Result<()> {
        self.file.finish()
    }
}
