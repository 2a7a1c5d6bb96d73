//! Binary STL: 80 bytes of header, a 32-bit count, then 50 bytes a facet. Positions are f32 and not shared.

use super::super::polygons::Facet;
use super::MeshSink;
use super::part::MeshFile;
use crate::error::{Error, Result};
use std::io::Write;
use std::path::Path;

const HEADER_BYTES: usize = 80;
const FACET_BYTES: usize = 50;
const TITLE: &[u8] = b"binary STL, written by Brickfield";

pub(super) struct StlSink {
    file: MeshFile,
    count: u32,
    buffer: Vec<u8>,
}

impl StlSink {
    pub(super) fn create(path: &Path) -> Result<StlSink> {
        let mut file = MeshFile::create(path)?;
        // Readers take a file that starts with "solid" for the text form.
        let mut header = [b' '; HEADER_BYTES + 4];
        header[..TITLE.len()].copy_from_slice(TITLE);
        header[HEADER_BYTES..].fill(0);
        file.write(|w| w.write_all(&header))?;
        Ok(StlSink { file, count: 0, buffer: Vec::new() })
    }
}

impl MeshSink for StlSink {
    fn shares_vertices(&self) -> bool {
        false
    }

    fn vertices(&mut self, _positions: &[[f32; 3]]) -> Result<()> {
        Ok(())
    }

    fn triangles(&mut self, facets: &[Facet]) -> Result<()> {
        let count = u32::try_from(facets.len()).ok().and_then(|n| self.count.checked_add(n));
        self.count = count.ok_or_else(|| {
            Error::setting(
                format!("{}: an STL file cannot hold more than 2^32 - 1 facets", self.file.path().display()),
                "write .ply or choose a coarser level with --level",
            )
        })?;
        self.buffer.clear();
        self.buffer.reserve(facets.len() * FACET_BYTES);
        for facet in facets {
            let mut record = [0; FACET_BYTES];
            let values = [normal(&facet.corners), facet.corners[0], facet.corners[1], facet.corners[2]];
            for (to, value) in record.chunks_exact_mut(4).zip(values.as_flattened()) {
                to.copy_from_slice(&value.to_le_bytes());
            }
            self.buffer.extend_from_slice(&record);
        }
        let buffer = &self.buffer;
        self.file.write(|w| w.write_all(buffer))
    }

    fn finish(&mut self) -> Result<()> {
        self.file.patch(HEADER_BYTES as u64, &self.count.to_le_bytes())?;
        self.file.finish()
    }
}

/// Unit normal by the right-hand rule; zero, as the format has it, for a facet without area.
fn normal([a, b, c]: &[[f32; 3]; 3]) -> [f32; 3] {
    let difference =
        |p: &[f32; 3]| -> [f64; 3] { std::array::from_fn(|n| f64::from(p[n]) - f64::from(a[n])) };
    let (u, v) = (difference(b), difference(c));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    if length > 0.0 { n.map(|c| (c / length) as f32) } else { [0.0; 3] }
}
