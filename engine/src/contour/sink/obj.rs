//! Wavefront OBJ: text, shared vertices, indices from 1.

use super::super::polygons::Facet;
use super::MeshSink;
use super::part::MeshFile;
use crate::error::Result;
use std::io::Write;
use std::path::Path;

pub(super) struct ObjSink {
    file: MeshFile,
}

impl ObjSink {
    pub(super) fn create(path: &Path) -> Result<ObjSink> {
        let mut file = MeshFile::create(path)?;
        file.write(|w| w.write_all(b"# written by Brickfield\n"))?;
        Ok(ObjSink { file })
    }
}

impl MeshSink for ObjSink {
    fn vertices(&mut self, positions: &[[f32; 3]]) -> Result<()> {
        // The shortest digits that read back as the same f32.
        self.file.write(|w| positions.iter().try_for_each(|[x, y, z]| writeln!(w, "v {x} {y} {z}")))
    }

    fn triangles(&mut self, facets: &[Facet]) -> Result<()> {
        self.file.write(|w| {
            facets.iter().try_for_each(|facet| {
                let [a, b, c] = facet.ids.map(|id| u64::from(id) + 1);
                writeln!(w, "f {a} {b} {c}")
            })
        })
    }

    fn finish(&mut self) -> Result<()> {
        self.file.finish()
    }
}
